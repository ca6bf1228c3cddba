"""Sensor parameters and the seeded chain from radiance to digital numbers (blur, noise, quantisation)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

NoiseOrder = Literal["speckle_then_gaussian"]


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """Detector and its noise recipe, on a 0..1 signal (1 = full scale).

    Parameters
    ----------
    preset : name of the recipe: ``speed``, ``thesis``, ``ideal``.
    full_scale_j_m2_sr : radiance times exposure that fills the scale, per band [J m-2 sr-1].
    blur_sigma_px : standard deviation of the Gaussian PSF [px].
    speckle_variance : variance of the uniform multiplicative noise ``I + n I`` [1].
    gaussian_variance : variance of the additive noise [1].
    bits : depth of the written image.
    """

    preset: str = "speed"
    full_scale_j_m2_sr: float = 0.1
    blur_sigma_px: float = 1.0
    speckle_variance: float = 0.0
    gaussian_variance: float = 0.0022
    bits: int = 8
