"""Flights of one sitting: those that were left, those of the operator that are in no file, and the kept ones."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.readouts import duration_text

if TYPE_CHECKING:
    from flyaround.simulator.piloting.session import FlightSession

LEAST_LOST_S = 1.0  # time flown after a flight was kept that is named


@dataclass(eq=False)
class FlightList:
    """Flights of one sitting.

    Parameters
    ----------
    files : list of str, optional
        Absolute paths of the replays of kept flights.
    unsaved : list of FlightSession, optional
        Flights that the operator flew and that are in no file, or flew on since.
    kept_s : dict of FlightSession to float, optional
        Time until which the file of a kept flight is the flight [s].
    beside : dict of FlightSession to tuple, optional
        Start and end of the dropped future of a kept flight, None without one, when it was kept [s].
    former : list of tuple, optional
        Flights that were left, each with its source, the last one at the end: it, and those that are in no file.
    """

    files: list[str] = field(default_factory=list)
    unsaved: list[FlightSession] = field(default_factory=list)
    kept_s: dict[FlightSession, float] = field(default_factory=dict)
    beside: dict[FlightSession, tuple[float, float] | None] = field(default_factory=dict)
    former: list[tuple[FlightSession, str]] = field(default_factory=list)

    def lost_text(self, flight: FlightSession) -> str:
        """Return how much of a flight is in no file.

        Returns
        -------
        str
            Predicate of a sentence on the flight; empty if nothing is lost.
        """
        if flight not in self.unsaved:
            return ""
        if flight not in self.kept_s:
            return "is not kept"
        since_s = max(flight.look_back.timeline.end_s, flight.t_s) - self.kept_s[flight]
        if since_s < LEAST_LOST_S:
            return "has another future than its file"
        return f"has {duration_text(since_s)} flown since its file was written"

    def dropped_s(self) -> dict[FlightSession, float]:
        """Return the operator's flights with a dropped future that is in no file.

        Returns
        -------
        dict of FlightSession to float
            Length of each flight's dropped future [s].
        """
        dropped = {}
        for flight in dict.fromkeys([*self.unsaved, *self.kept_s]):
            left_s = flight.look_back.timeline.left_s
            # what was dropped after the flight was kept is in its file
            if left_s and self.beside.get(flight, left_s) == left_s and left_s[1] - left_s[0] > LEAST_LOST_S:
                dropped[flight] = left_s[1] - left_s[0]
        return dropped

    def note_flown_on(self, flight: FlightSession, from_s: float) -> None:
        """Count a kept flight as unsaved again once it has flown on, from a time on."""
        if flight not in self.kept_s or flight.look_back.active or flight.craft.steered is None:
            return
        self.kept_s[flight] = kept_s = min(self.kept_s[flight], from_s)
        flown_on = flight.t_s > kept_s + LEAST_LOST_S
        if flown_on != (flight in self.unsaved):
            (self.unsaved.append if flown_on else self.unsaved.remove)(flight)

    def note_own(self, flight: FlightSession) -> None:
        """Count a flight as the operator's own, which is unsaved unless it is kept or recorded."""
        if flight not in (*self.unsaved, *self.kept_s) and flight.look_back.recorder is None:
            self.unsaved.append(flight)

    def keep(self, flight: FlightSession) -> None:
        """Count a flight as kept to its present end."""
        timeline = flight.look_back.timeline
        self.kept_s[flight], self.beside[flight] = timeline.end_s, timeline.left_s
        self.unsaved = [other for other in self.unsaved if other is not flight]

    def give_up(self, flight: FlightSession) -> None:
        """Count a flight that was not written as unsaved again."""
        self.kept_s.pop(flight, None)
        self.beside.pop(flight, None)
        self.note_own(flight)

    def leave(self, flight: FlightSession, source: str, following: FlightSession) -> None:
        """Put a flight last in those that were left, of which only unsaved ones stay."""
        stay = [f for f in self.former if f[0] in self.unsaved and f[0] is not following]
        self.former = [*stay, (flight, source)]

    def left(self, which: int) -> tuple[FlightSession, str]:
        """Return a flight that was left, 1 for the last one, and its source.

        Returns
        -------
        tuple
            The flight, and its source as given to `leave`.

        Raises
        ------
        UserError
            If there are not so many.
        """
        if which > len(self.former):
            raise UserError("there is no earlier flight" if which == 1 else f"no flight {which} was left")
        return self.former[-which]
