"""The camera's spectral bands: limits, solar irradiance, and reflectance per band."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from flyaround.simulator.camera.detector.response import (
    MONO_BAND_NM,
    RGB_BANDS_NM,
    sun_irradiance_between_w_m2,
)
from flyaround.simulator.world.constants import AU_M

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray

Bands = Literal["mono", "rgb"]


@dataclass(frozen=True)
class Band:
    """One spectral band.

    Parameters
    ----------
    name : str
        Name of the band.
    low_nm : float
        Lower limit of a rectangular response.
    high_nm : float
        Upper limit of a rectangular response.
    rgb_weights : tuple of float
        Share of the band's sunlight in the red, green and blue of a linear RGB reflectance.
    """

    name: str
    low_nm: float
    high_nm: float
    rgb_weights: tuple[float, float, float]

    @cached_property
    def sun_irradiance_w_m2(self) -> float:
        """Solar irradiance in the band at 1 au, normal incidence [W m-2]."""
        return sun_irradiance_between_w_m2(self.low_nm, self.high_nm)


PANCHROMATIC = Band("panchromatic", *MONO_BAND_NM, (0.443, 0.362, 0.195))
RED = Band("red", *RGB_BANDS_NM[0], (1.0, 0.0, 0.0))
GREEN = Band("green", *RGB_BANDS_NM[1], (0.0, 1.0, 0.0))
BLUE = Band("blue", *RGB_BANDS_NM[2], (0.0, 0.0, 1.0))


def bands_of(bands: Bands) -> tuple[Band, ...]:
    """Return the bands of an image, in the order of its channels.

    Returns
    -------
    tuple of Band
        The panchromatic band, or red, green and blue, in the order of the image's channels.
    """
    return (PANCHROMATIC,) if bands == "mono" else (RED, GREEN, BLUE)


def sun_irradiance_w_m2(bands: Bands, distance_m: float) -> FloatArray:
    """Return the solar irradiance per band at a distance from the Sun, normal incidence.

    Returns
    -------
    (n,) array
        Irradiance [W m-2], in the order of the image's channels.
    """
    scale = (AU_M / distance_m) ** 2
    return np.array([band.sun_irradiance_w_m2 * scale for band in bands_of(bands)])


def reflectance(bands: Bands, rgb: FloatArray) -> FloatArray:
    """Convert linear RGB reflectances (..., 3) to the bands.

    Returns
    -------
    (..., n) array
        Reflectance, in the order of the image's channels.
    """
    weights = np.array([band.rgb_weights for band in bands_of(bands)])
    return np.asarray(rgb, float) @ weights.T


def sunlight_balance(bands: Bands) -> FloatArray:
    """Return the gain per band at which a white plate in sunlight is as bright as in the panchromatic band.

    Returns
    -------
    (n,) array
        Gains, in the order of the image's channels; 1 for the panchromatic band.
    """
    return np.array([PANCHROMATIC.sun_irradiance_w_m2 / band.sun_irradiance_w_m2 for band in bands_of(bands)])
