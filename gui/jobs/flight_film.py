"""A film of a kept flight: `flyaround film` in its own process, watched through its progress lines."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from flyaround.gui.jobs.program import ChildProgram


class FlightFilm(ChildProgram):
    """One film that is being rendered.

    Parameters
    ----------
    path : Path
        File of the film, which exists once it is complete.
    words : sequence of str
        Scenario and options of `flyaround film`.
    """

    def __init__(self, path: Path, words: Sequence[str]) -> None:
        self.path = path
        super().__init__(("film", *words, "-o", str(path), "--json"))

    @property
    def share(self) -> float:
        """Completed share."""
        done, _, count = self.last_error_line().partition(" of ")
        return int(done) / int(count) if done.isdecimal() and count.isdecimal() else 0.0

    def update(self) -> str | None:
        """Return once it has ended why there is no film, empty if there is one; None before."""
        if self.running:
            return None
        code, why = self.exit_code, self.last_error_line() or f"exit code {self.exit_code}"
        self.close()
        return "" if not code else "it was stopped" if self.stopped else why

    def close(self, patience_s: float = 2.0) -> None:
        """End it; of an incomplete film nothing is left."""
        super().close(patience_s)
        self.path.with_name(f".{self.path.name}.{self.pid}.part").unlink(missing_ok=True)
