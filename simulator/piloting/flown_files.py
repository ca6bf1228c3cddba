"""Export of the flight so far: the recording, and the scenario that replays it; written in small portions."""

from __future__ import annotations

import contextlib
import time
from array import array
from typing import TYPE_CHECKING

from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.recorder import RECORDING_NAME, REPLAY_NAME, write_flight
from flyaround.simulator.runtime.files import empty_folder
from flyaround.simulator.world.flight.recording import NUMBERS, Recording

if TYPE_CHECKING:
    from pathlib import Path

    from flyaround.simulator.piloting.session import FlightSession
    from flyaround.simulator.scenario.scenario import Scenario

# Maximum number of stored flights of one scenario.
MAX_FOLDERS = 10_000

# Time per call of `FlownFiles.go_on_beside` [s]: at least, as a share of the time since the last call, and at most.
SLICE_S, SLICE_SHARE, LONGEST_SLICE_S = 0.008, 0.25, 0.05


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
        self._flight, self._scenario = session.flight, scenario or session.plan.scenario
        self._guard = session.craft.steering.guard
        self._count = len(session.look_back.timeline)
        if self._count < 2:
            raise UserError("there is no flight to save yet")
        # the flight may be restarted, or flown on from an earlier time, while it is written
        self._samples = session.look_back.timeline.chasers()
        self._made = not folder.exists()
        self.folder = empty_folder(folder, option="another name")
        self._rows = array("d")
        self._last_s = time.perf_counter()

    def go_on_beside(self) -> Path | None:
        """Continue for a share of the time since the last call, so that a caller's loop stays responsive.

        Returns
        -------
        Path or None
            As of `go_on`, which also raises.
        """
        now_s, last_s = time.perf_counter(), self._last_s
        self._last_s = now_s
        return self.go_on(min(max(SLICE_SHARE * (now_s - last_s), SLICE_S), LONGEST_SLICE_S))

    @property
    def share(self) -> float:
        """Completed share of the work."""
        return len(self._rows) / (NUMBERS * self._count)

    def go_on(self, longest_s: float) -> Path | None:
        """Continue for about ``longest_s``.

        Returns
        -------
        Path or None
            The scenario that replays the flight, once it is complete; None until then.

        Raises
        ------
        UserError
            If it cannot be written.
        """
        until = time.perf_counter() + longest_s
        for t_s, steered in self._samples:
            self._rows.extend(self._flight.recorded_row(steered or self._flight.chaser(t_s)))
            if time.perf_counter() >= until:
                return None
        return write_flight(self.folder, self._scenario, Recording.from_rows(self._rows), self._guard)

    def cancel(self) -> None:
        """Remove what was written, and the folder if it was new."""
        with contextlib.suppress(OSError):
            for name in (REPLAY_NAME, RECORDING_NAME):
                (self.folder / name).unlink(missing_ok=True)
            if self._made:
                self.folder.rmdir()


def free_folder(parent: Path, name: str) -> Path:
    """Find a folder name with a number that is not in use.

    Returns
    -------
    Path
        ``parent/name-001``, or the first of the next ones that does not exist; it is not created.

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
