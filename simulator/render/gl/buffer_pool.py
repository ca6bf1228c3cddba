"""Off-screen buffers by size class: a frame's window takes the class that just holds it, or one at hand a bit larger.

A driver clears a whole framebuffer many times faster than a part of it (llvmpipe draws a quad for a part), so buffers
are not simply kept at their largest size. But to make one takes longer than to draw into it: a craft that turns and
comes nearer would ask for another class every few frames.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

GRAIN_PX = 128
KEPT = 3
# area of a buffer at hand over that of the class: so much more to clear is cheaper than a new one
LARGER = 1.25


class Buffers(Protocol):
    """Textures and framebuffers of one size."""

    def release(self) -> None:
        """Free them."""


B = TypeVar("B", bound=Buffers)


class BufferPool(Generic[B]):
    """Makes buffers when a class is first needed and frees those not used for longest.

    Parameters
    ----------
    make : buffers of a width and height [px].
    most_px : area of all that are kept, unless those in use alone have more.
    """

    def __init__(self, make: Callable[[int, int], B], most_px: float = math.inf) -> None:
        self._make, self._most_px = make, most_px
        self._kept: dict[tuple[int, int], B] = {}

    def at_least(self, width: int, height: int) -> B:
        """Buffers that hold a window of this size."""
        size = (-(-width // GRAIN_PX) * GRAIN_PX, -(-height // GRAIN_PX) * GRAIN_PX)
        most = LARGER * size[0] * size[1]
        # those that would hold the window if they were a little larger here or there
        near = [(max(w, size[0]), max(h, size[1]), (w, h)) for w, h in self._kept]
        near = [found for found in near if found[0] * found[1] <= most]
        buffers = None
        if near:
            # of the same area the one that is right as it is: another grown to its size would take its place
            *larger, at_hand = min(near, key=lambda found: (found[0] * found[1], found[:2] != found[2]))
            size = (larger[0], larger[1])
            buffers = self._kept.pop(at_hand)
            if at_hand != size:
                buffers.release()
                buffers = None
        if buffers is None:
            left = self._most_px - size[0] * size[1]
            # freed before others are made: a process' largest moment counts
            while self._kept and (len(self._kept) >= KEPT or sum(w * h for w, h in self._kept) > left):
                self._kept.pop(next(iter(self._kept))).release()
            buffers = self._make(*size)
        self._kept[size] = buffers  # the last one used is the last one freed
        return buffers
