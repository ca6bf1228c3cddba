"""A film of a kept flight: `flyaround film` in its own process, watched through its progress lines."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from flyaround.gui.jobs.program import ChildProgram

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path


class FlightFilm:
    """One film that is being rendered.

    Parameters
    ----------
    path : Path
        File of the film, which exists once it is complete.
    words : sequence of str
        Scenario and options of `flyaround film`.
    clock : callable, optional
        Monotonic time [s].
    """

    def __init__(self, path: Path, words: Sequence[str], clock: Callable[[], float] = time.monotonic) -> None:
        self.path, self._clock, self._began_s = path, clock, clock()
        self._program = ChildProgram(("film", *words, "-o", str(path), "--json"), clock)

    @property
    def share(self) -> float:
        """Completed share."""
        done, _, count = self._program.last_error_line().partition(" of ")
        return int(done) / int(count) if done.isdecimal() and count.isdecimal() else 0.0

    @property
    def left_s(self) -> float | None:
        """Estimated remaining time [s]; None while unknown."""
        share = self.share
        return (self._clock() - self._began_s) * (1 - share) / share if share else None

    def stop(self) -> None:
        """Ask it to end; a second time ends it at once."""
        self._program.stop()

    def update(self) -> str | None:
        """Return once it has ended why there is no film, empty if there is one; None before."""
        program = self._program
        if program.running:
            return None
        code, why = program.exit_code, program.last_error_line()
        stopped = program.stopped
        self.close()
        return "" if not code else "it was stopped" if stopped else why or f"exit code {code}"

    def close(self) -> None:
        """End it; of an incomplete film nothing is left."""
        self._program.close()
        self.path.with_name(f".{self.path.name}.{self._program.pid}.part").unlink(missing_ok=True)
