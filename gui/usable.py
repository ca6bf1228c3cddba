"""Commands with nothing to act on, which menus and panels show grey."""

from __future__ import annotations

from operator import attrgetter
from typing import TYPE_CHECKING

from flyaround.gui.jobs.all import running_jobs
from flyaround.gui.texts import texts

if TYPE_CHECKING:
    from flyaround.gui.console import Console

ENDS_JOB = frozenset(name for name, path in texts("needs").items() if path == "a running job")
NEEDS = {name: attrgetter(path) for name, path in texts("needs").items() if name not in ENDS_JOB}
"""Function by command that returns what it acts on from the console; empty, False or None if there is nothing."""


def is_usable(console: Console, name: str) -> bool:
    """Return True if a command has something to act on; a job that it ends, for example."""
    if name in ENDS_JOB:
        opening = console.opener.name if console.opener.is_busy() else ""
        return name in {job.end for job in running_jobs(console.jobs, opening, console.session)}
    return name not in NEEDS or bool(NEEDS[name](console))
