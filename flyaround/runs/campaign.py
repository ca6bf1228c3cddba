"""Options of ``flyaround hil campaign`` and ``hil delay-map``."""

from __future__ import annotations

from typing import Annotated

import typer
from msgspec import Meta

from flyaround.runs.document import NOT_RECORDED, Run
from flyaround.runs.fields import File

Workers = Annotated[int, Meta(ge=1, le=256)]


class CampaignRun(Run, frozen=True, kw_only=True, tag="flyaround.run.hil-campaign"):
    """Options of ``flyaround hil campaign``: fly cases with their seeds and judge them against requirements."""

    file: Annotated[File, typer.Argument(help="Campaign file (TOML): cases, seeds, requirements.")]
    output: Annotated[
        File,
        typer.Option("--output", "-o", help="New folder, or that of this campaign, which is resumed."),
        NOT_RECORDED,
    ]
    workers: Annotated[Workers, typer.Option(help="Number of parallel runs."), NOT_RECORDED] = 1


class DelayMapRun(Run, frozen=True, kw_only=True, tag="flyaround.run.hil-delay-map"):
    """Options of ``flyaround hil delay-map``: map success over latency, jitter and loss of the poses."""

    scenario: Annotated[str, typer.Argument(help="Built-in name or TOML file of a flight with thrusters.")]
    output: Annotated[
        File,
        typer.Option("--output", "-o", help="New folder, or that of this map, which is resumed."),
        NOT_RECORDED,
    ]
    latency: Annotated[
        str, typer.Option(help="Seconds from mid-exposure to the pose, separated by commas.")
    ] = "0.3,2,4,5,6"
    jitter: Annotated[
        str,
        typer.Option(help="Upper limits in seconds of the additional uniform delay, separated by commas."),
    ] = "0,0.5,1,2,4"
    drops: Annotated[str, typer.Option(help="Shares of lost poses, separated by commas.")] = "0,0.3,0.6"
    flights: Annotated[
        Annotated[int, Meta(ge=1, le=10_000)],
        typer.Option("--flights", "-n", help="Approaches per cell."),
    ] = 20
    seed: Annotated[
        Annotated[int, Meta(ge=0, le=2**31 - 1)], typer.Option(help="Seed of each cell's first approach.")
    ] = 1
    every_s: Annotated[
        float | None,
        typer.Option("--every", help="Seconds between pictures (default: the control period)."),
    ] = None
    check: Annotated[
        Annotated[int, Meta(ge=0)],
        typer.Option(help="Number of cells to verify with rendered images and a board process."),
    ] = 0
    check_flights: Annotated[
        Annotated[int, Meta(ge=1, le=1000)], typer.Option(help="Approaches in each of those.")
    ] = 5
    workers: Annotated[Workers, typer.Option(help="Number of parallel approaches."), NOT_RECORDED] = 1
