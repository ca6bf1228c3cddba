"""From radiance to digital numbers: exposure, PSF, noise, quantisation. Seeded per frame.

Frame k's noise depends on (seed, k) alone, never on the frames before it nor on the number of threads:
the image is cut into fixed bands of rows and each has a source of random bits of its own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from simulator.camera.deviates import (
    add_normal,
    bit_source,
    for_each_band,
    multiply_uniform,
    normal_tables,
)

MIN_SHIFT = 4
"""Fewer steps than 16 a digital number are not fine enough: then the arithmetic is in floating point."""

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from simulator.arrays import Float32Array
    from simulator.camera.sensor import Sensor


def expose(
    radiance_w_m2_sr: Float32Array, sensor: Sensor, exposure_s: float, band_gain: ArrayLike = 1.0
) -> Float32Array:
    """Noise-free signal on the detector: exposure, then the PSF.

    Parameters
    ----------
    radiance_w_m2_sr : (H, W) or (H, W, 3) band radiance [W m-2 sr-1].
    sensor : detector; ``full_scale_j_m2_sr`` maps to 1.
    exposure_s : integration time [s].
    band_gain : gain of each band, for example the white balance of a colour camera.

    Returns
    -------
    (H, W) or (H, W, 3) float32, 1 at full scale, not clipped.
    """
    gain = np.asarray(band_gain, np.float32) * np.float32(exposure_s / sensor.full_scale_j_m2_sr)
    if sensor.blur_sigma_px <= 0:
        return np.asarray(radiance_w_m2_sr * gain, np.float32)
    if gain.size > 1:
        return _blur(np.asarray(radiance_w_m2_sr * gain, np.float32), sensor.blur_sigma_px, 1.0)
    return _blur(radiance_w_m2_sr, sensor.blur_sigma_px, float(gain.flat[0]))


def _blur(image: Float32Array, sigma_px: float, gain: float) -> Float32Array:
    """A Gaussian blur times ``gain``, band by band; the image's border is repeated outwards."""
    # 3 sigma either side, as in the public recipe's 7 taps for sigma = 1 px
    reach = int(np.ceil(3 * sigma_px))
    taps = cv2.getGaussianKernel(2 * reach + 1, sigma_px, cv2.CV_32F)
    scaled = (taps * np.float32(gain)).astype(np.float32)
    out = np.empty(image.shape, np.float32)
    height = image.shape[0]

    def blur_band(_: int, rows: slice) -> None:
        # the rows that the taps reach into belong to the neighbouring bands
        above, below = min(reach, rows.start), min(reach, height - rows.stop)
        wide = cv2.sepFilter2D(
            image[rows.start - above : rows.stop + below],
            cv2.CV_32F,
            taps,
            scaled,
            borderType=cv2.BORDER_REPLICATE,
        )
        out[rows] = wide[above : above + rows.stop - rows.start]

    for_each_band(height, blur_band)
    return out


def noise_sigma(sensor: Sensor, signal: float = 0.0) -> float:
    """Standard deviation of the noise on a 0..1 signal, quantisation included [1]."""
    step = 1.0 / (2**sensor.bits - 1)
    return float(np.sqrt(sensor.gaussian_variance + sensor.speckle_variance * signal**2 + step**2 / 12))


def digitise(
    signal: Float32Array, sensor: Sensor, seed: int, frame_index: int
) -> NDArray[np.unsignedinteger]:
    """Digital numbers of an exposed signal: clip, speckle, Gaussian noise, clip, quantise.

    The order of the thesis recipe is not given in its source; here speckle ``I + n I`` with uniform n comes
    first, then the Gaussian term, then the clip, as MATLAB's ``imnoise`` would be called in sequence.

    Parameters
    ----------
    signal : (H, W) or (H, W, 3) float32, 1 = full scale.
    sensor : noise recipe and bit depth.
    seed, frame_index : key of this frame's random numbers.

    Returns
    -------
    Array of the signal's shape, uint8 for up to 8 bits, uint16 above.
    """
    height = signal.shape[0]
    flat = signal.reshape(height, -1)
    full = 2**sensor.bits - 1
    sigma_dn = full * float(np.sqrt(sensor.gaussian_variance))
    speckle_half_width = float(np.sqrt(3 * sensor.speckle_variance))
    out = np.empty(flat.shape, np.uint8 if sensor.bits <= 8 else np.uint16)
    # steps per digital number: as many as sixteen bits hold with 4.3 sigma to spare
    shift = int(np.log2(32767 / (full * (1 + np.sqrt(3 * sensor.speckle_variance)) + 4.3 * sigma_dn + 1)))
    fixed_point = shift >= MIN_SHIFT
    scale = 2**shift if fixed_point else 1
    tables = normal_tables(sigma_dn * scale, np.dtype(np.int16 if fixed_point else np.float32))

    def develop_band(k: int, rows: slice) -> None:
        source = bit_source(seed, frame_index, k)
        values = np.clip(flat[rows], 0.0, 1.0)
        values *= np.float32(full * scale)
        if speckle_half_width > 0:
            multiply_uniform(values, speckle_half_width, source)
        values += np.float32(0.5 * scale)  # what comes after cuts the fraction off
        steps = values.astype(np.int16) if fixed_point else values
        if sensor.gaussian_variance > 0:
            add_normal(steps, tables, source)
        if fixed_point:
            np.right_shift(steps, shift, out=steps)
        np.clip(steps, 0, full, out=steps)
        out[rows] = steps

    for_each_band(height, develop_band)
    return out.reshape(signal.shape)
