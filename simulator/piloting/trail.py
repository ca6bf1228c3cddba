"""Where the chaser was, thinned so that a whole flight stays in view."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from flyaround.simulator.runtime.arrays import Vec3

MOST_POINTS = 4000
EVERY_S = 0.5


class Trail:
    """Places by time, half a second apart at first; of very many every second one is kept."""

    def __init__(self) -> None:
        self.points: list[Vec3] = []
        self._times_s: list[float] = []
        self._every_s = EVERY_S

    def wants(self, t_s: float) -> bool:
        """Whether a place is due."""
        return not self._times_s or t_s - self._times_s[-1] >= self._every_s

    def add(self, t_s: float, place: Vec3) -> None:
        """Keep a place, later than the last."""
        self.points.append(place)
        self._times_s.append(t_s)
        if len(self.points) > MOST_POINTS:
            self.points, self._times_s = self.points[::2], self._times_s[::2]
            self._every_s *= 2

    def cut(self, t_s: float) -> None:
        """Forget what is later."""
        kept = sum(t <= t_s for t in self._times_s)
        del self.points[kept:], self._times_s[kept:]

    def replace(self, places: Iterable[tuple[float, Vec3]]) -> None:
        """Other places, in the order of their times."""
        flown = list(places)
        self._times_s, self.points = [t for t, _ in flown], [p for _, p in flown]
