"""Image with its noise, background and stage record, as the stages of ``hybrid`` use it."""

from __future__ import annotations

from functools import cached_property
from typing import Any, List, Optional, Tuple

import numpy as np

from flyaround.hil.board.estimation.record import StageRecord, Trace
from flyaround.hil.board.hybrid.image.noise import clipped_noise

Array = np.ndarray


class Observation(StageRecord):
    """An image with its noise, background and stage record.

    Parameters
    ----------
    image : (H, W) array
        The image.
    trace : Trace, optional
        Receives the intermediate results passed to ``keep``.
    sun_camera : (3,) array, optional
        Unit vector to the Sun, camera axes.

    Attributes
    ----------
    noise : float
        Standard deviation of the noise.
    black : float
        Black level of the camera.
    background : float
        Level of empty space; negative if the background is not empty.
    craft_probability : (h, w) array, optional
        Probability (0..1) that a cell shows the craft, from ``saliency_map``; None in front of empty space.
    undistorted : list of tuple
        Undistorted regions with their boxes.
    """

    def __init__(
        self, image: Array, trace: Optional[Trace] = None, sun_camera: Optional[Array] = None
    ) -> None:
        super().__init__(image, trace, sun_camera)
        self.noise = 0.0
        self.black = 0.0
        self.background = -1.0
        self.craft_probability: Optional[Array] = None
        self.undistorted: List[Tuple[Any, Array]] = []

    @staticmethod
    def from_record(record: StageRecord) -> Observation:
        """Return an observation that continues the times and counters of ``record``.

        Returns
        -------
        Observation
            ``record`` itself if it is an observation already; otherwise a new one that shares its times and counters.
        """
        if isinstance(record, Observation):
            return record
        observation = Observation(record.image, record.trace, record.sun_camera)
        observation.stages_ms, observation.counts = record.stages_ms, record.counts
        return observation

    @cached_property
    def clipped(self) -> float:
        """Standard deviation of the noise that is clipped at zero; 0 if none is."""
        # bounded, because a limb or a coastline next to zeros is not noise
        return min(clipped_noise(self.image), 1.25 * self.noise)
