"""Check of the clean twin: the image less it is the noise that the sensor says, on the craft and everywhere."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from simulator.camera.detector.electrons import white_balance
from simulator.imaging.image_formation import noise_sigma
from simulator.scene.illumination.bands import sunlight_balance

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from simulator.labels.truth import Truth
    from simulator.runtime.arrays import ByteArray, FloatArray

LEVELS = np.linspace(0, 1, 65)
NOISE_SPREAD = (0.55, 1.1)  # mean |x| of a normal law is 0.80 of its sigma, of a uniform one 0.87
COLOUR_SPREAD = (0.2, 3.0)  # demosaicing averages neighbours, white balance multiplies by one and more


def balance_factors(truth: Truth) -> FloatArray:
    """By how much white balance multiplies each band (3,) of a colour picture, and its noise; 1 without a detector."""
    sensor = truth.scene.sensor
    if sensor.detector is None:
        return np.ones(3)
    return white_balance(sensor, truth.scene.optics, sunlight_balance("rgb"))


def check_clean(
    truth: Truth, image: NDArray[np.unsignedinteger], mask: ByteArray, clean: NDArray[np.unsignedinteger]
) -> list[str]:
    """The image less its clean twin is the noise that the sensor says, on the craft and everywhere."""
    if clean.shape != image.shape or clean.dtype != image.dtype:
        return [f"the clean twin is {clean.shape} {clean.dtype}, the image {image.shape} {image.dtype}"]
    sensor = truth.scene.sensor
    full, black, spread_limits, heat, factor = 2.0**sensor.bits - 1, 0.0, NOISE_SPREAD, 0.0, 1.0
    if sensor.detector is not None:
        # a detector saturates where its well does, above its black level
        full, black = sensor.saturation_e / sensor.detector.gain_e_per_dn, sensor.detector.black_level_dn
        # the twin has no dark current, the image has its mean too
        heat = (
            sensor.detector.dark_e_s
            * truth.scene.exposure_s
            * sensor.detector.pixels_per_bin
            / sensor.saturation_e
        )
        if image.ndim == 3:
            factor = float(balance_factors(truth).max())
            spread_limits = (COLOUR_SPREAD[0], max(COLOUR_SPREAD[1], NOISE_SPREAD[1] * factor))
    # everything but the image hangs on the twin's number alone
    signal_of = (np.arange(int(clean.max(initial=0)) + 1) - black) / full
    sigma_of = np.interp(
        signal_of,
        LEVELS,
        [noise_sigma(sensor, float(level), truth.scene.exposure_s) for level in LEVELS],
    )
    sigma = sigma_of[clean]
    residual = (image.astype(float) - clean) / full - heat
    # white balance multiplies the dark current of two bands of three
    more_heat = max(factor - 1, 2.0) * heat if image.ndim == 3 else 0.0
    # at the ends of the scale the noise is cut off
    inside = ((signal_of > 4 * sigma_of) & (signal_of < 1 - 4 * sigma_of))[clean]
    on = (mask > 0) if image.ndim == 2 else np.broadcast_to((mask > 0)[..., None], image.shape)
    for where, what in ((inside & on, "on the craft"), (inside, "in the picture")):
        if np.count_nonzero(where) < 200:
            continue
        z = residual[where] / sigma[where]
        spread, shift = float(np.minimum(np.abs(z), 10).mean()), float(np.median(z))
        if not (
            spread_limits[0] < spread < spread_limits[1]
            and abs(shift) < 0.5 + more_heat / np.median(sigma[where])
        ):
            # a quiet sensor's image is its twin, but for the last digit
            if np.abs(residual[where] + heat).max() * full <= 1.0 and sigma[where].max() * full < 0.5:
                continue
            return [f"{what} the image less its clean twin is {spread:.2f} sigma of the noise, not about 0.8"]
    # a cut-off below zero does not move the median of what is above it
    dark = ~inside & (signal_of < 0.5)[clean]
    if np.count_nonzero(dark) >= 200 and abs(
        np.median(residual[dark] / sigma[dark])
    ) > 0.5 + more_heat / np.median(sigma[dark]):
        return ["the clean twin is not as dark as the image where there is little light"]
    return []
