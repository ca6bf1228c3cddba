"""The target's orbit at the start, as a user gives it: elements, state, two-line elements or an OEM file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import numpy as np
from msgspec import Meta

from simulator.runtime.sections import Degrees, Inclination, Section
from simulator.world.ephemeris.bodies import BODIES, Body, BodyName
from simulator.world.orbit.propagation import Elements, state_from_elements

if TYPE_CHECKING:
    from simulator.runtime.arrays import FloatArray


class ElementsOrbit(Section, tag_field="kind", tag="elements", frozen=True, kw_only=True):
    """Osculating Keplerian elements on GCRS axes; altitude = semi-major axis less 6378.137 km (Moon: 1737.4 km)."""

    centre: BodyName = "earth"
    altitude_km: Annotated[float, Meta(ge=10, le=50_000)]
    eccentricity: Annotated[float, Meta(ge=0, le=0.9)] = 0.0
    inclination_deg: Inclination = 0.0
    raan_deg: Degrees = 0.0
    argp_deg: Degrees = 0.0
    true_anomaly_deg: Degrees = 0.0

    @property
    def body(self) -> Body:
        """What is circled."""
        return BODIES[self.centre]

    def state(self) -> tuple[FloatArray, FloatArray]:
        """Position [m] and velocity [m s-1] from the centre of the body, GCRS axes, each (3,)."""
        return state_from_elements(
            Elements(
                semi_major_axis_m=self.body.radius_m + self.altitude_km * 1e3,
                eccentricity=self.eccentricity,
                inclination_rad=np.radians(self.inclination_deg),
                raan_rad=np.radians(self.raan_deg),
                argument_of_perigee_rad=np.radians(self.argp_deg),
                true_anomaly_rad=np.radians(self.true_anomaly_deg),
            ),
            self.body.mu_m3_s2,
        )

    @property
    def lowest_altitude_m(self) -> float:
        """Of the orbit's lowest point, above the body's radius [m]."""
        return (self.body.radius_m + self.altitude_km * 1e3) * (1 - self.eccentricity) - self.body.radius_m


class StateOrbit(Section, tag_field="kind", tag="state", frozen=True, kw_only=True):
    """Position and velocity of the target's centre of mass at the epoch from ``centre``, along GCRS axes."""

    centre: BodyName = "earth"
    r_eci_km: tuple[float, float, float]
    v_eci_km_s: tuple[float, float, float]

    @property
    def body(self) -> Body:
        """What is circled."""
        return BODIES[self.centre]

    def state(self) -> tuple[FloatArray, FloatArray]:
        """Position [m] and velocity [m s-1] from the centre of the body, GCRS axes, each (3,)."""
        return np.array(self.r_eci_km) * 1e3, np.array(self.v_eci_km_s) * 1e3


class TleOrbit(Section, tag_field="kind", tag="tle", frozen=True, kw_only=True):
    """Two-line elements, carried by SGP4 to the scenario's epoch; from there the forces move the target."""

    line1: str
    line2: str


class OemOrbit(Section, tag_field="kind", tag="oem", frozen=True, kw_only=True):
    """A CCSDS orbit ephemeris message (a path from the scenario's folder), read at the scenario's epoch."""

    centre: BodyName = "earth"
    file: str


KnownOrbit = ElementsOrbit | StateOrbit
"""Those that give a state; the others become a `StateOrbit` when their message is read."""
