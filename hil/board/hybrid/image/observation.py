"""One image on its way through the stages of ``hybrid``: its noise, its background, and the record of the stages."""

from __future__ import annotations

from functools import cached_property
from typing import Any, Dict, Optional, Tuple

import numpy as np

from flyaround.hil.board.estimation.record import StageRecord, Trace
from flyaround.hil.board.hybrid.image.noise import clipped_noise

Array = np.ndarray


class Observation(StageRecord):
    """A picture with its noise and background, and the record of its stages.

    Parameters
    ----------
    image : (H, W). noise : standard deviation.
    black : what the camera adds to light. background : level of empty space, negative when it is not empty.
    likely : (h, w) map of the craft against a textured background, see saliency_map; None where it was not needed.
    trace : receives what ``keep`` is given; None costs nothing. drawn : what poses were drawn as on each patch.
    straight : the last part of it that was straightened, with its box.
    """

    def __init__(
        self, image: Array, trace: Optional[Trace] = None, sun_camera: Optional[Array] = None
    ) -> None:
        super().__init__(image, trace, sun_camera)
        self.noise = 0.0
        self.black = 0.0
        self.background = -1.0
        self.likely: Optional[Array] = None
        # a second search begins with poses of the first: what was drawn for them, by patch
        self.drawn: Dict[Any, Dict[Any, Any]] = {}
        # what the lens bent, straightened: the last box and its pixels
        self.straight: Optional[Tuple[Any, Array]] = None

    @staticmethod
    def of(record: StageRecord) -> Observation:
        """Return an observation that adds to the times and counters of ``record``."""
        if isinstance(record, Observation):
            return record
        made = Observation(record.image, record.trace, record.sun_camera)
        made.stages_ms, made.counts = record.stages_ms, record.counts
        return made

    @cached_property
    def clipped(self) -> float:
        """Standard deviation of noise that is cut off at zero, 0 where none is."""
        # a limb or a coast with zeros beside it is no noise
        return min(clipped_noise(self.image), 1.25 * self.noise)
