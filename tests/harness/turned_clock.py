"""A clock that a test turns."""

from __future__ import annotations


class TurnedClock:
    """Seconds that pass when the test says so."""

    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s

    def pass_s(self, time_s: float) -> None:
        self.now_s += time_s
