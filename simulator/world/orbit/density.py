"""Density of the upper atmosphere: a static exponential model in layers."""

from __future__ import annotations

import math

_LAYERS = (
    (100.0, 5.297e-7, 5.877),
    (110.0, 9.661e-8, 7.263),
    (120.0, 2.438e-8, 9.473),
    (130.0, 8.484e-9, 12.636),
    (140.0, 3.845e-9, 16.149),
    (150.0, 2.070e-9, 22.523),
    (180.0, 5.464e-10, 29.740),
    (200.0, 2.789e-10, 37.105),
    (250.0, 7.248e-11, 45.546),
    (300.0, 2.418e-11, 53.628),
    (350.0, 9.518e-12, 53.298),
    (400.0, 3.725e-12, 58.515),
    (450.0, 1.585e-12, 60.828),
    (500.0, 6.967e-13, 63.822),
    (600.0, 1.454e-13, 71.835),
    (700.0, 3.614e-14, 88.667),
    (800.0, 1.170e-14, 124.64),
    (900.0, 5.245e-15, 181.05),
    (1000.0, 3.019e-15, 268.00),
)
"""Base altitude [km], density there [kg m-3], scale height [km]."""


def density_kg_m3(altitude_m: float) -> float:
    """Density of the air at ``altitude_m`` above the ellipsoid [kg m-3].

    A mean of day and night at moderate solar activity (exospheric 1000 K); the true density at 600 km swings
    by a factor of ten over a solar cycle. Below 100 km the lowest layer is continued.

    References
    ----------
    Vallado (2013), Fundamentals of Astrodynamics, table 8-4 (from Wertz 1978: CIRA-72 above 25 km).
    """
    h = altitude_m / 1e3
    base, density, scale = next((layer for layer in reversed(_LAYERS) if h >= layer[0]), _LAYERS[0])
    return density * math.exp((base - h) / scale)
