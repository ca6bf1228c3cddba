"""Length of a training."""

from __future__ import annotations

import time
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Budget:
    """Length of a training.

    Parameters
    ----------
    minutes : float
        Time on this machine, unless ``steps`` is given.
    steps : int, optional
        Number of steps: the same training on any machine.
    """

    minutes: float = 6.0
    steps: int | None = None

    def done(self, began_s: float, steps: int) -> float:
        """Return the share of it that is used up, one at its end.

        Parameters
        ----------
        began_s : float
            Monotonic clock at the beginning.
        steps : int
            Steps since.
        """
        if self.steps is not None:
            return steps / self.steps
        return (time.monotonic() - began_s) / (60 * self.minutes)
