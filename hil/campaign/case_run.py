"""One run of a campaign: a case with a seed, flown into its own folder, which appears only when complete."""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
import secrets
import shutil
from dataclasses import dataclass, fields, replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from flyaround.hil.board.agent import describe_board
from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.campaign.quantities import QUANTITIES, RunRecord, Value
from flyaround.hil.host.closed_loop_run import (
    fly_without_pictures,
    frame_every,
    summary_without_pictures,
    write_steps,
)
from flyaround.hil.host.flight_run import FlightOptions, FlightRun
from flyaround.hil.host.frame_record import FrameRecord
from flyaround.hil.host.ledger.frames_csv import FRAMES_CSV, LedgerWriter, read_ledger
from flyaround.hil.host.ledger.run_terms import Provenance, read_terms, terms_without_board, write_terms
from flyaround.hil.host.ledger.summary import SUMMARY_JSON, LedgerSummary, read_summary
from flyaround.hil.host.link_process.ipc import Board, LinkConfig, LinkTotals
from flyaround.hil.host.local_board import SILENCE_TIMEOUT_S, run_with_board_process
from flyaround.hil.host.pose_link import PoseLink
from flyaround.hil.host.report import TRACE_JSON, write_report
from flyaround.hil.host.run import RunConfig
from flyaround.hil.link.security import read_key
from flyaround.hil.link.session import SILENCE_S as LINK_SILENCE_S
from flyaround.hil.navigation.closed_loop import ClosedLoopConfig
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import write_document
from flyaround.simulator.runtime.untrusted_files import read_regular
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.targets.library import load_target

if TYPE_CHECKING:
    from flyaround.hil.campaign.definitions import ReadyCase
    from flyaround.simulator.scenario.faults import Faults
    from flyaround.simulator.scenario.plan import Plan

RESULT_JSON, BOARD_LOG = "result.json", "board.log"

PART = ".part"
"""Suffix of the folder of an incomplete run."""

# Maximum size of an accepted result or summary [bytes].
MAX_BYTES = 1 << 20

FRAMES = 30
"""Default number of frames of a case, as for ``hil host``."""


class FlownBy(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Software versions of a run; runs of other versions are repeated.

    Attributes
    ----------
    flyaround : str, optional
        Version of Flyaround.
    model_sha256 : str, optional
        Hash of the target model.
    board : str, optional
        Description of a board that the campaign starts; empty for external ones.
    """

    flyaround: str = ""
    model_sha256: str = ""
    board: str = ""


class RunResult(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Result of a run: ``result.json``, the last file written.

    Attributes
    ----------
    inputs : str
        SHA-256 of the inputs, which identifies the run.
    flown_by : FlownBy, optional
        Software versions; empty in older results.
    board : Board, optional
        Board that answered, from its HELLO.
    gl_renderer : str, optional
        OpenGL driver that rendered.
    failure : str, optional
        Cause of a failed run.
    values : dict of str to float or str
        Value of each quantity, by name.
    """

    inputs: str
    flown_by: FlownBy = FlownBy()
    board: Board | None = None
    gl_renderer: str = ""
    failure: str = ""
    values: dict[str, float | str]


@dataclass(frozen=True, eq=False, kw_only=True)
class RunTask:
    """A run to fly.

    Parameters
    ----------
    ready : ReadyCase
        Case with its files read.
    seed : int
        Seed of flight, dispersions and faults.
    folder : Path
        Output folder.
    board_command : tuple of str
        Command that starts a board; URL, target and method are appended.
    command : tuple of str, optional
        Words of the command line, for the record.
    """

    ready: ReadyCase
    seed: int
    folder: Path
    board_command: tuple[str, ...]
    command: tuple[str, ...] = ()


def inputs_of(ready: ReadyCase) -> str:
    """Return the SHA-256 of all inputs of a case's runs except their seeds."""
    case = msgspec.structs.replace(ready.case, seeds=(), faults=ready.faults)
    data = msgspec.json.encode((case, ready.scenario), order="sorted", enc_hook=str)
    return hashlib.sha256(data).hexdigest()


def current_versions(ready: ReadyCase) -> FlownBy:
    """Return the current software versions of a case; an external board's is still unknown."""
    is_own_board = ready.case.pose == "board" and ready.case.link.listen is None
    return FlownBy(
        flyaround=version("flyaround"),
        model_sha256=_model_sha256(ready.scenario.target),
        board=_describe_own_board() if is_own_board else "",
    )


@cache
def _model_sha256(target: str) -> str:
    return load_target(target).sha256


@cache
def _describe_own_board() -> str:
    try:
        return describe_board("", "", "", compiled=True).board
    except BoardModelError:  # without kernels, each run that needs them reports it
        return ""


def fly_case(task: RunTask) -> None:
    """Fly a run, measure it, and move its folder into place. A failed run is stored as well.

    Raises
    ------
    UserError
        If the folder cannot be written.
    """
    folder = task.folder
    part = folder.with_name(f".{folder.name}.{os.getpid()}.{secrets.token_hex(4)}{PART}")
    part.mkdir(parents=True)
    try:
        result = _fly_unattended(task, part)
        write_document(part / RESULT_JSON, result)
        with contextlib.suppress(OSError):  # another process has flown it in the meantime
            part.rename(folder)
    finally:
        shutil.rmtree(part, ignore_errors=True)


def read_result(folder: Path) -> RunResult:
    """Read the result in a run's folder.

    Raises
    ------
    UserError
        If the file is damaged.
    """
    path = folder / RESULT_JSON
    try:
        return msgspec.json.decode(read_regular(path, MAX_BYTES), type=RunResult)
    except (OSError, msgspec.DecodeError) as error:
        raise UserError(f"{path} is damaged ({error}): delete {folder} and start again") from error


def _fly_unattended(task: RunTask, part: Path) -> RunResult:
    """Fly a run. An error makes it a failed run, so that the campaign continues."""
    failure, board, renderer = "", None, ""
    values: dict[str, float | str] = {}
    try:
        _fly(task, part)
        write_report(part)
        if task.ready.case.mode == "lockstep":
            (part / TRACE_JSON).unlink(missing_ok=True)
        record = RunRecord.read(part)
        board, renderer = record.summary.board, _renderer(part)
        values = _measured_values(task, record)
    except Exception as error:  # noqa: BLE001 - reported in the result
        kind = "" if isinstance(error, UserError) else f"{type(error).__name__}: "
        failure = f"{kind}{error}"[:1000]
    return RunResult(
        inputs=inputs_of(task.ready),
        flown_by=current_versions(task.ready),
        board=board,
        gl_renderer=renderer,
        failure=failure,
        values=values,
    )


def _renderer(part: Path) -> str:
    terms = read_terms(part)
    return "" if terms is None or terms.versions is None else terms.versions.gl_renderer


def _measured_values(task: RunTask, record: RunRecord) -> dict[str, float | str]:
    traits = task.ready.case.traits
    values: dict[str, Value] = {
        name: quantity.value_of(record) for name, quantity in QUANTITIES.items() if quantity.needs <= traits
    }
    return {
        name: value
        for name, value in values.items()
        if value is not None and (isinstance(value, str) or math.isfinite(value))
    }


def _fly(task: RunTask, part: Path) -> None:
    case, seed = task.ready.case, task.seed
    faults = msgspec.structs.replace(task.ready.faults, seed=seed)
    n = None if case.every_s is not None else case.frames or FRAMES
    plan = plan_flight(task.ready.scenario, n=n, every_s=case.every_s, seed=seed)
    loop = None
    if case.closed_loop:
        loop = ClosedLoopConfig(seed=seed, frame_every=frame_every(case.every_s, plan))
    if loop is not None and case.pose != "board":
        result = fly_without_pictures(plan, loop, case.pose, PoseLink.without_pictures(faults))
        provenance = Provenance.from_plan(plan, task.ready.source, task.command)
        write_terms(part, terms_without_board(provenance, faults, ""))
        write_steps(part, result.steps)
        summary = summary_without_pictures(result, case.pose, seed)
        write_document(part / SUMMARY_JSON, msgspec.structs.replace(summary, started_utc=""))
        return
    _fly_with_board(task, plan, loop, faults, part)
    if case.mode == "lockstep":
        _drop_wall_clock(part)


def _fly_with_board(
    task: RunTask, plan: Plan, loop: ClosedLoopConfig | None, faults: Faults, part: Path
) -> None:
    """Fly like ``hil host`` with ``hil board``, or with an external board."""
    case, settings = task.ready.case, task.ready.case.link
    link = LinkConfig(
        url=settings.listen or "tcp://127.0.0.1:0",
        mode=case.mode,
        truth="off",
        timeout_s=settings.timeout_s,
        silence_s=LINK_SILENCE_S if settings.listen else SILENCE_TIMEOUT_S,
        compression=settings.encoding,
        pixel_format=settings.pixel_format,
        max_misses=settings.max_misses,
        faults=faults,
        key=None if task.ready.key is None else read_key(str(task.ready.key)),
    )
    config = RunConfig(link=link, log_dir=part, latency_s=case.latency_s, deadline_s=case.deadline_s)
    options = FlightOptions(closed_loop=loop, source_text=task.ready.source, command=task.command)
    flight = FlightRun(plan, config, options)
    if settings.listen is not None:
        flight.run()
        return
    board_options = ("--target", plan.target.name, "--method", case.method)
    run_with_board_process(flight, task.board_command, board_options, part / BOARD_LOG)


def _drop_wall_clock(part: Path) -> None:
    """Remove wall-clock times from a ledger, so that the same lockstep run gives the same bytes."""
    rows = read_ledger(part)
    (part / FRAMES_CSV).unlink()
    writer = LedgerWriter(part)
    for row in rows:
        writer.add(_without_wall_clock(row))
    writer.close()
    terms = read_terms(part)
    if terms is not None:
        write_terms(part, msgspec.structs.replace(terms, started_utc="", url=""))
    summary = read_summary(part)
    times = {name: None for name in LedgerSummary.__struct_fields__ if "_ms_" in name or name.endswith("_ms")}
    write_document(
        part / SUMMARY_JSON,
        msgspec.structs.replace(
            summary,
            started_utc="",
            url="",
            stages=[],
            link=LinkTotals(),
            deadline_misses=None,
            late=None,
            **times,
        ),
    )


def _without_wall_clock(row: FrameRecord) -> FrameRecord:
    """Return a row without wall-clock times, but with times of the flight."""
    defaults = FrameRecord(frame_id=0, epoch_utc="", t_s=0.0, exposure_s=0.0, outcome="")
    measured = [
        f.name
        for f in fields(FrameRecord)
        if f.name.endswith(("_ms", "_utc")) or f.name in {"late", "deadline_met"}
    ]
    return replace(row, **{name: getattr(defaults, name) for name in measured if name != "epoch_utc"})
