"""The clock of a flight: pause, rate, and jumps ahead."""

from __future__ import annotations

from typing import Literal

# Rates of simulated time, in the steps 1, 2, 5, and the rate of a jump, the fastest of them.
RATES = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)
JUMP_RATE = RATES[-1]

STEP_S = 0.02
"""Integration step at 1x [s]; it grows with the rate as far as `Steering.step_s` allows."""

MAX_STEPS_PER_S = 1000.0
"""Largest number of steps per second of real time; if steps must be shorter, simulated time falls behind its rate."""

_ROUNDING = 1e-9
"""Relative tolerance for rounding when real time is summed up from equal parts."""

Jump = Literal["", "event", "hold-point"]


class FlightClock:
    """Clock of a flight, which converts real time to steps of simulated time.

    Attributes
    ----------
    paused : bool
    rate : float
        Simulated seconds per second of real time, one of ``RATES``.
    jump : str
        Kind of event that a jump runs to; empty without a jump.
    jump_until_s : float
        Latest simulated time at which a jump ends [s].
    """

    def __init__(self) -> None:
        self.paused = False
        self.rate = 1.0
        self.reset()

    def reset(self) -> None:
        """End a jump without changing the rate, and discard the accumulated real time."""
        self._owed_s = 0.0
        self.jump: Jump = ""
        self.jump_until_s = 0.0

    def toggle_pause(self) -> None:
        """Pause or resume."""
        self.paused = not self.paused

    def set_rate(self, rate: float) -> None:
        """Set the rate, and end a jump.

        Raises
        ------
        ValueError
            If it is not one of ``RATES``.
        """
        if rate not in RATES:
            raise ValueError(f"rate {rate} is not one of {RATES}")
        self.jump, self.rate = "", rate

    def shift_rate(self, places: int) -> None:
        """Change to the rate ``places`` entries up or down in ``RATES``; during a jump, start from 1x."""
        self.end_jump()
        self.rate = RATES[min(max(RATES.index(self.rate) + places, 0), len(RATES) - 1)]

    def start_jump(self, jump: Jump, until_s: float) -> None:
        """Run at `JUMP_RATE` until `end_jump`, or at the latest until ``until_s``."""
        self.jump, self.jump_until_s, self.paused = jump, until_s, False

    def end_jump(self) -> None:
        """Return to 1x if a jump is active."""
        if self.jump:
            self.jump, self.rate = "", 1.0

    def slow_down(self) -> None:
        """Resume, at no more than 1x."""
        self.jump, self.rate, self.paused = "", min(self.rate, 1.0), False

    def rest(self) -> None:
        """Pause, at no more than 1x."""
        self.slow_down()
        self.paused = True

    # --- steps

    @property
    def _current_rate(self) -> float:
        return JUMP_RATE if self.jump else self.rate

    @property
    def step_s(self) -> float:
        """Step at the present rate [s]."""
        return STEP_S * self._current_rate

    def add(self, dt_s: float) -> None:
        """Add real time [s], to be converted to steps."""
        self._owed_s += dt_s

    def consume(self, step_s: float) -> bool:
        """Consume the real time of a step; return False if the accumulated time is too short."""
        costs = max(step_s / self._current_rate, 1 / MAX_STEPS_PER_S)
        if self._owed_s < costs * (1 - _ROUNDING):
            return False
        self._owed_s = max(self._owed_s - costs, 0.0)
        return True
