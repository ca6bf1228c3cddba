"""Budget of a training, in time or steps."""

from __future__ import annotations

import time
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Budget:
    """Budget of a training.

    Parameters
    ----------
    minutes : float
        Time on this machine, unless ``steps`` is given.
    steps : int, optional
        Number of steps, for the same training on any machine.
    """

    minutes: float = 6.0
    steps: int | None = None

    def done(self, began_s: float, steps: int) -> float:
        """Return the used share of the budget.

        Parameters
        ----------
        began_s : float
            Monotonic clock at the start.
        steps : int
            Number of steps so far.

        Returns
        -------
        float
            Share of the steps, or of the time if ``steps`` is None; above 1 once it is exceeded.
        """
        if self.steps is not None:
            return steps / self.steps
        return (time.monotonic() - began_s) / (60 * self.minutes)
