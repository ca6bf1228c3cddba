"""Commands of the log: save it as a script."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from flyaround.gui.command_table import command, word
from flyaround.gui.jobs.program import output_file
from flyaround.simulator.runtime.files import write_atomic

if TYPE_CHECKING:
    from flyaround.gui.console import Console

FOLDER = Path("out") / "console"


def script_header(console: Console) -> tuple[str]:
    """Return the comment that opens a log: the command that plays it."""
    return (f"flyaround sim {console.session.plan.scenario.name} --script FILE",)


def _save(console: Console, path: str | None = None) -> None:
    where = output_file(path, FOLDER, "commands", ".script")
    where.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(where, console.log.text(script_header(console)).encode())
    console.say(
        f"saved {where}; flyaround sim {console.session.plan.scenario.name} --script {where} does it again"
    )


COMMANDS = (command("log.save", _save, word("path", "of the file", optional=True)),)
