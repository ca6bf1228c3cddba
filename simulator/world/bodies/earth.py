"""The Earth: WGS 84, at the origin of GCRS, with its air and the angles of IAU 2006/2000A."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.world.constants import (
    EARTH_MEAN_RADIUS_M,
    EARTH_POLAR_RADIUS_M,
    EARTH_RADIUS_M,
    EARTH_RATE_RAD_S,
    FLATTENING,
    J2_EARTH,
    MU_EARTH_M3_S2,
)
from flyaround.simulator.world.ephemeris.body import Body, BodyAir
from flyaround.simulator.world.ephemeris.earth_orientation import pole_eci, q_itrs_from_eci

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.time.instant import Instant

_AEROSOL_M = 4.44e-6
"""Continental average, optical depth 0.05: Angstrom turbidity 0.0053, exponent 0, as in Bruneton (2017)."""


@dataclass(frozen=True, kw_only=True)
class Earth(Body):
    """The body whose centre GCRS starts from."""

    def geocentric_state(self, now: Instant) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002 - it stays there
        """Return zeros."""
        return np.zeros(3), np.zeros(3)

    def q_fixed_from_eci(self, now: Instant) -> FloatArray:
        """Return `q_itrs_from_eci`."""
        return q_itrs_from_eci(now)

    @property
    def polar_radius_m(self) -> float:
        """Polar radius [m], as WGS 84 tabulates it."""
        return EARTH_POLAR_RADIUS_M

    def pole_eci(self, now: Instant) -> FloatArray:
        """Return the celestial intermediate pole; polar motion (0.6 arcsec) has no part in it."""
        return pole_eci(now)


EARTH = Earth(
    name="earth",
    title="the Earth",
    mu_m3_s2=MU_EARTH_M3_S2,
    radius_m=EARTH_RADIUS_M,
    mean_radius_m=EARTH_MEAN_RADIUS_M,
    flattening=FLATTENING,
    j2=J2_EARTH,
    turn_rad_s=EARTH_RATE_RAD_S,
    lowest_m=100e3,
    reach_m=9.25e8,
    albedo=0.30,  # Bond albedo, Stephens et al. (2015), The albedo of Earth, Rev. Geophys. 53
    air=BodyAir(
        # Penndorf (1957), as in Bruneton & Neyret (2008)
        rayleigh_m_um4=1.24062e-6,
        rayleigh_height_m=8000.0,
        aerosol_m=_AEROSOL_M,
        aerosol_albedo=0.93,
        aerosol_height_m=1200.0,
        # 300 Dobson units; cross sections averaged over the band: Gorshelev et al. (2014), High spectral resolution
        # ozone absorption cross-sections, AMT 7
        ozone_m={"panchromatic": 1.18e-6, "red": 1.43e-6, "green": 1.75e-6, "blue": 1.67e-7},
    ),
    surface="earth",
    layer="earth",
    degrees=tuple(range(71)),
    acting=("sun", "moon", "drag", "solar_pressure"),
    has_field=True,
)
