"""sim: the operator console."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from flyaround.cli.run_options import with_run_options
from flyaround.cli.scenario_argument import load_flyable
from flyaround.cli.size_option import parse_size
from flyaround.runs.console import ConsoleRun
from flyaround.runs.document import write_run
from flyaround.simulator.errors import UserError

DEFAULT_SCENARIO = "tango-flyaround"
# side of the window [px]: smallest that holds a panel, and the largest texture of common drivers
SIDE_PX = (320, 16384)


@with_run_options
def sim(
    run: ConsoleRun,
    as_json: Annotated[bool, typer.Option("--json", help="Print the last state as JSON.")] = False,
    commands: Annotated[
        bool, typer.Option("--commands", help="List the commands of scripts with their keys, and exit.")
    ] = False,
) -> None:
    """Fly a scenario in a window, with time control and manual control. F1 lists the keys."""
    if commands:
        from flyaround.gui.app import command_table  # noqa: PLC0415

        for command in command_table():
            form = f"hold {command.form}" if command.held else command.form
            typer.echo(f"{form:44} {command.shown:16} {command.help}")
        return
    name = run.scenario or DEFAULT_SCENARIO
    load_flyable(name, "sim")  # report an unknown name here, like the other commands
    # the console's packages are optional: only this command may need them
    from flyaround.gui.app import Request  # noqa: PLC0415
    from flyaround.gui.app import run as run_console  # noqa: PLC0415

    record, screenshot = _path(run.record), _path(run.screenshot)
    _check_screenshot(screenshot)
    state = run_console(
        Request(
            scenario=name,
            choose=run.scenario is None,
            size=parse_size(run.size, "--size", SIDE_PX, "1280x800"),
            off_screen=run.off_screen,
            seed=run.seed,
            device_index=run.gpu,
            seconds=run.seconds,
            screenshot=screenshot,
            overlays=tuple(name for name in run.overlays.split(",") if name),
            record=record,
            script=_path(run.script),
            log=_path(run.log),
        )
    )
    if record is not None:
        write_run(record, run)
    if as_json:
        typer.echo(json.dumps(state))


def _path(text: str | None) -> Path | None:
    return None if text is None else Path(text)


def _check_screenshot(path: Path | None) -> None:
    if path is None:
        return
    if path.suffix != ".png":
        raise UserError(f"cannot write '{path.suffix}' pictures ({path}); end --screenshot in .png")
    if not path.parent.is_dir():
        raise UserError(f"folder {path.parent} does not exist; make it, or change --screenshot")
