"""Additive noise of a recipe on a 0..1 image: a field of its own, so that it can be drawn before the picture is there.

A field depends on (seed, frame, size, recipe) alone. It is a few long calls that leave Python's lock alone, so that a
thread draws it while the renderer's first commands keep one processor busy.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from simulator.camera.deviates import bit_source, normal_tables, random_bytes

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from simulator.camera.sensor import Sensor

MIN_SHIFT = 4
"""Fewer steps than 16 a digital number are not fine enough: then the arithmetic is in floating point."""
LEAST_AHEAD = 1 << 17
"""Values of a field that is worth a thread: waking one takes as long as to draw a smaller one."""
_ADDITIVE_KEY = 0


@dataclass(frozen=True)
class Arithmetic:
    """How digital numbers are counted on their way: in steps of an int16, or in floating point.

    Parameters
    ----------
    full_dn : largest digital number. steps_per_dn : 1 in floating point. sigma_dn : of the additive noise.
    """

    full_dn: int
    steps_per_dn: int
    sigma_dn: float

    @property
    def fixed_point(self) -> bool:
        """Whether the steps are whole numbers."""
        return self.steps_per_dn > 1

    @property
    def dtype(self) -> np.dtype[np.int16] | np.dtype[np.float32]:
        """Of the values."""
        return np.dtype(np.int16) if self.fixed_point else np.dtype(np.float32)

    @property
    def shift(self) -> int:
        """Steps of one digital number, as a power of two."""
        return self.steps_per_dn.bit_length() - 1


def arithmetic_of(sensor: Sensor) -> Arithmetic:
    """As many steps per digital number as sixteen bits hold with 4.3 sigma to spare."""
    full = 2**sensor.bits - 1
    sigma_dn = full * float(np.sqrt(sensor.gaussian_variance))
    brightest = full * (1 + np.sqrt(3 * sensor.speckle_variance)) + 4.3 * sigma_dn + 1
    shift = int(np.log2(32767 / brightest))
    return Arithmetic(full, 2**shift if shift >= MIN_SHIFT else 1, sigma_dn)


def begin_noise(
    shape: tuple[int, ...], sensor: Sensor, seed: int, frame_index: int
) -> Callable[[], NDArray[Any]]:
    """Have a frame's field drawn by another thread; the result, called once, waits for it.

    Parameters
    ----------
    shape : (H, W) or (H, W, bands) of the picture.
    """
    if sensor.detector is not None or int(np.prod(shape)) < LEAST_AHEAD:
        return lambda: noise_field(shape, sensor, seed, frame_index)
    return _thread(os.getpid()).submit(noise_field, shape, sensor, seed, frame_index).result


@lru_cache(maxsize=1)
def _thread(_process: int) -> ThreadPoolExecutor:
    """One thread that waits for work. A forked process needs its own."""
    return ThreadPoolExecutor(1, thread_name_prefix="flyaround-noise")


def noise_field(shape: tuple[int, ...], sensor: Sensor, seed: int, frame_index: int) -> NDArray[Any]:
    """(H, W times bands) noise plus half a digital number, for what cuts the fraction off, in steps.

    Of a recipe without additive noise it is (1, 1), the half alone. A detector in electrons has no field: (0, 0).
    """
    arithmetic = arithmetic_of(sensor)
    half = 0.5 * arithmetic.steps_per_dn
    if sensor.detector is not None:
        return np.empty((0, 0), arithmetic.dtype)
    if sensor.gaussian_variance <= 0:
        return np.full((1, 1), half, arithmetic.dtype)
    rows, columns = shape[0], int(np.prod(shape[1:]))
    first, second = normal_tables(arithmetic.sigma_dn * arithmetic.steps_per_dn, arithmetic.dtype)
    drawn = random_bytes(bit_source(seed, frame_index, _ADDITIVE_KEY), (2, rows, columns))
    field = cv2.LUT(drawn[0], first + first.dtype.type(half))
    field += cv2.LUT(drawn[1], second)
    return field
