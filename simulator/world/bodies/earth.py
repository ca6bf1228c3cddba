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

_DENSITY_KG_M3 = (
    (0.0, 1.2250),
    (5e3, 0.73643),
    (11e3, 0.36480),
    (20e3, 0.088910),
    (32e3, 0.013555),
    (40e3, 3.9957e-3),
    (47e3, 1.4275e-3),
    (53e3, 7.1816e-4),
    (60e3, 3.0968e-4),
    (70e3, 8.2829e-5),
    (80e3, 1.8458e-5),
    (90e3, 3.416e-6),
    (100e3, 5.604e-7),
)
"""Geometric height [m] and density: U.S. Standard Atmosphere, 1976 (NOAA-S/T 76-1562), table I."""
_COLUMN_M = 8413.2
"""Integral of the density profile over the density at the ground: the scale height of the whole column."""
_AEROSOL_DEPTH, _AEROSOL_HEIGHT_M = 0.05, 1200.0
"""Vertical optical depth at 550 nm and scale height of the aerosol in clean air, far from cities and deserts."""
_AIRGLOW_W_M2_SR = {"panchromatic": 5.0e-7, "red": 1.29e-7, "green": 1.70e-7, "blue": 1.4e-7}
"""Airglow of 557.7 nm 250 R, sodium 50 R, a continuum of 0.3 R to an angstrom: Roach & Gordon (1973), The Light of the
Night Sky, Leinert et al. (1998), Astron. Astrophys. Suppl. 127, sec. 6; OH (7-2) 90 R, (8-3) 450 R and Chamberlain's
bands 80 R: Johnston (1992), Spectroscopic observations of the night airglow from 3000 A to 9200 A, thesis, abstract;
140 R of other OH bands in red: an estimate. 1 R is 1e10 / (4 pi) photons m-2 s-1 sr-1."""


@dataclass(frozen=True, kw_only=True)
class Earth(Body):
    """The Earth, whose centre is the origin of GCRS."""

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
        """Return the celestial intermediate pole; polar motion (0.6 arcsec) is neglected."""
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
    albedo=0.30,  # Bond albedo: 0.295 +- 0.008, Penttila et al. (2022), Front. Remote Sens. 3, 790723
    air=BodyAir(
        # Hansen & Travis (1974), Light scattering in planetary atmospheres, Space Sci. Rev. 16, eq. 2.30
        rayleigh_m_um4=0.008569 / _COLUMN_M,
        rayleigh_dispersion_um=(0.0113, 0.00013),
        rayleigh_height_m=_COLUMN_M,
        density=tuple((height, rho / _DENSITY_KG_M3[0][1]) for height, rho in _DENSITY_KG_M3),
        aerosol_m=_AEROSOL_DEPTH / _AEROSOL_HEIGHT_M,
        aerosol_albedo=0.93,
        aerosol_height_m=_AEROSOL_HEIGHT_M,
        # rural aerosol: Shettle & Fenn (1979), in Bird & Riordan (1986)
        aerosol_exponent=1.14,
        aerosol_g=0.7,  # mean cosine 0.76: maritime clean, Hess et al. (1998), OPAC, Bull. Am. Meteorol. Soc. 79
        # 300 Dobson units; cross sections averaged over the band: Gorshelev et al. (2014), High spectral resolution
        # ozone absorption cross-sections, AMT 7
        ozone_m={"panchromatic": 1.18e-6, "red": 1.43e-6, "green": 1.75e-6, "blue": 1.67e-7},
        airglow_w_m2_sr=_AIRGLOW_W_M2_SR,
    ),
    surface="earth",
    layer="earth",
    degrees=tuple(range(71)),
    acting=("sun", "moon", "drag", "solar_pressure"),
    has_field=True,
)
