"""A clock for the stages of a frame. It waits for the driver and reads the CPU's clock; llvmpipe has no GPU timers."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import moderngl


class StageClock:
    """Collects milliseconds per stage.

    Parameters
    ----------
    context : Context
        OpenGL context.
    finish : bool, optional
        True to wait for the driver at each lap; otherwise a stage's time is that of issuing its commands.
    """

    def __init__(self, context: moderngl.Context, *, finish: bool = True) -> None:
        self._context = context
        self._finish = finish
        self.stage_ms: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, stage: str) -> None:
        """End a stage; times of a repeated name add up."""
        if self._finish:
            self._context.finish()
        now = time.perf_counter()
        self.stage_ms[stage] = self.stage_ms.get(stage, 0.0) + 1e3 * (now - self._last)
        self._last = now
