"""Central bodies, Earth and Moon: gravitational parameter, radius and geocentric state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from flyaround.simulator.world.constants import EARTH_RADIUS_M, MOON_RADIUS_M, MU_EARTH_M3_S2, MU_MOON_M3_S2
from flyaround.simulator.world.ephemeris.sun_moon import moon_geometric_state

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.time.instant import Instant

BodyName = Literal["earth", "moon"]


@dataclass(frozen=True, kw_only=True)
class Body:
    """A central body.

    Parameters
    ----------
    name : lower case. title : as it stands in a sentence. mu_m3_s2 : gravitational parameter.
    radius_m : from which altitudes count. lowest_m : perigee altitude below which an orbit is taken for a mistake.
    reach_m : radius of its sphere of influence, beyond which a craft does not circle it (Vallado 2013, sec. 12.2).
    """

    name: BodyName
    title: str
    mu_m3_s2: float
    radius_m: float
    lowest_m: float
    reach_m: float

    def distance_problem(self, distance_m: float) -> str | None:
        """What is wrong with a distance from its centre, as the end of a sentence; None if nothing."""
        allowed = None
        if not distance_m >= self.radius_m + self.lowest_m:
            allowed = f"at least {(self.radius_m + self.lowest_m) / 1e3:.0f} km"
        elif not distance_m <= self.reach_m:
            allowed = f"at most {self.reach_m / 1e3:.0f} km"
        if allowed is None:
            return None
        return f"is {distance_m / 1e3:.1f} km from the centre of {self.title}, allowed: {allowed}"

    def geocentric_state(self, instant: Instant) -> tuple[FloatArray, FloatArray]:
        """Where its centre is and how it moves, from the Earth's, GCRS axes [m], [m s-1], each (3,)."""
        if self.name == "earth":
            return np.zeros(3), np.zeros(3)
        return moon_geometric_state(instant.tt1, instant.tt2)


EARTH = Body(
    name="earth",
    title="the Earth",
    mu_m3_s2=MU_EARTH_M3_S2,
    radius_m=EARTH_RADIUS_M,
    lowest_m=100e3,
    reach_m=9.25e8,
)
MOON = Body(
    name="moon",
    title="the Moon",
    mu_m3_s2=MU_MOON_M3_S2,
    radius_m=MOON_RADIUS_M,
    lowest_m=12e3,
    reach_m=6.61e7,
)
"""Its highest mountain stands 10.8 km above its mean radius."""

BODIES: dict[BodyName, Body] = {"earth": EARTH, "moon": MOON}
