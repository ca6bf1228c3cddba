"""Flights that are kept or lost: what is in no file, in words, and the writing of a file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from flyaround.gui.texts import time_text
from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.flight_list import LEAST_LOST_S

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.gui.console import Console
    from flyaround.simulator.piloting.flight_list import FlightList
    from flyaround.simulator.piloting.flown_files import FlownFiles
    from flyaround.simulator.piloting.session import FlightSession


def lost_text(flights: FlightList, flight: FlightSession) -> str:
    """Return how much of a flight is in no file.

    Returns
    -------
    str
        Predicate of a sentence on the flight; empty if nothing is lost.
    """
    if flight not in flights.unsaved:
        return ""
    if flight not in flights.kept_s:
        return "is not kept"
    since_s = max(flight.look_back.timeline.end_s, flight.t_s) - flights.kept_s[flight]
    if since_s < LEAST_LOST_S:
        return "has another future than its file"
    return f"has {time_text(since_s)} flown since its file was written"


@dataclass(eq=False)
class Keeping:
    """A flight that is being written in portions, one per turn of the window.

    Parameters
    ----------
    console : Console
        The console.
    session : FlightSession
        The flight that is written.
    files : FlownFiles
        Its files, open for writing.
    then : callable
        Function called with the scenario once it is complete.
    """

    console: Console
    session: FlightSession
    files: FlownFiles
    then: Callable[[Console, str], None]

    def __call__(self) -> bool:
        """Write a portion; return False at the end."""
        try:
            replay = self.files.go_on_beside()
        except (UserError, OSError) as error:
            self.cancel()
            self.console.say(f"the flight was not kept: {error}", "caution", "timeline.keep")
            return False
        if replay is None:
            return True
        self.console.flights.files.append(str(replay.absolute()))
        self.then(self.console, str(replay))
        return False

    def cancel(self) -> None:
        """Remove what was written; the flight is unsaved again."""
        self.files.cancel()
        self.console.flights.give_up(self.session)
