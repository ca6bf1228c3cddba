"""Constants of the Earth, Moon, Sun and light, with their sources."""

from __future__ import annotations

MU_EARTH_M3_S2 = 3.986004418e14
"""Gravitational parameter of the Earth with atmosphere, WGS 84 / IERS Conventions (2010), TCG-compatible."""

EARTH_RADIUS_M = 6_378_137.0
"""Equatorial radius, WGS 84."""

EARTH_POLAR_RADIUS_M = 6_356_752.314245
"""Polar radius, WGS 84, rounded to 1 um."""

EARTH_MEAN_RADIUS_M = 6_371_008.8
"""Mean radius (2 a + b) / 3 of WGS 84, rounded to 0.1 m."""

EARTH_RATE_RAD_S = 7.292115e-5
"""Angular velocity of the Earth, WGS 84."""

G0_M_S2 = 9.80665
"""Standard gravity, the unit of specific impulse: 3rd CGPM (1901), exact."""

J2_EARTH = 1.0826359e-3
"""Second zonal harmonic, IERS Conventions (2010), table 1.1 (not normalised, zero tide)."""

SUN_RADIUS_M = 6.957e8
"""Nominal solar radius, IAU 2015 Resolution B3."""

AU_M = 149_597_870_700.0
"""Astronomical unit, IAU 2012 Resolution B2."""

LIGHT_M_S = 299_792_458.0
"""Speed of light, exact."""

DAY_S = 86_400.0
"""Seconds per day of the Julian date."""

FLATTENING = 1 / 298.257223563
"""Flattening of the Earth's ellipsoid, WGS 84."""

MU_SUN_M3_S2 = 1.32712440018e20
"""Gravitational parameter of the Sun, JPL DE405 (Standish 1998), TDB-compatible."""

MU_MOON_M3_S2 = 4.902800066e12
"""Gravitational parameter of the Moon, JPL DE430 (Folkner et al. 2014)."""

MOON_RADIUS_M = 1_737_400.0
"""Mean radius of the Moon, IAU Working Group on Cartographic Coordinates (Archinal et al. 2011)."""

SOLAR_PRESSURE_PA = 1361.0 / LIGHT_M_S
"""Pressure of sunlight on a black surface at 1 au: nominal solar irradiance, IAU 2015 Resolution B3, over c."""
