"""Patterns for a screen from which a camera calibrates pixel positions and brightness.

Phase-shifted sine fringes with a Gray code. Eight shifts cancel the harmonics up to the sixth that a screen's gamma
adds to a sine.

References
----------
Sansoni, Carocci and Rodella (1999), Applied Optics 38(31), 6565.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from flyaround.simulator.runtime.arrays import ByteArray

# Period of the fringes [screen px], and number of their phase shifts. A shorter period locates more precisely, and is
# blurred sooner. N even shifts cancel the harmonics of a nonlinear screen up to order N - 2; that of order N - 1 is
# sampled as the fundamental.
PERIOD_PX = 48
SHIFTS = 8

# Screen levels of the uniform patterns, from which the response is measured.
LEVELS = tuple(round(255 * k / 16) for k in range(17))
Axis = Literal["x", "y"]


@dataclass(frozen=True, eq=False)
class Pattern:
    """Pattern to show: its name, which is also the file name of the camera image, and screen levels (H, W)."""

    name: str
    image: ByteArray


def half_period_bits(size_px: int) -> int:
    """Return the number of Gray code bits for the half periods along an axis."""
    return max(1, int(np.ceil(2 * size_px / PERIOD_PX) - 1).bit_length())


def calibration_patterns(width_px: int, height_px: int) -> Iterator[Pattern]:
    """Yield all patterns for a screen, in the order shown: levels, then fringes and codes of x and of y."""
    for level in LEVELS:
        yield Pattern(f"level_{level:03}", np.full((height_px, width_px), level, np.uint8))
    axes: tuple[tuple[Axis, int], ...] = (("x", width_px), ("y", height_px))
    for axis, size in axes:
        positions = np.arange(size)
        for k in range(SHIFTS):
            wave = 127.5 + 127.5 * np.cos(2 * np.pi * (positions / PERIOD_PX - k / SHIFTS))
            yield Pattern(
                f"{axis}_phase_{k}", _filled_screen(np.rint(wave).astype(np.uint8), axis, width_px, height_px)
            )
        half = 2 * positions // PERIOD_PX
        gray = half ^ (half >> 1)
        for bit in range(half_period_bits(size)):
            row = (255 * ((gray >> bit) & 1)).astype(np.uint8)
            yield Pattern(f"{axis}_code_{bit}", _filled_screen(row, axis, width_px, height_px))


def _filled_screen(row: ByteArray, axis: Axis, width_px: int, height_px: int) -> ByteArray:
    column = row[None, :] if axis == "x" else row[:, None]
    return np.ascontiguousarray(np.broadcast_to(column, (height_px, width_px)))
