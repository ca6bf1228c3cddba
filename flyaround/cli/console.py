"""sim: the operator console."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from flyaround.cli.scenario_argument import load_flown
from flyaround.simulator.errors import UserError

FIRST = "tango-flyaround"


def sim(
    scenario: Annotated[
        str | None,
        typer.Argument(help="Built-in name or TOML file; left out: tango-flyaround, and a chooser of all."),
    ] = None,
    size: Annotated[str, typer.Option(help="Size of the window, WIDTHxHEIGHT.")] = "1280x800",
    off_screen: Annotated[
        bool,
        typer.Option(
            "--off-screen", help="Draw the window where nobody sees it; needs no display. For scripts."
        ),
    ] = False,
    seed: Annotated[
        int | None, typer.Option("--seed", help="Seed of the noise (default: the scenario's).")
    ] = None,
    overlays: Annotated[
        str, typer.Option(help="Overlays to start with: keypoints,names,box,axes,wireframe,times.")
    ] = "",
    seconds: Annotated[
        float | None, typer.Option(min=0.0, help="Close by itself so long after the first picture.")
    ] = None,
    screenshot: Annotated[Path | None, typer.Option(help="Picture of the window at the end (.png).")] = None,
    record: Annotated[
        Path | None,
        typer.Option(
            "--record",
            help="Empty folder for the flight as flown and replay.toml, which flies it again; on disk while flying.",
        ),
    ] = None,
    script: Annotated[
        Path | None,
        typer.Option(
            "--script", help="Commands to do at their times, as --log and the console's log write them."
        ),
    ] = None,
    log: Annotated[
        Path | None, typer.Option("--log", help="File for what was done, as a script for --script.")
    ] = None,
    gpu: Annotated[
        int | None, typer.Option("--gpu", help="EGL device to draw on (default: the driver's choice).")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the last state as JSON.")] = False,
) -> None:
    """Fly a scenario in a window: watch it, slow it, hurry it, take the chaser over. F1 lists the keys."""
    name = FIRST if scenario is None else scenario
    load_flown(name, "sim")  # a mistake in its name is said here, as by the other commands
    # the console's parts are an extra: only this command may need them
    from flyaround.gui.app import Request, run  # noqa: PLC0415

    state = run(
        Request(
            scenario=name,
            choose=scenario is None,
            size=_size(size),
            off_screen=off_screen,
            seed=seed,
            device_index=gpu,
            seconds=seconds,
            screenshot=screenshot,
            overlays=tuple(name for name in overlays.split(",") if name),
            record=record,
            script=script,
            log=log,
        )
    )
    if as_json:
        typer.echo(json.dumps(state))


def _size(text: str) -> tuple[int, int]:
    parts = text.lower().split("x")
    if len(parts) == 2 and all(p.isdecimal() for p in parts) and all(320 <= int(p) <= 16384 for p in parts):
        return int(parts[0]), int(parts[1])
    raise UserError(f"--size is '{text}', allowed: WIDTHxHEIGHT of 320 to 16384 each, for example 1280x800")
