"""Recording of a piloted flight: states at regular times, and the scenario that replays them.

During the flight each state is appended to ``flight.csv``, and ``replay.toml`` is written once a second, so that a
killed console loses at most that. At the end ``flight.npz`` replaces the lines.
"""

from __future__ import annotations

import contextlib
import time
from typing import TYPE_CHECKING, TextIO

from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.flight_history import SAMPLE_INTERVAL_S, RowHistory
from flyaround.simulator.runtime.files import empty_folder, write_atomic
from flyaround.simulator.scenario.write import replay_scenario
from flyaround.simulator.world.flight.recording import (
    CSV_SUFFIX,
    NUMBERS,
    Recording,
    csv_header,
    csv_line,
    state_row,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from flyaround.simulator.scenario.scenario import Scenario
    from flyaround.simulator.world.flight.world_state import WorldState
    from flyaround.simulator.world.guidance.keep_out import Guard

REPLAY_INTERVAL_S = 1.0
"""Interval between writes of ``replay.toml``, which states the flight's length [s]."""

RECORDING_NAME, REPLAY_NAME = "flight.npz", "replay.toml"


class FlightRecorder:
    """Records the states of a session; `keep_in` writes them and their replay during the flight.

    Parameters
    ----------
    clock : callable, optional
        Monotonic time [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._rows = RowHistory(NUMBERS)
        self.trouble: str | None = None
        """Reason why the flight is not on disk; None if it is."""
        self._untold: str | None = None
        self.guard: Guard | None = None
        """The pilot's choice of the keep-out sphere, which the replay keeps."""
        self._clock = clock
        self._kept: tuple[Path, Scenario] | None = None
        self._lines: TextIO | None = None
        self._replay_due_s = 0.0

    def keep_in(self, folder: Path, scenario: Scenario) -> None:
        """Write the flight to a folder during the flight, including the states recorded so far.

        Raises
        ------
        UserError
            If the folder is not empty or cannot be written.
        """
        empty_folder(folder, option="--record")
        self._kept = folder, scenario
        self._begin()
        if self.trouble is not None:
            raise UserError(self.trouble)

    def __len__(self) -> int:
        """Return the number of recorded states."""
        return len(self._rows)

    @property
    def recording(self) -> Recording:
        """The recorded flight."""
        return Recording.from_rows(self._rows.numbers)

    @property
    def end_s(self) -> float:
        """Time of the last state [s]; 0 if there is none."""
        return self._rows.end_s

    def is_due(self, t_s: float) -> bool:
        """Return True if the state at a time is due.

        Returns
        -------
        bool
            True for the first state, and from `SAMPLE_INTERVAL_S` after the last one on.
        """
        return self._rows.is_due(t_s, SAMPLE_INTERVAL_S)

    def add(self, state: WorldState) -> None:
        """Add a state, later than the last. A full disk does not end a flight: see `trouble`."""
        row = state_row(state)
        self._rows.numbers.extend(row)
        self._write_row(row)

    def truncate_after(self, t_s: float) -> None:
        """Discard the recorded flight after ``t_s``."""
        k = self._rows.at(t_s)
        if not 0 < k + 1 == len(self):
            self._rows.truncate_after(k)
            self._begin()

    def swap_future(self) -> None:
        """Restore the discarded future in exchange for the present one."""
        if self._rows.left is not None:
            self._rows.swap_future()
            self._begin()

    def close(self) -> Path | None:
        """Finish `keep_in`: replace the lines by the complete flight.

        Returns
        -------
        Path or None
            The scenario that replays the flight; None if `keep_in` is not active, or fewer than two states are
            recorded.

        Raises
        ------
        UserError
            If it cannot be written; the lines stay.
        """
        if self._kept is None:
            return None
        (folder, scenario), self._kept = self._kept, None
        self._stop()
        # the folder may be gone
        with contextlib.suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
        replay = write_flight(folder, scenario, self.recording, self.guard) if self.long_enough else None
        with contextlib.suppress(OSError):
            (folder / RECORDING_NAME).with_suffix(CSV_SUFFIX).unlink(missing_ok=True)
        return replay

    @property
    def long_enough(self) -> bool:
        """True if there is enough to replay."""
        return len(self) > 1

    def take_trouble(self) -> str | None:
        """Return once why the flight is not on disk.

        Returns
        -------
        str or None
            Sentence for the operator; None if there is no trouble, or it has been returned.
        """
        trouble, self._untold = self._untold, None
        return trouble

    def _begin(self) -> None:
        """Start writing lines, over those of a restarted flight."""
        if self._kept is None:
            return
        folder, _ = self._kept
        self._stop()
        self.trouble, self._replay_due_s = None, self._clock() + REPLAY_INTERVAL_S
        try:
            (folder / REPLAY_NAME).unlink(missing_ok=True)
            self._lines = (folder / RECORDING_NAME).with_suffix(CSV_SUFFIX).open("w", encoding="ascii")
            self._lines.write(csv_header())
            self._lines.flush()
        except OSError as error:
            self._fail(error)
        for k in range(len(self)):
            self._write_row(self._rows.rows(k))

    def _write_row(self, row: Sequence[float]) -> None:
        if self._lines is None or self._kept is None:
            return
        folder, scenario = self._kept
        try:
            self._lines.write(csv_line(row))
            # flush to the system, which keeps the data if this program is killed
            self._lines.flush()
            if self.long_enough and self._clock() >= self._replay_due_s:
                self._replay_due_s = self._clock() + REPLAY_INTERVAL_S
                name = (folder / RECORDING_NAME).with_suffix(CSV_SUFFIX).name
                _write_replay(folder, scenario, name, row[0], self.guard)
        except (OSError, UserError) as error:
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        self.trouble = self._untold = (
            f"recording stopped ({reason}); the simulator retries at the end of the flight"
        )
        self._stop()

    def _stop(self) -> None:
        if self._lines is not None:
            with contextlib.suppress(OSError):
                self._lines.close()
            self._lines = None


def write_flight(folder: Path, scenario: Scenario, recording: Recording, guard: Guard | None = None) -> Path:
    """Write a recorded flight and the scenario that replays it, and return the scenario's path.

    Parameters
    ----------
    folder : Path
        Folder of both files.
    scenario : Scenario
        Scenario flown.
    recording : Recording
        The flight.
    guard : str, optional
        The pilot's choice of the keep-out sphere.

    Raises
    ------
    UserError
        If it cannot be written.
    """
    write_atomic(folder / RECORDING_NAME, recording.to_bytes())
    return _write_replay(folder, scenario, RECORDING_NAME, recording.duration_s, guard)


def _write_replay(
    folder: Path, scenario: Scenario, recording: str, duration_s: float, guard: Guard | None
) -> Path:
    path = folder / REPLAY_NAME
    write_atomic(path, replay_scenario(scenario, recording, duration_s, guard).encode())
    return path
