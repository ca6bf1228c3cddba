"""Which resolution keeps a live picture live: measured, not assumed."""

from __future__ import annotations

from statistics import median

LIVE_MS = 90.0
"""What a picture may cost while things move."""
DIVISORS = (1, 2, 3, 4)
ENOUGH = 3
"""Pictures of one size before it is judged."""
MEMORY_S = 15.0
"""How long a size that was too slow is not tried again."""


class DetailControl:
    """Chooses pixels of the camera per pixel drawn from what pictures of each size were seen to cost."""

    def __init__(self) -> None:
        self.divisor = 2
        self._skip = True
        self._ms: list[float] = []
        self._too_slow_until_s: dict[int, float] = {}

    def measured(self, divisor: int, ms: float, now_s: float) -> None:
        """Note what a picture cost, and change the size if it should be.

        Parameters
        ----------
        divisor : of the picture. ms : its cost. now_s : time, monotonic.
        """
        if divisor != self.divisor:
            return
        if self._skip:
            # the first one of a size also pays for buffers, the very first for textures and shaders
            self._skip = False
            return
        self._ms = [*self._ms[-4:], ms]
        if len(self._ms) < ENOUGH:
            return
        typical, k = median(self._ms), DIVISORS.index(divisor)
        if typical > LIVE_MS and k + 1 < len(DIVISORS):
            self._too_slow_until_s[divisor] = now_s + MEMORY_S
            self._change(DIVISORS[k + 1])
        elif k > 0:
            finer = DIVISORS[k - 1]
            # part of the cost does not grow with the pixels: hopeful, because a mistake is remembered
            hoped_ms = 0.7 * typical * (divisor / finer) ** 2
            if hoped_ms < LIVE_MS and now_s >= self._too_slow_until_s.get(finer, now_s):
                self._change(finer)

    def _change(self, divisor: int) -> None:
        self.divisor, self._skip, self._ms = divisor, True, []
