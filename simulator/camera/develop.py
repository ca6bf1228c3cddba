"""From radiance to digital numbers: exposure, PSF, noise, quantisation. Seeded per frame.

Frame k's noise depends on (seed, k) alone, never on the frames before it nor on the number of threads:
the image is cut into fixed bands of rows and each has a generator of its own.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from simulator.arrays import Float32Array
    from simulator.camera.sensor import Sensor

NOISE_BANDS = 8


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
    signal = radiance_w_m2_sr * gain
    if sensor.blur_sigma_px > 0:
        # 3 sigma either side, as in the public recipe's 7 taps for sigma = 1 px
        taps = 2 * int(np.ceil(3 * sensor.blur_sigma_px)) + 1
        signal = cv2.GaussianBlur(signal, (taps, taps), sensor.blur_sigma_px, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(signal, np.float32)


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
    full = float(2**sensor.bits - 1)
    dtype = np.uint8 if sensor.bits <= 8 else np.uint16
    out = np.empty(signal.shape, dtype)
    edges = np.linspace(0, signal.shape[0], NOISE_BANDS + 1).astype(int)
    gaussian_sigma = np.float32(np.sqrt(sensor.gaussian_variance))
    speckle_half_width = np.float32(np.sqrt(3 * sensor.speckle_variance))

    def develop_band(k: int) -> None:
        rows = slice(edges[k], edges[k + 1])
        rng = np.random.Generator(np.random.SFC64(np.random.SeedSequence(seed, spawn_key=(frame_index, k))))
        band = np.clip(signal[rows], 0.0, 1.0)
        scratch = np.empty_like(band)
        if speckle_half_width > 0:
            rng.random(dtype=np.float32, out=scratch)
            band *= 1 + (2 * scratch - 1) * speckle_half_width
        if gaussian_sigma > 0:
            rng.standard_normal(dtype=np.float32, out=scratch)
            scratch *= gaussian_sigma
            band += scratch
        np.clip(band, 0.0, 1.0, out=band)
        band *= np.float32(full)
        band += np.float32(0.5)
        out[rows] = band.astype(dtype)

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(develop_band, range(NOISE_BANDS)))
    return out
