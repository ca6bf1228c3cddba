"""Flights of a delay map: approaches over each cell's link, without images, or rendered with a board's poses."""

from __future__ import annotations

import csv
import io
import os
from contextlib import closing
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from flyaround.hil.host.closed_loop_run import figures, fly_without_pictures, frame_every
from flyaround.hil.host.flight_run import FlightOptions, FlightRun
from flyaround.hil.host.link_process.ipc import LinkConfig
from flyaround.hil.host.local_board import SILENCE_TIMEOUT_S, run_with_board_process
from flyaround.hil.host.pose_link import PoseLink
from flyaround.hil.host.run import RunConfig
from flyaround.hil.navigation.closed_loop import ClosedLoopConfig
from flyaround.simulator.errors import UserError, write_error
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.runtime.table_text import table_text
from flyaround.simulator.runtime.task_pool import run_tasks
from flyaround.simulator.runtime.untrusted_files import read_regular
from flyaround.simulator.scenario.faults import Drop, Jitter
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from flyaround.hil.host.ledger.summary import ClosedLoopFigures
    from flyaround.simulator.scenario.plan import Plan

# Limits of a successful approach, see docs/hil_closed_loop.md
WITHIN_M, WITHIN_DEG = 0.2, 2.0

# Maximum size of an accepted table [bytes], millions of rows.
MAX_BYTES = 1 << 28
COLUMNS = (
    "latency_s",
    "jitter_s",
    "drops",
    "seed",
    "success",
    "outcome",
    "final_error_m",
    "final_error_deg",
    "keep_out_violations",
    "duration_s",
    "reason",
)


@dataclass(frozen=True, order=True)
class Cell:
    """Link parameters: latency from mid-exposure to the pose, additional uniform jitter, and share of poses lost."""

    latency_s: float
    jitter_s: float
    drops: float


@dataclass(frozen=True)
class MapFlight:
    """One approach to fly.

    Parameters
    ----------
    scenario : str
        Name or file of the scenario.
    cell : Cell
        Latency, jitter and loss of the poses.
    seed : int
        Seed of flight, dispersions and losses.
    every_s : float, optional
        Time between images; by default the thrusters' period.
    board_command : tuple of str, optional
        Command that starts a board, for a rendered flight on its poses; by default the poses are simulated.
    """

    scenario: str
    cell: Cell
    seed: int
    every_s: float | None = None
    board_command: tuple[str, ...] | None = None


def fly(task: MapFlight) -> list[str]:
    """Fly an approach and return its row of the table."""
    # only rendering depends on the plan's seed
    plan = _plan(task.scenario, 0 if task.board_command is None else task.seed)
    loop = ClosedLoopConfig(seed=task.seed, frame_every=frame_every(task.every_s, plan))
    cell = task.cell
    # common random numbers: a lossier link loses the same poses as a better one, and more
    faults = (Jitter(most_ms=1e3 * cell.jitter_s), Drop(chance=cell.drops))
    link = PoseLink(latency_s=cell.latency_s, faults=faults, seed=task.seed)
    if task.board_command is None:
        outcome = figures(fly_without_pictures(plan, loop, "noisy", link), "noisy", task.seed)
    else:
        outcome = _fly_with_board(plan, loop, link, task.board_command)
    success = (
        outcome.outcome == "arrived"
        and outcome.final_error_m <= WITHIN_M
        and outcome.final_error_deg <= WITHIN_DEG
        and not outcome.keep_out_violations
    )
    return [
        *_key(task),
        str(int(success)),
        outcome.outcome,
        *(f"{x:.6g}" for x in (outcome.final_error_m, outcome.final_error_deg)),
        str(outcome.keep_out_violations),
        f"{outcome.duration_s:g}",
        table_text(outcome.reason),
    ]


@cache
def _plan(scenario: str, seed: int) -> Plan:
    return plan_flight(load_scenario(scenario), n=1, seed=seed)


def _fly_with_board(
    plan: Plan, loop: ClosedLoopConfig, link: PoseLink, board_command: tuple[str, ...]
) -> ClosedLoopFigures:
    """Fly with every frame rendered and every pose from a board; delays and losses act on the flight's clock.

    Raises
    ------
    UserError
        If the board disconnected.
    """
    wire = LinkConfig(
        url="tcp://127.0.0.1:0", mode="lockstep", truth="off", timeout_s=60.0, silence_s=SILENCE_TIMEOUT_S
    )
    flight = FlightRun(plan, RunConfig(link=wire), FlightOptions(closed_loop=loop, pose_link=link))
    summary = run_with_board_process(flight, board_command, ("--target", plan.target.name))
    if summary.ended != "completed" or summary.closed_loop is None:
        raise UserError(
            f"a board disconnected during its flight ({summary.board_gone}): start again to resume"
        )
    return summary.closed_loop


def fly_cells(
    path: Path, tasks: Sequence[MapFlight], workers: int, progress: Callable[[int, int], None]
) -> list[tuple[Cell, bool]]:
    """Fly the flights missing in ``path``, and write their rows in order.

    Yield each flight's cell and success.

    Raises
    ------
    UserError
        If the file holds other flights, or cannot be written.
    """
    lines = _journal(path)
    for line, task in zip(lines, tasks, strict=False):
        if line[:4] != _key(task):
            raise UserError(f"{path} holds other flights: name another folder with -o")
    progress(len(lines), len(tasks))
    try:
        with (
            path.open("a", encoding="utf-8", newline="") as file,
            closing(run_tasks(fly, tasks[len(lines) :], workers)) as rows,
        ):
            writer = csv.writer(file, lineterminator="\n")
            for row in rows:
                writer.writerow(row)
                file.flush()
                lines.append(row)
                progress(len(lines), len(tasks))
    except OSError as error:
        raise write_error(path, error) from error
    return [(task.cell, line[4] == "1") for line, task in zip(lines[: len(tasks)], tasks, strict=True)]


def _key(task: MapFlight) -> list[str]:
    cell = task.cell
    return [*(f"{x:g}" for x in (cell.latency_s, cell.jitter_s, cell.drops)), str(task.seed)]


def _journal(path: Path) -> list[list[str]]:
    """Return the complete rows of an interrupted table. A partial row is removed, and a missing header written."""
    head = ",".join(COLUMNS) + "\n"
    text = ""
    if path.exists():
        text = read_regular(path, MAX_BYTES).decode(errors="replace")
    complete = text[: text.rfind("\n") + 1]
    if not complete:
        write_atomic(path, head.encode())
        return []
    if len(complete) < len(text):
        os.truncate(path, len(complete.encode()))
    lines = list(csv.reader(io.StringIO(complete)))
    if complete[: len(head)] != head or any(len(line) != len(COLUMNS) for line in lines):
        raise UserError(f"{path} is not a table of flights: name another folder with -o")
    return lines[1:]
