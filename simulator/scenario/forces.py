"""From a scenario's [forces] section to the force model of both craft."""

from __future__ import annotations

from typing import TYPE_CHECKING

from simulator.errors import UserError
from simulator.world.ephemeris.bodies import MOON
from simulator.world.ephemeris.ephemeris_table import SkyTable
from simulator.world.orbit.forces import FullForces, Surface
from simulator.world.orbit.moon_forces import MoonForces
from simulator.world.orbit.spherical_harmonics import egm96

if TYPE_CHECKING:
    from simulator.scenario import motion as sm
    from simulator.world.ephemeris.bodies import Body
    from simulator.world.orbit.forces import Forces
    from simulator.world.time.instant import Instant

_CHASER_MASS_KG = 100.0
_MOON_DEGREE = 2


def force_model(
    f: sm.Forces, epoch: Instant, duration_s: float, target_mass_kg: float, body: Body
) -> Forces | None:
    """The forces asked for about a body, or None for the plain point mass with J2 (the Earth)."""
    craft = (_surface(f.target, target_mass_kg), _surface(f.chaser, _CHASER_MASS_KG))
    if body is MOON:
        return MoonForces(
            epoch=epoch,
            sky=SkyTable.of(epoch, duration_s),
            oblate=f.gravity_degree == _MOON_DEGREE,
            sun=f.sun,
            solar_pressure=f.solar_pressure,
            craft=craft,
        )
    if f.gravity_degree is None and not (f.sun or f.moon or f.drag or f.solar_pressure):
        return None
    degree = 2 if f.gravity_degree is None else f.gravity_degree
    return FullForces(
        sky=SkyTable.of(epoch, duration_s),
        harmonics=egm96(degree) if degree >= 2 else None,
        sun=f.sun,
        moon=f.moon,
        drag=f.drag,
        solar_pressure=f.solar_pressure,
        craft=craft,
    )


def check_forces(f: sm.Forces, body: Body, where: str) -> None:
    """Refuse forces that the Moon does not have.

    Raises
    ------
    UserError
        With file, key, value and what is allowed.
    """
    if body is not MOON:
        return
    if f.gravity_degree not in {None, 0, _MOON_DEGREE}:
        raise UserError(
            f"{where}: key forces.gravity_degree is {f.gravity_degree}, allowed about the Moon: 0 or {_MOON_DEGREE}"
        )
    for key in ("moon", "drag"):
        if getattr(f, key):
            why = "is the centre of this orbit" if key == "moon" else "needs air, and the Moon has none"
            raise UserError(f"{where}: key forces.{key} is true, but it {why}: remove the key")


def _surface(s: sm.SurfaceSection, mass_kg: float) -> Surface:
    return Surface(
        mass_kg=s.mass_kg or mass_kg,
        area_m2=s.area_m2,
        drag_coefficient=s.drag_coefficient,
        reflectivity=s.reflectivity,
    )
