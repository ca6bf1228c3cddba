"""hil campaign and hil delay-map: many runs of the loop, judged against requirements."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.text import Text

from flyaround.cli.run_options import with_run_options
from flyaround.cli.scenario_argument import load_flyable
from flyaround.cli.terminal import progress_bar, say
from flyaround.hil.campaign.campaign import CAMPAIGN_JSON, PAGE, run_campaign
from flyaround.hil.campaign.delay_map import OUTCOME_JSON, map_delays, settings_for
from flyaround.runs.campaign import CampaignRun, DelayMapRun
from flyaround.runs.document import write_run
from flyaround.simulator.errors import UserError

# Command of a local board, as run by hil board.
BOARD_COMMAND = (sys.executable, "-m", "flyaround", "hil", "board")
MAX_REASONS = 10  # number of failed cases that are listed
MAX_LEVELS = 100  # largest number of values on one axis of a delay map


@with_run_options
def campaign(
    run: CampaignRun,
    as_json: Annotated[bool, typer.Option("--json", help="Print campaign.json.")] = False,
) -> None:
    """Fly cases with their seeds unattended and judge them: requirement matrix, JUnit XML; exit 1 if one is not met.

    An interrupted campaign continues if the command is given again; in lockstep the same file gives the same bytes
    (docs/hil_campaign.md).
    """
    file, output = Path(run.file), Path(run.output)
    with progress_bar("runs", quiet=as_json) as progress:
        outcome = run_campaign(
            file,
            output,
            board_command=BOARD_COMMAND,
            workers=run.workers,
            progress=progress,
            # output folder and number of workers must not affect the bytes
            command=("flyaround", "hil", "campaign", run.file),
            say=lambda sentence: say(sentence, stderr=True),
        )
    write_run(output, run)
    if as_json:
        typer.echo((output / CAMPAIGN_JSON).read_text())
    else:
        failed = [case for case in outcome.cases if not case.passed]
        for requirement in outcome.requirements:
            passed = f"{requirement.runs_passed} of {requirement.runs} runs"
            say(Text.assemble(f"{requirement.name}: ", (passed, "" if requirement.passed else "red")))
        for case in failed[:MAX_REASONS]:
            say(f"{case.name}, seed {case.seed}: {case.reason}")
        if len(failed) > MAX_REASONS:
            say(f"and {len(failed) - MAX_REASONS} more")
        say(f"{len(outcome.cases) - len(failed)} of {len(outcome.cases)} runs passed: {output / PAGE}")
    if not outcome.passed:
        raise typer.Exit(1)


@with_run_options
def delay_map(
    run: DelayMapRun,
    as_json: Annotated[bool, typer.Option("--json", help="Print delay_map.json.")] = False,
) -> None:
    """Map an approach's success over latency, jitter and loss of its poses: heat maps, CSV, half-success latencies.

    No images are rendered: the poses are the truth with the estimator's measured errors (docs/hil_campaign.md).
    """
    output = Path(run.output)
    load_flyable(run.scenario, "hil delay-map")
    settings = settings_for(
        run.scenario,
        latencies_s=_levels(run.latency, "--latency", 60.0),
        jitters_s=_levels(run.jitter, "--jitter", 60.0),
        drops=_levels(run.drops, "--drops", 1.0),
        flights=run.flights,
        first_seed=run.seed,
        every_s=run.every_s,
        check=run.check,
        check_flights=run.check_flights,
    )
    with progress_bar("flights", quiet=as_json) as progress:
        outcome = map_delays(
            settings,
            output,
            board_command=BOARD_COMMAND,
            workers=run.workers,
            progress=lambda _what, done, of: progress(done, of),
        )
    write_run(output, run)
    if as_json:
        typer.echo((output / OUTCOME_JSON).read_text())
        return
    for half in outcome.half:
        say(f"half fail, jitter {half.jitter_s:g} s, {half.drops:.0%} lost: {half.words}")
    for cell in outcome.checked:
        a, b = cell.without_pictures, cell.drawn
        say(
            f"latency {a.latency_s:g} s, jitter {a.jitter_s:g} s, {a.drops:.0%} lost: {a.successes} of {a.flights}"
            f" without images, {b.successes} of {b.flights} rendered"
            + ("" if cell.agree else ": significantly different")
        )
    say(f"page: {output / PAGE}")


def _levels(text: str, option: str, most: float) -> tuple[float, ...]:
    """Parse numbers between commas.

    Raises
    ------
    UserError
        If one is not a number, or out of bounds.
    """
    try:
        levels = tuple(float(word) for word in text.split(","))
    except ValueError as error:
        raise UserError(f"{option} is {text!r}: give numbers with commas, such as 0,1,2") from error
    if not all(0 <= level <= most for level in levels) or len(levels) > MAX_LEVELS:
        raise UserError(f"{option} is {text!r}: give at most {MAX_LEVELS} numbers from 0 to {most:g}")
    return levels
