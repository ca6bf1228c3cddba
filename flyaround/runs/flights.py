"""Options of ``flyaround fly`` and ``flyaround film``."""

from __future__ import annotations

from typing import Annotated

import typer
from msgspec import Meta

from flyaround.runs.document import NOT_RECORDED, Run
from flyaround.runs.fields import Duration, File, Gpu, QualityOption, ScenarioArgument, Seed


class FlyRun(Run, frozen=True, kw_only=True, tag="flyaround.run.fly"):
    """Options of ``flyaround fly``: write the states of a flight."""

    scenario: ScenarioArgument
    output: Annotated[
        File,
        typer.Option("--output", "-o", help="New or empty folder for states.csv and scenario.json."),
        NOT_RECORDED,
    ]
    every_s: Annotated[float, typer.Option("--every", help="Seconds between rows.")] = 1.0
    oem: Annotated[bool, typer.Option("--oem", help="Write target.oem and chaser.oem (CCSDS).")] = False
    aem: Annotated[bool, typer.Option("--aem", help="Write target.aem and chaser.aem (CCSDS).")] = False
    record: Annotated[
        bool,
        typer.Option(
            "--record", help="Write flight.npz and replay.toml, a scenario that replays the flight."
        ),
    ] = False
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace an earlier flight in that folder."), NOT_RECORDED
    ] = False


class FilmRun(Run, frozen=True, kw_only=True, tag="flyaround.run.film"):
    """Options of ``flyaround film``: render a flight as a film."""

    scenario: ScenarioArgument
    output: Annotated[
        File,
        typer.Option(
            "--output", "-o", help="Film, .mp4; an existing one is replaced once the film is whole."
        ),
        NOT_RECORDED,
    ]
    width_px: Annotated[
        Annotated[int, Meta(ge=16, le=7680)] | None,
        typer.Option("--width", help="Width in pixels; the height follows (default: the camera's)."),
    ] = None
    fps: Annotated[
        Annotated[float, Meta(ge=1, le=120)], typer.Option("--fps", help="Images per second of the film.")
    ] = 25.0
    speed: Annotated[
        Annotated[float, Meta(ge=0.001, le=10_000)],
        typer.Option("--speed", help="Seconds of the flight per second of the film."),
    ] = 1.0
    from_s: Annotated[Duration, typer.Option("--from", help="Start, seconds of the flight.")] = 0.0
    to_s: Annotated[
        Duration | None, typer.Option("--to", help="End, seconds of the flight (default: its end).")
    ] = None
    rgb: Annotated[bool, typer.Option("--rgb", help="Colour images instead of the scenario's bands.")] = False
    quality: QualityOption = None
    seed: Seed = None
    gpu: Gpu = None
