"""Options of ``flyaround fly``."""

from __future__ import annotations

from typing import Annotated

import typer

from flyaround.runs.document import NOT_RECORDED, Run
from flyaround.runs.fields import File, ScenarioArgument


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
