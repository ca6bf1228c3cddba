"""hil campaign and hil delay-map: many runs of the loop, judged."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.text import Text

from flyaround.commands.terminal import progress_bar, say
from hil.campaign.campaign import CAMPAIGN_JSON, PAGE, run_campaign

# a board's side on this machine, as hil board has it
BOARD_COMMAND = (sys.executable, "-m", "flyaround", "hil", "board")
MOST_REASONS = 10


def campaign(
    file: Annotated[Path, typer.Argument(help="Campaign file (TOML): cases, seeds, requirements.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder: new, or of this campaign, which goes on.")
    ],
    workers: Annotated[int, typer.Option(min=1, max=256, help="Runs at a time.")] = 1,
    as_json: Annotated[bool, typer.Option("--json", help="Print campaign.json.")] = False,
) -> None:
    """Fly cases with their seeds unattended and judge them: requirement matrix, JUnit XML; exit 1 if one is not met.

    Broken off at any place and begun again with the same words, it goes on; in lockstep the same file gives the same
    bytes (docs/hil_campaign.md).
    """
    with progress_bar("runs", quiet=as_json) as progress:
        outcome = run_campaign(file, output, board_command=BOARD_COMMAND, workers=workers, progress=progress)
    if as_json:
        typer.echo((output / CAMPAIGN_JSON).read_text())
    else:
        failed = [case for case in outcome.cases if not case.passed]
        for requirement in outcome.requirements:
            met = f"{requirement.runs_passed} of {requirement.runs} runs"
            say(Text.assemble(f"{requirement.name}: ", (met, "" if requirement.passed else "red")))
        for case in failed[:MOST_REASONS]:
            say(f"{case.name}, seed {case.seed}: {case.reason}")
        if len(failed) > MOST_REASONS:
            say(f"and {len(failed) - MOST_REASONS} more")
        say(f"{len(outcome.cases) - len(failed)} of {len(outcome.cases)} runs passed: {output / PAGE}")
    if not outcome.passed:
        raise typer.Exit(1)
