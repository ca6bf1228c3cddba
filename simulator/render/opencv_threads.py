"""OpenCV on one thread for a while: strips that are shared between threads already are no work for more of them.

A thread of OpenCV's that has done its share of a strip spins until the next one comes, three quarters of the processor
time of a map that was packed from strips on two processors.
"""

from __future__ import annotations

from contextlib import contextmanager
from threading import Lock
from typing import TYPE_CHECKING

import cv2

if TYPE_CHECKING:
    from collections.abc import Iterator


class OneThread:
    """Counts who is within: the setting is the whole process's, and comes back when the last has left."""

    def __init__(self) -> None:
        self._changing, self._within, self._before = Lock(), 0, 0

    @contextmanager
    def __call__(self) -> Iterator[None]:
        """Within, and for other threads meanwhile, each call of OpenCV stays on its caller's thread."""
        with self._changing:
            if self._within == 0:
                self._before = cv2.getNumThreads()
                cv2.setNumThreads(1)
            self._within += 1
        try:
            yield
        finally:
            with self._changing:
                self._within -= 1
                if self._within == 0:
                    cv2.setNumThreads(self._before)


one_thread = OneThread()
