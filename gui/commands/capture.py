"""Commands of captures beside the flight."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from flyaround.gui.command_table import Argument, command, word
from flyaround.gui.commands.scenario import built_in_name
from flyaround.gui.jobs.capture_job import MOST_FRAMES, MOST_WORKERS, CaptureRequest
from flyaround.gui.jobs.program import new_path
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.runtime.toml_text import to_toml

if TYPE_CHECKING:
    from flyaround.gui.console import Console

FOLDER = Path("out") / "console"
THIS, NEW = "this-flight", "new"  # what to capture, and into which folder, by default


def _what(console: Console, what: str) -> str:
    """Return the argument of `flyaround capture`: a name, a file, or this flight's scenario written as one."""
    if what != THIS:
        return what
    scenario = console.session.plan.scenario
    if name := built_in_name(scenario):
        return name
    FOLDER.mkdir(parents=True, exist_ok=True)
    path = new_path(FOLDER, f"{scenario.name}-flown", ".toml")
    write_atomic(path, to_toml(msgspec.to_builtins(scenario)).encode())
    return str(path)


def _start(
    console: Console,
    frames: int,
    what: str | None = None,
    folder: str | None = None,
    formats: str | None = None,
    workers: int | None = None,
) -> None:
    source = _what(console, what or THIS)
    place = new_path(FOLDER, f"set-{Path(source).stem}") if folder in {None, NEW} else Path(str(folder))
    request = CaptureRequest(
        what=source, frames=frames, folder=place, formats=formats or "native", workers=workers or 1
    )
    console.jobs.capture.start(request)
    console.say(f"capturing {frames} frames of {source} into {place}")


def _resume(console: Console) -> None:
    last = console.jobs.capture.request
    if last is None:
        raise UserError("there is no capture to go on with: start one")
    console.jobs.capture.start(replace(last, resume=True))
    console.say(f"going on with {last.folder}")


COMMANDS = (
    command(
        "capture.start",
        _start,
        Argument("frames", "whole", "how many", least=1, most=MOST_FRAMES),
        word("what", f"scenario, recipe or file; {THIS} unless given", optional=True),
        word("folder", f"new or empty; {NEW}, or left out: one in out/console", optional=True),
        word("formats", "beside the native one, with commas", optional=True),
        Argument("workers", "whole", "processes that draw", least=1, most=MOST_WORKERS, optional=True),
    ),
    command("capture.stop", lambda console: console.jobs.capture.stop()),
    command("capture.resume", _resume),
)
