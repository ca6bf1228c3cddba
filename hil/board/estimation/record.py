"""Record of the stages of one estimate: times, counters and intermediate results."""

from __future__ import annotations

import time
from typing import Any, Dict, Optional

import numpy as np

Array = np.ndarray

# Intermediate results by name, for debug pictures.
Trace = Dict[str, Any]


class StageRecord:
    """An image with the record of its processing stages.

    Parameters
    ----------
    image : (H, W) array
        Image in grey levels.
    trace : dict, optional
        Receives the intermediate results passed to ``keep``.
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
        """True if the caller asked for every stage, including those that the pose does not need."""
        return self.trace is not None and "every_stage" in self.trace

    def keep(self, name: str, value: Any) -> None:  # noqa: ANN401 - arrays, regions, segments
        """Store an intermediate result if a trace was requested."""
        if self.trace is not None:
            self.trace[name] = value

    def keep_poses(self, stage: str, q: Array, t: Array) -> None:
        """Append the poses q (N, 4), t (N, 3) of a stage to ``poses`` in the trace, if one was requested."""
        if self.trace is not None:
            self.trace.setdefault("poses", []).append((stage, np.reshape(q, (-1, 4)), np.reshape(t, (-1, 3))))
