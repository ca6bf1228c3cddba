"""Demo: flight, data set with check, closed loop with a board process, and a page with the results."""

from __future__ import annotations

import json
import shutil
import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from flyaround.hil.demo.method_comparison import N_COMPARED, compare_methods
from flyaround.hil.demo.page import DemoResults, LoopResults, write_page
from flyaround.hil.host.flight_run import FlightOptions, FlightRun
from flyaround.hil.host.link_process.ipc import LinkConfig
from flyaround.hil.host.local_board import run_with_board_process
from flyaround.hil.host.report import write_report
from flyaround.hil.host.run import RunConfig
from flyaround.hil.host.truth.logger import TruthLogger
from flyaround.simulator.dataset.capture import capture
from flyaround.simulator.dataset.check.verify import check_dataset
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import empty_folder, write_json
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from contextlib import AbstractContextManager

    from flyaround.hil.host.frame_record import FrameRecord
    from flyaround.simulator.frame import Frame
    from flyaround.simulator.scenario.plan import Plan

    ProgressBar = Callable[[str], AbstractContextManager[Callable[[int, int], None]]]

SCENARIO = "tango-flyaround"

# Number of images of the data set, and of frames sent to the board. Larger numbers make the demo slower and its
# statistics better; a pose is right or wrong, so 20 images resolve a share to 5 %.
N_IMAGES = 20
N_LOOP_FRAMES = 30
MARKER = "demo.json"


def run_demo(
    folder: Path,
    *,
    board_command: Sequence[str],
    overwrite: bool,
    say: Callable[[str], None],
    progress_bar: ProgressBar,
) -> Path:
    """Run all stages of the demo in a folder, and return the path of the page.

    Parameters
    ----------
    folder : Path
        Folder of the demo.
    board_command : sequence of str
        Command that starts a board; URL and target are appended.
    overwrite : bool
        Replace the folder if it holds an earlier demo; any other folder is refused.
    say : callable
        Receives lines about the progress.
    progress_bar : ProgressBar
        Opens a progress bar with a title; yields ``update(done, total)``.

    Returns
    -------
    Path
        Path of ``index.html``.

    Raises
    ------
    UserError
        If the folder is in use, a label is wrong, or the ledger does not account for every frame.
    """
    started = time.monotonic()
    if overwrite and (folder / MARKER).is_file():
        shutil.rmtree(folder)
    empty_folder(folder, advice="replace an earlier demo with --overwrite")
    write_json(folder / MARKER, {"scenario": SCENARIO, "complete": False})
    scenario = load_scenario(SCENARIO)
    plan = plan_flight(scenario, n=N_IMAGES)
    say(f"{scenario.title}: {scenario.duration_s:.0f} s of simulated time")
    with progress_bar(f"capture {N_IMAGES} images") as progress:
        capture_summary = capture(plan, folder / "dataset", formats=("native", "speed"), progress=progress)
    with progress_bar("check every label") as progress:
        checked = check_dataset(folder / "dataset", progress)
    if checked.faults or capture_summary.quarantined:
        first = checked.faults[0].what if checked.faults else capture_summary.quarantined[0][1]
        raise UserError(
            f"the demo's labels in {folder / 'dataset'} disagree: {first}; run flyaround check there"
        )

    loop = _run_loop(plan_flight(scenario, n=N_LOOP_FRAMES), folder / "hil", board_command, progress_bar)
    write_report(folder / "hil")
    with progress_bar(f"{N_COMPARED} frames by three methods") as progress:
        answers = compare_methods(loop.frames, plan.target, progress)
    page = write_page(
        DemoResults(
            folder=folder,
            plan=plan,
            captured=capture_summary,
            checked=checked,
            loop=loop,
            compared=answers,
            run_s=time.monotonic() - started,
        )
    )
    write_json(
        folder / MARKER,
        {
            "scenario": SCENARIO,
            "complete": True,
            "run_s": round(time.monotonic() - started, 1),
            "images": checked.n_frames,
            "labels": checked.n_labels,
            "truth_records": loop.truth_records,
            "methods": [asdict(answer) for answer in answers],
            "ledger": json.loads(msgspec.json.encode(loop.summary)),
        },
    )
    return page


class _FrameStore:
    """Recorder that keeps the frames, with images and truth, in memory for the page."""

    def __init__(self) -> None:
        self.frames: dict[int, Frame] = {}

    def frame(self, frame: Frame) -> None:
        self.frames[frame.number] = frame

    def row(self, frame: Frame, row: FrameRecord) -> None:
        pass

    def close(self) -> None:
        pass


def _run_loop(
    plan: Plan, folder: Path, board_command: Sequence[str], progress_bar: ProgressBar
) -> LoopResults:
    """Run the loop, with the truth on an endpoint of its own and the board in a process of its own."""
    folder.mkdir()
    rows: list[FrameRecord] = []
    loggers: list[TruthLogger] = []
    recorder, log_path = _FrameStore(), folder / "board.log"
    link = LinkConfig(url="tcp://127.0.0.1:0", mode="lockstep", truth="separate", timeout_s=60.0)
    flight = FlightRun(plan, RunConfig(link=link, log_dir=folder), FlightOptions())

    def log_truth(_url: str, truth_url: str | None) -> None:
        loggers.append(TruthLogger(str(truth_url), folder / "truth.jsonl"))
        loggers[0].start()

    with progress_bar(f"{plan.n_frames} frames to the board") as progress:

        def on_row(row: FrameRecord) -> None:
            rows.append(row)
            progress(len(rows), plan.n_frames)

        summary = run_with_board_process(
            flight,
            board_command,
            ("--target", plan.target.name),
            log_path,
            on_listening=log_truth,
            recorders=(recorder,),
            on_row=on_row,
        )
    received = loggers[0].stop()
    if len(rows) != plan.n_frames:
        raise UserError(
            f"the ledger in {folder} has {len(rows)} rows for {plan.n_frames} frames; see {log_path}"
        )
    return LoopResults(summary, tuple(rows), recorder.frames, received)
