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

SIGNAL_LEVELS = np.linspace(0, 1, 129) ** 2  # denser for little light: the noise grows with its root
NOISE_SPREAD = (0.55, 1.1)  # mean |x| is 0.80 sigma for a normal distribution, 0.87 for a uniform one
MIXED_SPREAD = (0.2, 1.5)  # demosaicing averages neighbours, a colour matrix adds unequally lit bands

MEDIAN_TOLERANCE = 0.5
"""Tolerance of the median of the noise [sigma]."""

MIN_NOISE_STEPS = 1.2
"""Noise, in steps of the digital numbers, below which rounding dominates the difference from the twin."""

MIN_PIXELS, MAX_PIXELS = 200, 500_000
"""Minimum number of pixels for a statistic, and the number that suffices for a whole image."""


def band_gains(truth: Truth) -> FloatArray:
    """Return the (3, 3) matrix from the detector's bands (columns) to the channels of a colour image (rows).

    It combines the detector's white balance and the sRGB colour matrix.
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
        faults = _check_band(truth, sensor, image[..., k], clean[..., k], mask > 0, gain)
        if faults:
            return [faults if len(gains) == 1 else f"{faults} ({('red', 'green', 'blue')[k]})"]
    return []


def _check_band(
    truth: Truth,
    sensor: Sensor,
    image: NDArray[np.unsignedinteger],
    clean: NDArray[np.unsignedinteger],
    on_craft: BoolArray,
    gain: FloatArray,
) -> str:
    """Return a sentence if the difference of one band (H, W) is not the sensor's noise, otherwise an empty string.

    Parameters
    ----------
    truth : Truth
        Truth record of the frame.
    sensor : Sensor
        Sensor whose linear numbers both images hold.
    image : (H, W) array
        Digital numbers of the image.
    clean : (H, W) array
        Digital numbers of the noise-free twin.
    on_craft : (H, W) array
        True for pixels of the target.
    gain : (bands,) array
        Weights of the detector's bands in this channel. They scale noise and dark current too.
    """
    factor = float(np.linalg.norm(gain))
    detector, encoding = sensor.detector, truth.camera.pixel_encoding
    full, black = sensor.scale_dn  # a detector saturates at its full well, above its black level
    dark_signal, spread_limits = 0.0, NOISE_SPREAD
    if detector is not None:
        # the twin has no dark current, the image has its mean
        dark_e = detector.dark_e_s * truth.scene.exposure_s * detector.pixels_per_bin
        dark_signal = float(gain.sum()) * dark_e / sensor.saturation_e
    if np.count_nonzero(gain) > 1 or (
        detector is not None and detector.colour_filter != "none" and detector.demosaic
    ):
        spread_limits = MIXED_SPREAD
    # the expected noise depends on the twin's number alone
    signal_of = (np.arange(int(clean.max(initial=0)) + 1) - black) / full
    noise = [noise_sigma(sensor, float(level), truth.scene.exposure_s) for level in SIGNAL_LEVELS]
    sigma_of = factor * np.interp(signal_of / factor, SIGNAL_LEVELS, noise)
    # the ends of the scale clip the noise
    inside_of = (signal_of > 4 * sigma_of) & (signal_of < 1 - 4 * sigma_of)
    # digital numbers were rounded, multiplied and rounded again; without noise to dither it, the twin's rounding stays
    step_of = np.full(signal_of.shape, factor / full)
    rounding_of = np.full(signal_of.shape, (factor if factor == 1 else factor + 1) / 2 / full)
    if encoding != "linear":
        top = 2**sensor.bits - 1 - black
        step_of = step_share(signal_of * full / top, encoding) * top / full
        rounding_of = step_of / 2
    rows = np.s_[:: clean.size // MAX_PIXELS | 1]  # odd stride: rows of both colours of a mosaic
    for mask, region in ((on_craft, "on the craft"), (rows, "in the picture")):
        twin = clean[mask].ravel()
        sigma, inside, rounding = sigma_of[twin], inside_of[twin], rounding_of[twin]
        residual = (image[mask].ravel().astype(float) - twin) / full - dark_signal
        is_quiet = sigma < MIN_NOISE_STEPS * step_of[twin]
        quiet_pixels, noisy_pixels = inside & is_quiet, inside & ~is_quiet
        if np.count_nonzero(quiet_pixels) >= MIN_PIXELS:
            is_outlier = np.abs(residual[quiet_pixels]) > 2 * rounding[quiet_pixels] + 4 * sigma[quiet_pixels]
            # four sigmas leave 1 pixel in 16,000; real noise has heavier tails (hot pixels, particles)
            if is_outlier.mean() > 0.01:
                return f"{region} the image is not its clean twin, but for rounding and a noise of less than one step"
        if np.count_nonzero(noisy_pixels) < MIN_PIXELS:
            continue
        spread = float(np.minimum(np.abs(residual[noisy_pixels] / sigma[noisy_pixels]), 10).mean())
        if not spread_limits[0] < spread < spread_limits[1] or _is_biased(
            residual, sigma, noisy_pixels, rounding
        ):
            return f"{region} the image less its clean twin is {spread:.2f} sigma of the noise, not about 0.8"
    # clipping below zero does not move the median of larger values
    dark = ~inside & (signal_of < 0.5)[twin]
    if np.count_nonzero(dark) >= MIN_PIXELS and _is_biased(residual, sigma, dark, rounding):
        return "the clean twin is not as dark as the image where there is little light"
    return ""


def _is_biased(residual: FloatArray, sigma: FloatArray, mask: BoolArray, rounding: FloatArray) -> bool:
    """Return True if the median of the noise deviates from zero by more than its distribution and rounding allow."""
    # the image's own median is an integer, too
    allowed = MEDIAN_TOLERANCE + 2 * float(np.median(rounding[mask])) / float(np.median(sigma[mask]))
    return abs(float(np.median(residual[mask] / sigma[mask]))) > allowed
