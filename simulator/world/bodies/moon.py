"""The Moon: a sphere of its mean radius, with SOFA's series and the IAU's rotational elements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from flyaround.simulator.world.constants import MOON_RADIUS_M, MU_MOON_M3_S2
from flyaround.simulator.world.ephemeris.body import Body
from flyaround.simulator.world.ephemeris.moon_orientation import q_moon_from_eci
from flyaround.simulator.world.ephemeris.sun_moon import moon_eci_m, moon_geometric_state

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.time.instant import Instant


@dataclass(frozen=True, kw_only=True)
class Moon(Body):
    """The Earth's satellite; its axes are those of mean Earth and pole."""

    def geocentric_state(self, now: Instant) -> tuple[FloatArray, FloatArray]:
        """Return `moon_geometric_state`."""
        return moon_geometric_state(now.tt1, now.tt2)

    def q_fixed_from_eci(self, now: Instant) -> FloatArray:
        """Return `q_moon_from_eci`."""
        return q_moon_from_eci(now)

    def apparent_m(self, now: Instant) -> FloatArray:
        """Return `moon_eci_m`."""
        return moon_eci_m(now.tt1, now.tt2)


MOON = Moon(
    name="moon",
    title="the Moon",
    mu_m3_s2=MU_MOON_M3_S2,
    radius_m=MOON_RADIUS_M,
    mean_radius_m=MOON_RADIUS_M,
    turn_rad_s=2.661699e-6,
    lowest_m=12e3,  # its highest mountain stands 10.8 km above its mean radius
    reach_m=6.61e7,
    albedo=0.12,  # geometric, in V: Allen's Astrophysical Quantities (2000), table 12.8
    surface="moon",
    degrees=(0, 2),
    acting=("sun", "solar_pressure"),
)
