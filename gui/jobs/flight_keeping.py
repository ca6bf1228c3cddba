"""Writing of a flown flight, a portion per turn of the window."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.simulator.piloting.flight_list import FlightList
    from flyaround.simulator.piloting.flown_files import FlownFiles
    from flyaround.simulator.piloting.session import FlightSession


@dataclass(eq=False)
class FlightKeeping:
    """A flight that is being written.

    Parameters
    ----------
    session : FlightSession
        The flight that is written.
    files : FlownFiles
        Its files, open for writing.
    flights : FlightList
        Flights of the sitting, of which it is one.
    then : callable
        Function called with the scenario once it is complete.
    fail : callable
        Function called with a sentence if it cannot be written.
    """

    session: FlightSession
    files: FlownFiles
    flights: FlightList
    then: Callable[[str], object]
    fail: Callable[[str], object]

    def __call__(self) -> bool:
        """Write a portion; return False at the end."""
        try:
            replay = self.files.go_on_beside()
        except (UserError, OSError) as error:
            self.cancel()
            self.fail(f"the flight was not kept: {error}")
            return False
        if replay is None:
            return True
        self.flights.files.append(str(replay.absolute()))
        self.then(str(replay))
        return False

    def cancel(self) -> None:
        """Remove what was written; the flight is unsaved again."""
        self.files.cancel()
        self.flights.give_up(self.session)
