"""Export of the flight so far: the recording, and the scenario that replays it; written in small portions."""

from __future__ import annotations

import time
from array import array
from typing import TYPE_CHECKING

from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.recorder import write_flight
from flyaround.simulator.runtime.files import empty_folder
from flyaround.simulator.world.flight.recording import Recording, state_row

if TYPE_CHECKING:
    from pathlib import Path

    from flyaround.simulator.piloting.session import FlightSession
    from flyaround.simulator.scenario.scenario import Scenario

# Maximum number of stored flights of one scenario.
MAX_FOLDERS = 10_000


class FlownFiles:
    """Incremental writer of a recorded flight; call `go_on` until it returns the scenario's path.

    Parameters
    ----------
    session : FlightSession
        Session to export.
    folder : Path
        Empty or new folder.
    scenario : Scenario, optional
        Replaces the flown scenario's camera, sensor and lights in the replay.

    Raises
    ------
    UserError
        If nothing was flown, or the folder is not empty or cannot be written.
    """

    def __init__(self, session: FlightSession, folder: Path, scenario: Scenario | None = None) -> None:
        session.look_back.keep(always=True)
        self._timeline = session.look_back.timeline
        self._flight, self._scenario = session.flight, scenario or session.plan.scenario
        self._count = len(self._timeline)
        if self._count < 2:
            raise UserError("there is no flight to save yet")
        self.folder = empty_folder(folder, option="another name")
        self._rows = array("d")
        self._next = 0

    @property
    def share(self) -> float:
        """Completed share of the work."""
        return self._next / self._count

    def go_on(self, longest_s: float) -> Path | None:
        """Continue for about ``longest_s``; return the scenario's path once it is complete.

        Raises
        ------
        UserError
            If it cannot be written.
        """
        until = time.perf_counter() + longest_s
        while self._next < min(self._count, len(self._timeline)):
            sample = self._timeline.place(self._next)
            chaser = sample.steered or self._flight.chaser(sample.t_s)
            self._rows.extend(state_row(self._flight.state_with_chaser(chaser)))
            self._next += 1
            if time.perf_counter() >= until:
                return None
        return write_flight(self.folder, self._scenario, Recording.from_rows(self._rows))


def free_folder(parent: Path, name: str) -> Path:
    """Return the path of a new folder with this name and a number.

    Raises
    ------
    UserError
        If there are too many.
    """
    for k in range(1, MAX_FOLDERS):
        folder = parent / f"{name}-{k:03d}"
        if not folder.exists():
            return folder
    raise UserError(f"{parent} holds {MAX_FOLDERS} flights of {name}; move some away")
