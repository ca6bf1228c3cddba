"""From a scenario's [forces] section to the force model of both craft."""

from __future__ import annotations

from typing import TYPE_CHECKING

from simulator.world.forces import FullForces, Surface
from simulator.world.sky_table import SkyTable
from simulator.world.spherical_harmonics import egm96

if TYPE_CHECKING:
    from simulator import scenario as sc
    from simulator.world.forces import Forces
    from simulator.world.time import Instant

_CHASER_MASS_KG = 100.0


def force_model(f: sc.Forces, epoch: Instant, duration_s: float, target_mass_kg: float) -> Forces | None:
    """The forces asked for, or None for the plain point mass with J2."""
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
        craft=(_surface(f.target, target_mass_kg), _surface(f.chaser, _CHASER_MASS_KG)),
    )


def _surface(s: sc.SurfaceSection, mass_kg: float) -> Surface:
    return Surface(
        mass_kg=s.mass_kg or mass_kg,
        area_m2=s.area_m2,
        drag_coefficient=s.drag_coefficient,
        reflectivity=s.reflectivity,
    )
