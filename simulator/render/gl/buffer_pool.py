"""Pool of off-screen buffers, in size classes.

One large buffer for all uses would be slow, because a driver clears a whole framebuffer much faster than a part
of it (llvmpipe draws a quad for a part). One buffer per size would be slow too, because creating a buffer takes longer
than drawing into it. So sizes are rounded up, and a few buffers are reused.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

GRAIN_PX = 128
"""Widths and heights are multiples of this."""
MAX_BUFFERS = 3
"""Largest number of sizes in the pool."""
MAX_AREA_RATIO = 1.25
"""Largest area of a reused buffer over the requested area: clearing the excess is cheaper than a new buffer."""


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
    max_area_px : float, optional
        Limit on the total area; the buffers in use may exceed it.
    """

    def __init__(self, make: Callable[[int, int], B], max_area_px: float = math.inf) -> None:
        self._make, self._max_area_px = make, max_area_px
        self._buffers: dict[tuple[int, int], B] = {}

    def at_least(self, width: int, height: int) -> B:
        """Return buffers of at least this size."""
        size = (-(-width // GRAIN_PX) * GRAIN_PX, -(-height // GRAIN_PX) * GRAIN_PX)
        max_area = MAX_AREA_RATIO * size[0] * size[1]
        # existing sizes, enlarged where they are too small
        candidates = [(max(w, size[0]), max(h, size[1]), (w, h)) for w, h in self._buffers]
        candidates = [candidate for candidate in candidates if candidate[0] * candidate[1] <= max_area]
        buffers = None
        if candidates:
            # prefer a buffer that is large enough: an enlarged one must be created again
            *larger, existing = min(
                candidates, key=lambda candidate: (candidate[0] * candidate[1], candidate[:2] != candidate[2])
            )
            size = (larger[0], larger[1])
            buffers = self._buffers.pop(existing)
            if existing != size:
                buffers.release()
                buffers = None
        if buffers is None:
            remaining_px = self._max_area_px - size[0] * size[1]
            # free old buffers before creating new ones, to limit the peak memory
            while self._buffers and (
                len(self._buffers) >= MAX_BUFFERS or sum(w * h for w, h in self._buffers) > remaining_px
            ):
                self._buffers.pop(next(iter(self._buffers))).release()
            buffers = self._make(*size)
        self._buffers[size] = buffers  # last in order: most recently used
        return buffers
