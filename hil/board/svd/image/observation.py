"""One image on its way through the stages: its noise, its background, and what each stage took and found."""

from __future__ import annotations

import time
from functools import cached_property
from typing import Any, Dict, Optional, Tuple

import numpy as np

from flyaround.hil.board.svd.image.noise import clipped_noise

Array = np.ndarray

# What the stages found, by name, for debug pictures.
Trace = Dict[str, Any]


class Observation:
    """A picture with its noise and background, and the record of its stages.

    Parameters
    ----------
    image : (H, W). noise : standard deviation.
    black : what the camera adds to light. background : level of empty space, negative when it is not empty.
    likely : (h, w) map of the craft against a textured background, see saliency_map; None where it was not needed.
    trace : receives what ``keep`` is given; None costs nothing. drawn : what poses were drawn as on each patch.
    straight : the last part of it that was straightened, with its box.
    """

    def __init__(self, image: Array, trace: Optional[Trace] = None) -> None:
        self.image = image
        self.trace = trace
        self.noise = 0.0
        self.black = 0.0
        self.background = -1.0
        self.likely: Optional[Array] = None
        # a second search begins with poses of the first: what was drawn for them, by patch
        self.drawn: Dict[Any, Dict[Any, Any]] = {}
        # what the lens bent, straightened: the last box and its pixels
        self.straight: Optional[Tuple[Any, Array]] = None
        self.stages_ms: Dict[str, float] = {}
        self.counts: Dict[str, int] = {}
        self._last = time.perf_counter()

    @cached_property
    def clipped(self) -> float:
        """Standard deviation of noise that is cut off at zero, 0 where none is."""
        # a limb or a coast with zeros beside it is no noise
        return min(clipped_noise(self.image), 1.25 * self.noise)

    def mark(self, stage: str) -> None:
        """Add the time since the last mark to ``stage``."""
        now = time.perf_counter()
        self.stages_ms[stage] = self.stages_ms.get(stage, 0.0) + 1e3 * (now - self._last)
        self._last = now

    def count(self, what: str, number: int) -> None:
        """Add to a counter."""
        self.counts[what] = self.counts.get(what, 0) + number

    @property
    def shows_all(self) -> bool:
        """Whether somebody asked for every stage, also those that the pose did not need."""
        return self.trace is not None and "every_stage" in self.trace

    def keep(self, what: str, value: Any) -> None:  # noqa: ANN401 - arrays, regions, segments
        """Keep what a stage found, where somebody looks."""
        if self.trace is not None:
            self.trace[what] = value
