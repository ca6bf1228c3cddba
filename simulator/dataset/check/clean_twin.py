"""Check of the clean twin: its difference from the image must be the sensor's noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.camera.detector.response import SRGB_FROM_BANDS, white_balance
from flyaround.simulator.camera.detector.transfer import decode_numbers
from flyaround.simulator.camera.encoding import step_share
from flyaround.simulator.imaging.image_formation import noise_sigma
from flyaround.simulator.scene.illumination.bands import sunlight_balance

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.camera.detector.sensor import Sensor
    from flyaround.simulator.labels.truth import Truth
    from flyaround.simulator.runtime.arrays import BoolArray, ByteArray, FloatArray

LEVELS = np.linspace(0, 1, 129) ** 2  # denser for little light: the noise grows with its root
NOISE_SPREAD = (0.55, 1.1)  # mean |x| is 0.80 sigma for a normal distribution, 0.87 for a uniform one
MIXED_SPREAD = (0.2, 1.5)  # demosaicing averages neighbours, a colour matrix adds unequally lit bands
SHIFT = 0.5
"""Tolerance of the median of the noise [sigma]."""
QUIET_STEPS = 1.2
"""Noise, in steps of the digital numbers, below which rounding dominates the difference from the twin."""
MIN_PIXELS, SUFFICIENT_PIXELS = 200, 500_000
"""Minimum number of pixels for a statistic, and the number that suffices for a whole image."""


def band_gains(truth: Truth) -> FloatArray:
    """Return the gains (3, 3) of the detector's bands (columns) in each channel of a colour image.

    White balance of a detector, and the colour matrix of sRGB.
    """
    sensor, gains = truth.scene.sensor, np.eye(3)
    if sensor.detector is not None:
        gains = np.diag(white_balance(sensor, truth.scene.optics, sunlight_balance("rgb")))
    return np.array(SRGB_FROM_BANDS) @ gains if truth.camera.pixel_encoding == "srgb" else gains


def check_clean(
    truth: Truth, image: NDArray[np.unsignedinteger], mask: ByteArray, clean: NDArray[np.unsignedinteger]
) -> list[str]:
    """Check that the image minus its clean twin is the sensor's noise, band by band."""
    if clean.shape != image.shape or clean.dtype != image.dtype:
        return [f"the clean twin is {clean.shape} {clean.dtype}, the image {image.shape} {image.dtype}"]
    gains = band_gains(truth) if image.ndim == 3 else np.ones((1, 1))
    encoding = truth.camera.pixel_encoding
    (image, sensor), (clean, _) = (
        decode_numbers(x.reshape(*mask.shape, -1), truth.scene.sensor, encoding) for x in (image, clean)
    )
    for k, gain in enumerate(gains):
        wrong = _check_band(truth, sensor, image[..., k], clean[..., k], mask > 0, gain)
        if wrong:
            return [wrong if len(gains) == 1 else f"{wrong} ({('red', 'green', 'blue')[k]})"]
    return []


def _check_band(
    truth: Truth,
    sensor: Sensor,
    image: NDArray[np.unsignedinteger],
    clean: NDArray[np.unsignedinteger],
    on_craft: BoolArray,
    gain: FloatArray,
) -> str:
    """Return how one band (H, W) deviates from the sensor's noise; empty if it does not.

    Parameters
    ----------
    sensor : Sensor
        Sensor whose linear numbers both images hold.
    gain : (bands,) array
        Factors on the detector's bands, and so on their noise and dark current.
    """
    factor = float(np.linalg.norm(gain))
    detector, encoding = sensor.detector, truth.camera.pixel_encoding
    full, black = sensor.scale_dn  # a detector saturates at its full well, above its black level
    heat, spread_limits = 0.0, NOISE_SPREAD
    if detector is not None:
        # the twin has no dark current, the image has its mean
        dark_e = detector.dark_e_s * truth.scene.exposure_s * detector.pixels_per_bin
        heat = float(gain.sum()) * dark_e / sensor.saturation_e
    if np.count_nonzero(gain) > 1 or (
        detector is not None and detector.colour_filter != "none" and detector.demosaic
    ):
        spread_limits = MIXED_SPREAD
    # the expected noise depends on the twin's number alone
    signal_of = (np.arange(int(clean.max(initial=0)) + 1) - black) / full
    noise = [noise_sigma(sensor, float(level), truth.scene.exposure_s) for level in LEVELS]
    sigma_of = factor * np.interp(signal_of / factor, LEVELS, noise)
    # the ends of the scale clip the noise
    inside_of = (signal_of > 4 * sigma_of) & (signal_of < 1 - 4 * sigma_of)
    # digital numbers were rounded, multiplied and rounded again; without noise to dither it, the twin's rounding stays
    step_of = np.full(signal_of.shape, factor / full)
    rounding_of = np.full(signal_of.shape, (factor if factor == 1 else factor + 1) / 2 / full)
    if encoding != "linear":
        top = 2**sensor.bits - 1 - black
        step_of = step_share(signal_of * full / top, encoding) * top / full
        rounding_of = step_of / 2
    rows = np.s_[:: clean.size // SUFFICIENT_PIXELS | 1]  # odd stride: rows of both colours of a mosaic
    for where, what in ((on_craft, "on the craft"), (rows, "in the picture")):
        twin = clean[where].ravel()
        sigma, inside, rounding = sigma_of[twin], inside_of[twin], rounding_of[twin]
        residual = (image[where].ravel().astype(float) - twin) / full - heat
        quiet = sigma < QUIET_STEPS * step_of[twin]
        still, noisy = inside & quiet, inside & ~quiet
        if np.count_nonzero(still) >= MIN_PIXELS:
            beyond = np.abs(residual[still]) > 2 * rounding[still] + 4 * sigma[still]
            if beyond.mean() > 0.01:
                return f"{what} the image is not its clean twin, but for rounding and a noise of less than one step"
        if np.count_nonzero(noisy) < MIN_PIXELS:
            continue
        spread = float(np.minimum(np.abs(residual[noisy] / sigma[noisy]), 10).mean())
        if not spread_limits[0] < spread < spread_limits[1] or _is_off(residual, sigma, noisy, rounding):
            return f"{what} the image less its clean twin is {spread:.2f} sigma of the noise, not about 0.8"
    # clipping below zero does not move the median of larger values
    dark = ~inside & (signal_of < 0.5)[twin]
    if np.count_nonzero(dark) >= MIN_PIXELS and _is_off(residual, sigma, dark, rounding):
        return "the clean twin is not as dark as the image where there is little light"
    return ""


def _is_off(residual: FloatArray, sigma: FloatArray, where: BoolArray, rounding: FloatArray) -> bool:
    """Return True if the median of the noise deviates from zero by more than its distribution and rounding allow."""
    # the image's own median is an integer, too
    allowed = SHIFT + 2 * float(np.median(rounding[where])) / float(np.median(sigma[where]))
    return abs(float(np.median(residual[where] / sigma[where]))) > allowed
