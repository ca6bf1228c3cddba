"""Additive and speckle noise of an image scaled to 0..1, drawn before the image is available.

The noise depends only on seed, frame, image size and recipe. It is drawn by a few long calls that release the GIL, so a
thread can draw it while the renderer issues its first commands.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from flyaround.simulator.camera.detector.deviates import (
    bit_source,
    normal_tables,
    random_bytes,
    uniform_factors,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from flyaround.simulator.camera.detector.sensor import Sensor
    from flyaround.simulator.runtime.arrays import ByteArray, Float32Array

MIN_SHIFT = 4
"""Smallest fixed-point resolution, as a power of two: 16 steps per digital number. Below it, floats are used."""
MIN_THREADED_VALUES = 1 << 17
"""Smallest field that is worth a thread."""
MAX_DEVIATE = 4.3  # standard deviations, above the largest that `normal_tables` give
_ADDITIVE_KEY, _SPECKLE_KEY = 0, 1  # keys of the random numbers of both kinds of noise
_STRIP_VALUES = 1 << 17  # OpenCV uses several threads from twice as many values on


@dataclass(frozen=True)
class Arithmetic:
    """Number format of an image before quantisation: fixed-point int16, or float32.

    Parameters
    ----------
    full_dn : int
        Largest digital number.
    steps_per_dn : int
        Fixed-point steps per digital number; 1 in floating point.
    sigma_dn : float
        Standard deviation of the additive noise.
    """

    full_dn: int
    steps_per_dn: int
    sigma_dn: float

    @property
    def fixed_point(self) -> bool:
        """True for integer steps."""
        return self.steps_per_dn > 1

    @property
    def dtype(self) -> np.dtype[np.int16] | np.dtype[np.float32]:
        """Type of the values."""
        return np.dtype(np.int16) if self.fixed_point else np.dtype(np.float32)

    @property
    def shift(self) -> int:
        """Steps per digital number, as a power of two."""
        return self.steps_per_dn.bit_length() - 1


def choose_arithmetic(sensor: Sensor) -> Arithmetic:
    """Choose the number format for a sensor's images.

    Returns
    -------
    Arithmetic
        Fixed point with as many steps per digital number, a power of two, as fit int16 with the largest deviate;
        float32 if these are fewer than 2 to the power `MIN_SHIFT`.
    """
    full = 2**sensor.bits - 1
    sigma_dn = full * float(np.sqrt(sensor.gaussian_variance))
    brightest = full * (1 + np.sqrt(3 * sensor.speckle_variance)) + MAX_DEVIATE * sigma_dn + 1
    shift = int(np.log2(np.iinfo(np.int16).max / brightest))
    return Arithmetic(full, 2**shift if shift >= MIN_SHIFT else 1, sigma_dn)


@dataclass(frozen=True, eq=False)
class ImageNoise:
    """The random part of one image.

    Parameters
    ----------
    steps : (H, W times bands) array
        Noise plus half a digital number, because the sum is truncated; (1, 1) without additive noise.
    factors : (H, W times bands) array or None
        Factors of the speckle, or ``None``.
    """

    steps: NDArray[Any]
    factors: Float32Array | None


def start_noise(
    shape: tuple[int, ...], sensor: Sensor, seed: int, frame_index: int
) -> Callable[[], ImageNoise]:
    """Start drawing a frame's noise in another thread; return a function that waits for it, to be called once.

    Parameters
    ----------
    shape : (H, W) or (H, W, bands) tuple of int
        Of the image.
    sensor : Sensor
        The sensor.
    seed : int
        Seed of the random numbers.
    frame_index : int
        Number of the frame; with ``seed`` the key of its random numbers.

    Returns
    -------
    callable
        Function without arguments that returns the `ImageNoise`.
    """
    if sensor.detector is not None or int(np.prod(shape)) < MIN_THREADED_VALUES:
        return lambda: draw_noise(shape, sensor, seed, frame_index)
    return _thread(os.getpid()).submit(draw_noise, shape, sensor, seed, frame_index).result


@lru_cache(maxsize=1)
def _thread(_process: int) -> ThreadPoolExecutor:
    """Return a pool of one thread of this process; a forked process needs its own."""
    return ThreadPoolExecutor(1, thread_name_prefix="flyaround-noise")


def draw_noise(shape: tuple[int, ...], sensor: Sensor, seed: int, frame_index: int) -> ImageNoise:
    """Draw the noise of one image for a sensor defined by a noise recipe.

    Returns
    -------
    ImageNoise
        Additive steps, (1, 1) without additive noise, and the factors of the speckle or None. Equal arguments give
        equal noise.
    """
    size = shape[0], int(np.prod(shape[1:]))
    factors = None
    if sensor.speckle_variance > 0:
        half_width = float(np.sqrt(3 * sensor.speckle_variance))
        factors = uniform_factors(size, half_width, bit_source(seed, frame_index, _SPECKLE_KEY))
    arithmetic = choose_arithmetic(sensor)
    half = 0.5 * arithmetic.steps_per_dn
    if sensor.gaussian_variance <= 0:
        return ImageNoise(np.full((1, 1), half, arithmetic.dtype), factors)
    first, second = normal_tables(arithmetic.sigma_dn * arithmetic.steps_per_dn, arithmetic.dtype)
    raw = random_bytes(bit_source(seed, frame_index, _ADDITIVE_KEY), (2, *size))
    return ImageNoise(_table_sums(raw, first + first.dtype.type(half), second), factors)


def _table_sums(indices: ByteArray, first: NDArray[Any], second: NDArray[Any]) -> NDArray[Any]:
    """Return sums of two tables' entries for bytes (2, rows, columns).

    Strips of the image are too small for OpenCV to use its threads, which would compete with a software driver.
    """
    sums = np.empty(indices.shape[1:], first.dtype)
    rows = max(_STRIP_VALUES // max(indices.shape[2], 1), 1)
    for top in range(0, len(sums), rows):
        strip = slice(top, top + rows)
        cv2.LUT(indices[0, strip], first, dst=sums[strip])
        sums[strip] += cv2.LUT(indices[1, strip], second)
    return sums
