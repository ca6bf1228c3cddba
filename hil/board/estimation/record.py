"""Record of one image in an estimator: stage times, counters and intermediate results for debug images."""

from __future__ import annotations

import time
from typing import Any, Dict, Optional

import numpy as np

Array = np.ndarray

# Results of the stages by name, for debug pictures.
Trace = Dict[str, Any]


class StageRecord:
    """An image and the record of its stages.

    Parameters
    ----------
    image : (H, W) array
        Grey levels.
    trace : dict, optional
        Receives every value that is given to ``keep``.
    sun_camera : (3,) array, optional
        Unit vector to the Sun in the camera frame, if it is known.
    """

    def __init__(
        self, image: Array, trace: Optional[Trace] = None, sun_camera: Optional[Array] = None
    ) -> None:
        self.image = image
        self.trace = trace
        self.sun_camera = sun_camera
        self.stages_ms: Dict[str, float] = {}
        self.counts: Dict[str, int] = {}
        self._last = time.perf_counter()

    def mark(self, stage: str) -> None:
        """Add the time since the last mark to ``stage``."""
        now = time.perf_counter()
        self.stages_ms[stage] = self.stages_ms.get(stage, 0.0) + 1e3 * (now - self._last)
        self._last = now

    def count(self, name: str, number: int) -> None:
        """Add to a counter."""
        self.counts[name] = self.counts.get(name, 0) + number

    @property
    def shows_all(self) -> bool:
        """True if the caller wants every stage, also those that the pose does not need."""
        return self.trace is not None and "every_stage" in self.trace

    def keep(self, name: str, value: Any) -> None:  # noqa: ANN401 - arrays, regions, segments
        """Keep a stage's result if the caller wants it."""
        if self.trace is not None:
            self.trace[name] = value

    def keep_poses(self, stage: str, q: Array, t: Array) -> None:
        """Record the poses q (N, 4), t (N, 3) that a stage passes on, in ``poses`` of the trace, if wanted."""
        if self.trace is not None:
            self.trace.setdefault("poses", []).append((stage, np.reshape(q, (-1, 4)), np.reshape(t, (-1, 3))))
