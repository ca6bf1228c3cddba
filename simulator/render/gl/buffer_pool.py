"""Off-screen buffers by size class: a window uses its class, or an existing one slightly larger.

A driver clears a whole framebuffer many times faster than a part of it (llvmpipe draws a quad for a part), so one
largest buffer is not enough. Creating one takes longer than drawing into it, so a craft that rotates and approaches
must not need another class every few frames.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

GRAIN_PX = 128
KEPT = 3  # sizes that are kept at once
# largest area of an existing buffer over that of the class: clearing so much more is cheaper than a new one
LARGER = 1.25


class Buffers(Protocol):
    """Textures and framebuffers of one size."""

    def release(self) -> None:
        """Free the buffers."""


B = TypeVar("B", bound=Buffers)


class BufferPool(Generic[B]):
    """Creates buffers of a class at its first use, and frees the least recently used ones.

    Parameters
    ----------
    make : function that creates buffers of a width and height [px].
    most_px : limit on the total area; the buffers in use may exceed it.
    """

    def __init__(self, make: Callable[[int, int], B], most_px: float = math.inf) -> None:
        self._make, self._most_px = make, most_px
        self._kept: dict[tuple[int, int], B] = {}

    def at_least(self, width: int, height: int) -> B:
        """Return buffers that hold a window of this size."""
        size = (-(-width // GRAIN_PX) * GRAIN_PX, -(-height // GRAIN_PX) * GRAIN_PX)
        most = LARGER * size[0] * size[1]
        # existing sizes that would hold the window if they were slightly larger
        near = [(max(w, size[0]), max(h, size[1]), (w, h)) for w, h in self._kept]
        near = [candidate for candidate in near if candidate[0] * candidate[1] <= most]
        buffers = None
        if near:
            # prefer an exact size: growing another of the same area would replace it
            *larger, at_hand = min(
                near, key=lambda candidate: (candidate[0] * candidate[1], candidate[:2] != candidate[2])
            )
            size = (larger[0], larger[1])
            buffers = self._kept.pop(at_hand)
            if at_hand != size:
                buffers.release()
                buffers = None
        if buffers is None:
            remaining_px = self._most_px - size[0] * size[1]
            # freed before others are created, for the peak memory
            while self._kept and (
                len(self._kept) >= KEPT or sum(w * h for w, h in self._kept) > remaining_px
            ):
                self._kept.pop(next(iter(self._kept))).release()
            buffers = self._make(*size)
        self._kept[size] = buffers  # last in order: most recently used
        return buffers
