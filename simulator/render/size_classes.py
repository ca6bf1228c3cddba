"""Off-screen buffers by size class: a frame's window takes the class that just holds it, and clears all of it.

A driver clears a whole framebuffer many times faster than a part of it (llvmpipe draws a quad for a part), so buffers
are not simply kept at their largest size; the few classes used last are kept.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

GRAIN_PX = 128
KEPT = 3


class Buffers(Protocol):
    """Textures and framebuffers of one size."""

    def release(self) -> None:
        """Free them."""


B = TypeVar("B", bound=Buffers)


class SizeClasses(Generic[B]):
    """Makes buffers when a class is first needed and frees those not used for longest.

    Parameters
    ----------
    make : buffers of a width and height [px].
    """

    def __init__(self, make: Callable[[int, int], B]) -> None:
        self._make = make
        self._kept: dict[tuple[int, int], B] = {}

    def at_least(self, width: int, height: int) -> B:
        """Buffers that hold a window of this size."""
        size = (-(-width // GRAIN_PX) * GRAIN_PX, -(-height // GRAIN_PX) * GRAIN_PX)
        buffers = self._kept.pop(size, None)
        if buffers is None:
            while len(self._kept) >= KEPT:
                self._kept.pop(next(iter(self._kept))).release()
            buffers = self._make(*size)
        self._kept[size] = buffers  # the last one used is the last one freed
        return buffers
