"""Options of ``flyaround sim``."""

from __future__ import annotations

from typing import Annotated

import typer

from flyaround.runs.document import NOT_RECORDED, Run
from flyaround.runs.fields import Duration, File, Gpu


class ConsoleRun(Run, frozen=True, kw_only=True, tag="flyaround.run.sim"):
    """Options of ``flyaround sim``: fly in a window."""

    scenario: Annotated[
        str | None,
        typer.Argument(help="Built-in name or TOML file (default: tango-flyaround, with a list of all)."),
    ] = None
    size: Annotated[str, typer.Option(help="Size of the window, WIDTHxHEIGHT.")] = "1280x800"
    off_screen: Annotated[
        bool,
        typer.Option("--off-screen", help="Run without a visible window or display, for scripts."),
        NOT_RECORDED,
    ] = False
    seed: Annotated[int | None, typer.Option(help="Seed of the noise (default: the scenario's).")] = None
    overlays: Annotated[
        str, typer.Option(help="Overlays to start with: keypoints,names,box,axes,wireframe,times.")
    ] = ""
    seconds: Annotated[
        Duration | None, typer.Option(help="Close this many seconds after the first picture.")
    ] = None
    screenshot: Annotated[
        File | None, typer.Option(help="Picture of the window at the end (.png)."), NOT_RECORDED
    ] = None
    record: Annotated[
        File | None,
        typer.Option(
            help="Empty folder for the recorded flight and replay.toml, which replays it; written during the flight."
        ),
        NOT_RECORDED,
    ] = None
    script: Annotated[
        File | None,
        typer.Option(help="Script of timed commands, as written by --log and the console's log."),
    ] = None
    log: Annotated[
        File | None,
        typer.Option(help="File for the operator's commands, as a script for --script."),
        NOT_RECORDED,
    ] = None
    gpu: Gpu = None
