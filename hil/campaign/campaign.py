"""Campaign: every case flown once with every seed, resumable after an interruption, and judged."""

from __future__ import annotations

import shutil
from collections import Counter
from contextlib import closing
from typing import TYPE_CHECKING, Literal

import msgspec

from flyaround.hil.campaign.campaign_page import write_campaign_page
from flyaround.hil.campaign.case_run import (
    PART,
    RunResult,
    RunTask,
    current_versions,
    fly_case,
    inputs_of,
    read_result,
)
from flyaround.hil.campaign.definitions import Campaign, ReadyCase, read_campaign
from flyaround.hil.campaign.junit import junit_xml
from flyaround.hil.campaign.verdicts import RunVerdict, judge
from flyaround.hil.host.ledger.run_terms import ScenarioRecord, Versions
from flyaround.hil.host.link_process.ipc import Board
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import empty_folder, write_atomic, write_document
from flyaround.simulator.runtime.folder_lock import only_writer
from flyaround.simulator.runtime.task_pool import run_tasks
from flyaround.simulator.runtime.urls import without_secrets
from flyaround.simulator.scenario.faults import Faults

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

FILE, RUNS = "campaign.toml", "runs"
CAMPAIGN_JSON, JUNIT_XML, PAGE = "campaign.json", "junit.xml", "index.html"


class CaseOutcome(msgspec.Struct, frozen=True, kw_only=True):
    """One run: case, seed, whether it met all requirements, and the reason if not."""

    name: str
    seed: int
    passed: bool
    reason: str


class RequirementOutcome(msgspec.Struct, frozen=True, kw_only=True):
    """Result of one requirement over all runs that it applies to."""

    name: str
    quantity: str
    passed: bool
    runs: int
    runs_passed: int


class FlownCase(msgspec.Struct, frozen=True, kw_only=True):
    """Configuration of a case's runs: scenario with its hash, target, faults, boards and drivers."""

    name: str
    scenario: str
    scenario_sha256: str
    target: str
    model_sha256: str
    seeds: tuple[int, ...]
    faults: Faults
    boards: tuple[Board, ...]
    gl_renderers: tuple[str, ...]


class CampaignOutcome(msgspec.Struct, frozen=True, kw_only=True):
    """Result of a campaign: campaign.json."""

    schema: Literal["flyaround.campaign_outcome"] = "flyaround.campaign_outcome"
    version: Literal[1] = 1
    name: str
    passed: bool
    requirements: tuple[RequirementOutcome, ...]
    cases: tuple[CaseOutcome, ...]
    command: tuple[str, ...] = ()
    versions: Versions
    scenarios: tuple[ScenarioRecord, ...]
    flown: tuple[FlownCase, ...]


def run_campaign(
    path: Path,
    folder: Path,
    *,
    board_command: tuple[str, ...],
    workers: int = 1,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
    command: tuple[str, ...] = (),
    say: Callable[[str], None] = lambda _sentence: None,
) -> CampaignOutcome:
    """Fly the missing runs, judge all, and write ``campaign.json``, ``junit.xml`` and ``index.html``.

    A run's folder appears only when the run is complete, so that an interrupted campaign resumes where it stopped. Runs
    of another version, target model or board than the current ones are repeated. In lockstep, the same file gives the
    same bytes.

    Parameters
    ----------
    path : Path
        Campaign file.
    folder : Path
        New or empty folder, or that of the same campaign.
    board_command : tuple of str
        Command that starts a board; URL, target and method are appended.
    workers : int, optional
        Number of parallel runs.
    progress : callable, optional
        Called with the number done, and the total.
    command : tuple of str, optional
        Words of the command line, for the record.
    say : callable, optional
        Called with a message about runs to repeat, and the reason.

    Returns
    -------
    CampaignOutcome
        Every run with its verdict.

    Raises
    ------
    UserError
        If the file has an error, or the folder holds something else or cannot be written.
    """
    campaign, cases = read_campaign(path)
    if workers > 1 and any(case.case.link.listen is not None for case in cases):
        raise UserError(
            "a case waits for a board at an address, which serves one run at a time: give --workers 1"
        )
    if not _is_campaign_folder(folder):
        empty_folder(folder)
    folder.mkdir(parents=True, exist_ok=True)
    with only_writer(folder, "campaign"):
        write_atomic(folder / FILE, path.read_bytes())
        tasks = [
            RunTask(
                ready=ready,
                seed=seed,
                folder=folder / RUNS / ready.case.name / f"seed-{seed}",
                board_command=board_command,
                command=command,
            )
            for ready in cases
            for seed in ready.case.all_seeds
        ]
        _remove_incomplete(folder, tasks)
        _discard(folder, _outdated_runs(tasks), say)
        stored = {task for task in tasks if task.folder.is_dir()}
        _fly_all(tasks, workers, progress)
        if _discard(folder, _runs_of_other_boards(tasks, stored), say):
            _fly_all(tasks, workers, progress)
        results = [read_result(task.folder) for task in tasks]
        _check_inputs(tasks, results)
        runs = [judge(campaign, t.ready.case.name, t.seed, r) for t, r in zip(tasks, results, strict=True)]
        durations_s = {
            (t.ready.case.name, t.seed): float(r.values.get("duration_s", 0.0))
            for t, r in zip(tasks, results, strict=True)
        }
        outcome = _outcome(campaign, runs, cases, results, command)
        write_atomic(folder / JUNIT_XML, junit_xml(campaign, cases, runs, durations_s))
        write_campaign_page(folder / PAGE, campaign, runs)
        write_document(folder / CAMPAIGN_JSON, outcome)
    return outcome


def _is_campaign_folder(folder: Path) -> bool:
    """Return True if the folder is empty or that of a campaign, whose file is written first."""
    if not folder.is_dir():
        return False
    return (folder / FILE).is_file() or all(
        p.name.startswith(".") and p.name.endswith((PART, ".lock")) for p in folder.iterdir()
    )


def _remove_incomplete(folder: Path, tasks: Sequence[RunTask]) -> None:
    """Remove incomplete runs of a killed campaign.

    Raises
    ------
    UserError
        If the folder has runs that are not in the campaign.
    """
    expected = {task.folder for task in tasks}
    for leftover in (*folder.glob(f".*{PART}"), *folder.glob(f"{RUNS}/*/.*{PART}")):
        if leftover.is_dir():
            shutil.rmtree(leftover, ignore_errors=True)
        else:
            leftover.unlink(missing_ok=True)
    for run in sorted(folder.glob(f"{RUNS}/*/*")):
        if run not in expected:
            raise UserError(
                f"{run} is a run that is not in the campaign file: name another folder with -o, or delete it"
            )


def _outdated_runs(tasks: Sequence[RunTask]) -> dict[RunTask, str]:
    """Return the runs flown by other versions than the current ones, with the differences."""
    outdated: dict[RunTask, str] = {}
    for task in tasks:
        if not task.folder.is_dir():
            continue
        old, new = read_result(task.folder).flown_by, current_versions(task.ready)
        for name, value in (
            ("flyaround", "another version"),
            ("model_sha256", "another model of the target"),
        ):
            if getattr(old, name) != getattr(new, name):
                outdated.setdefault(task, value)
        if old.board != new.board:
            outdated.setdefault(task, "another board")
    return outdated


def _runs_of_other_boards(tasks: Sequence[RunTask], reused_runs: set[RunTask]) -> dict[RunTask, str]:
    """Return the stored runs of another board than the one that is connected now."""
    current = {}
    for task in tasks:
        if task not in reused_runs and (board := read_result(task.folder).board) is not None:
            current[task.ready.case.name] = board
    outdated = {}
    for task in reused_runs:
        board, new = read_result(task.folder).board, current.get(task.ready.case.name)
        if board is not None and new is not None and board != new:
            outdated[task] = "another board"
    return outdated


def _discard(folder: Path, runs: Mapping[RunTask, str], say: Callable[[str], None]) -> bool:
    """Remove runs, and report the reason for repeating them."""
    for (case, why), n in Counter((task.ready.case.name, why) for task, why in runs.items()).items():
        say(
            f"{n} run{'s' if n > 1 else ''} of case {case!r} had {why} and {'are' if n > 1 else 'is'} repeated"
        )
    for task in runs:
        # rename before deleting, so that a run's folder is always complete
        trash = folder / f".{task.ready.case.name}.{task.seed}{PART}"
        shutil.rmtree(trash, ignore_errors=True)
        task.folder.rename(trash)
        shutil.rmtree(trash, ignore_errors=True)
    return bool(runs)


def _fly_all(tasks: Sequence[RunTask], workers: int, progress: Callable[[int, int], None]) -> None:
    todo = [task for task in tasks if not task.folder.is_dir()]
    done = len(tasks) - len(todo)
    progress(done, len(tasks))
    with closing(run_tasks(fly_case, todo, workers)) as flown:
        for _ in flown:
            done += 1
            progress(done, len(tasks))


def _check_inputs(tasks: Sequence[RunTask], results: Sequence[RunResult]) -> None:
    """Raise UserError for stored runs with other inputs than their case has now.

    Raises
    ------
    UserError
        For the first such run.
    """
    expected: dict[str, str] = {}
    for task, result in zip(tasks, results, strict=True):
        name = task.ready.case.name
        if name not in expected:
            expected[name] = inputs_of(task.ready)
        if result.inputs != expected[name]:
            raise UserError(
                f"{task.folder} was flown with other settings than case {name!r} has now: name another folder with "
                "-o, or delete it to repeat the run"
            )


def _flown_case(ready: ReadyCase, results: Sequence[RunResult]) -> FlownCase:
    boards = {r.board: None for r in results if r.board is not None}
    return FlownCase(
        name=ready.case.name,
        scenario=ready.scenario.name,
        scenario_sha256=ScenarioRecord.from_scenario(ready.scenario, ready.source).sha256,
        target=ready.scenario.target,
        model_sha256=current_versions(ready).model_sha256,
        seeds=ready.case.all_seeds,
        faults=ready.faults,
        boards=tuple(boards),
        gl_renderers=tuple({r.gl_renderer: None for r in results if r.gl_renderer}),
    )


def _outcome(
    campaign: Campaign,
    runs: Sequence[RunVerdict],
    cases: Sequence[ReadyCase],
    results: Sequence[RunResult],
    command: tuple[str, ...],
) -> CampaignOutcome:
    requirements = []
    for r in campaign.requirement:
        passed = [v.passed for run in runs for v in run.verdicts if v.requirement is r]
        requirements.append(
            RequirementOutcome(
                name=r.name,
                quantity=r.quantity,
                passed=all(passed),
                runs=len(passed),
                runs_passed=sum(passed),
            )
        )
    return CampaignOutcome(
        name=campaign.name,
        passed=all(run.passed for run in runs),
        requirements=tuple(requirements),
        cases=tuple(
            CaseOutcome(name=run.case, seed=run.seed, passed=run.passed, reason=run.reason) for run in runs
        ),
        command=tuple(without_secrets(word) for word in command),
        versions=Versions.here(),
        scenarios=tuple(
            {
                record.sha256: record
                for record in (ScenarioRecord.from_scenario(c.scenario, c.source) for c in cases)
            }.values()
        ),
        flown=tuple(
            _flown_case(case, [r for run, r in zip(runs, results, strict=True) if run.case == case.case.name])
            for case in cases
        ),
    )
