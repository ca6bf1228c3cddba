"""Looking back over a flight: any place of it, playing it again, and flying on from there.

While one looks back nothing is lost: playing shows what was flown, up to its end. Steering, or any command that changes
what flies the chaser, takes the flight up from the place that is up, and leaves what came after it.
"""

from __future__ import annotations

import pickle
from typing import TYPE_CHECKING, Protocol

from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.flight_history import Timeline

if TYPE_CHECKING:
    from flyaround.simulator.world.guidance.manual_control import ChaserState


class KeptFlight(Protocol):
    """What is asked of the flight that is looked back at."""

    @property
    def t_s(self) -> float:
        """Its clock [s]."""

    @property
    def steered(self) -> ChaserState | None:
        """The chaser where it is steered."""

    def controls(self) -> object:
        """What steers it: picklable, and all of it."""

    def bring_back(self, t_s: float, steered: ChaserState | None, controls: object) -> None:
        """Be at another place."""

    def future_left(self, t_s: float) -> None:
        """What was flown after a time does not belong to the flight any more."""

    def future_swapped(self) -> None:
        """What was left last belongs to it again, and what came instead does not."""


class LookBack:
    """Where in its own past a flight stands.

    Parameters
    ----------
    flight : is brought back to places of its past.
    """

    def __init__(self, flight: KeptFlight) -> None:
        self._flight = flight
        self.timeline = Timeline()
        self.active = False
        """Whether an earlier place is up than the end of what was flown."""
        self._brought = b""

    def keep(self, *, always: bool = False) -> None:
        """Keep the flight's state, if it is due."""
        if not self.active and (always or self.timeline.wants(self._flight.t_s)):
            self.timeline.add(self._flight.t_s, self._flight.steered, self._flight.controls())

    def seek(self, t_s: float) -> float:
        """Go to the kept place at or before a time; when it is [s].

        Raises
        ------
        UserError
            If nothing was flown yet.
        """
        self.keep(always=True)
        if len(self.timeline) < 2:
            raise UserError("nothing was flown yet, so there is nothing to look back at")
        return self._go(self.timeline.at(t_s))

    def step(self, samples: int) -> float:
        """Some samples on (or back); when that is [s]."""
        self.keep(always=True)
        here = self.timeline.at(self._flight.t_s)
        return self._go(min(max(here + samples, 0), len(self.timeline) - 1))

    def _go(self, k: int) -> float:
        place = self.timeline.place(k)
        self._flight.bring_back(place.t_s, place.steered, place.controls)
        self.active = k < len(self.timeline) - 1
        self._brought = self._packed()
        return place.t_s

    def _packed(self) -> bytes:
        return pickle.dumps(self._flight.controls(), protocol=5)

    @property
    def changed(self) -> bool:
        """Whether a command has changed what flies the chaser since the place came up."""
        return self.active and self._packed() != self._brought

    def play(self, dt_s: float) -> bool:
        """Show what was flown ``dt_s`` later; whether the end of it is reached."""
        t_s = self._flight.t_s + dt_s
        if t_s >= self.timeline.end_s:
            self._go(len(self.timeline) - 1)
            return True
        place = self.timeline.place(self.timeline.at(t_s))
        self._flight.bring_back(t_s, self.timeline.chaser_between(t_s), place.controls)
        self._brought = self._packed()
        return False

    def fly_on(self) -> None:
        """Take the flight up from the place that is up."""
        if not self.active:
            return
        k = self.timeline.at(self._flight.t_s)
        if self._flight.t_s > self.timeline.time_of(k) and not self.changed:
            # the place itself, to the last bit, and not what was worked out between two
            self._go(k)
        self._leave_after(k)

    def restart(self) -> None:
        """The flight begins again; what was flown is the future that was left."""
        self.keep(always=True)
        self._leave_after(-1)

    def _leave_after(self, k: int) -> None:
        self.active = False
        if k + 1 < len(self.timeline) or k < 0:
            self._flight.future_left(self.timeline.time_of(k) if k >= 0 else -1.0)
            self.timeline.leave_after(k)

    def swap_future(self) -> float:
        """Bring the future back that was left last, and look at where the two part; when that is [s].

        Raises
        ------
        UserError
            If none was left.
        """
        self.keep(always=True)
        k = self.timeline.swap_future()
        self._flight.future_swapped()
        return self._go(k)
