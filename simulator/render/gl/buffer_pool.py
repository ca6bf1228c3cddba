"""Pool of off-screen buffers, in size classes.

Sizes are rounded up, for two reasons. A driver clears a whole framebuffer many times faster than a part of it (llvmpipe
draws a quad for a part), so a single large buffer would be slow. Creating a buffer takes longer than drawing into it,
so a craft whose image grows must not need a new one every few frames.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

GRAIN_PX = 128  # widths and heights are multiples of this
KEPT = 3  # largest number of sizes in the pool
# largest ratio of an existing buffer's area to the requested one: clearing the excess is cheaper than a new buffer
LARGER = 1.25


class Buffers(Protocol):
    """Textures and framebuffers of one size."""

    def release(self) -> None:
        """Free the buffers."""


B = TypeVar("B", bound=Buffers)


class BufferPool(Generic[B]):
    """Pool that creates buffers of a size at its first use, and frees the least recently used ones.

    Parameters
    ----------
    make : callable
        Function that creates buffers of a width and height [px].
    most_px : float, optional
        Limit on the total area; the buffers in use may exceed it.
    """

    def __init__(self, make: Callable[[int, int], B], most_px: float = math.inf) -> None:
        self._make, self._most_px = make, most_px
        self._kept: dict[tuple[int, int], B] = {}

    def at_least(self, width: int, height: int) -> B:
        """Return buffers of at least this size."""
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
            # free old buffers before creating new ones, to limit the peak memory
            while self._kept and (
                len(self._kept) >= KEPT or sum(w * h for w, h in self._kept) > remaining_px
            ):
                self._kept.pop(next(iter(self._kept))).release()
            buffers = self._make(*size)
        self._kept[size] = buffers  # last in order: most recently used
        return buffers
