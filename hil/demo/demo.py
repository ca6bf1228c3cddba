"""Demo: flight, data set with check, closed loop with a board process, and a page with the results."""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from flyaround.hil.demo.method_comparison import N_COMPARED, compare_methods
from flyaround.hil.demo.page import DemoResults, write_page
from flyaround.hil.host.ledger.run_terms import Provenance
from flyaround.hil.host.link_process.ipc import LinkConfig
from flyaround.hil.host.plan_frames import frames_of_plan
from flyaround.hil.host.report import write_report
from flyaround.hil.host.run import RunConfig, run_host
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
    from flyaround.hil.host.ledger.summary import LedgerSummary
    from flyaround.simulator.frame import Frame
    from flyaround.simulator.scenario.plan import Plan

    ProgressBar = Callable[[str], AbstractContextManager[Callable[[int, int], None]]]

SCENARIO = "tango-flyaround"

# Number of images of the data set, and of frames sent to the board. Larger numbers make the demo slower and its
# statistics better; a pose is right or wrong, so 20 images resolve a share to 5 %.
N_IMAGES = 20
N_LOOP_FRAMES = 30
MARKER = "demo.json"

# Time-out for the board to end after its host's goodbye [s].
BOARD_EXIT_S = 20.0

# Largest TCP port, and tries to find two free ones in a row: on a machine without many connections the first succeeds.
MAX_PORT, MAX_TRIES = 65535, 50


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
            summary=loop.summary,
            rows=loop.rows,
            compared=answers,
            loop_frames=loop.frames,
            truth_records=loop.truth_records,
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


@dataclass(frozen=True, eq=False)
class Loop:
    """Result of the loop with the board."""

    summary: LedgerSummary
    rows: tuple[FrameRecord, ...]
    frames: dict[int, Frame]
    truth_records: int


class _FrameStore:
    """Sink that keeps the frames for the page."""

    def __init__(self) -> None:
        self.frames: dict[int, Frame] = {}

    def write(self, frame: Frame) -> None:
        self.frames[frame.number] = frame


def _run_loop(plan: Plan, folder: Path, board_command: Sequence[str], progress_bar: ProgressBar) -> Loop:
    """Send the frames of a plan to a board in its own process, with the truth to a logger on a separate endpoint."""
    folder.mkdir()
    port = _free_port_pair()
    url, truth_url = f"tcp://127.0.0.1:{port}", f"tcp://127.0.0.1:{port + 1}"
    rows: list[FrameRecord] = []
    recorder = _FrameStore()
    command = [*board_command, url, "--target", plan.target.name]
    config = RunConfig(
        link=LinkConfig(url=url, truth_url=truth_url, mode="lockstep", truth="separate", timeout_s=60.0),
        log_dir=folder,
        target_name=plan.target.name,
        target_sha256=plan.target.sha256,
        provenance=Provenance.from_plan(plan),
    )
    log_path = folder / "board.log"
    with log_path.open("wb") as log, progress_bar(f"{plan.n_frames} frames to the board") as progress:
        # one thread, as on a board: BLAS threads on small matrices compete with the renderer
        environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
        board = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, env=environment)
        logger = TruthLogger(truth_url, folder / "truth.jsonl")
        logger.start()

        def on_row(row: FrameRecord) -> None:
            rows.append(row)
            progress(len(rows), plan.n_frames)

        try:
            summary = run_host(frames_of_plan(plan, sinks=[recorder]), config, on_row=on_row)
            board.wait(timeout=BOARD_EXIT_S)
        finally:
            board.kill()
            board.wait()
            received = logger.stop()
    if len(rows) != plan.n_frames:
        raise UserError(
            f"the ledger in {folder} has {len(rows)} rows for {plan.n_frames} frames; see {log_path}"
        )
    return Loop(summary, tuple(rows), recorder.frames, received)


def _free_port_pair() -> int:
    """Return a free port whose successor, used by the truth endpoint, is free as well."""
    for _ in range(MAX_TRIES):
        with socket.socket() as a:
            a.bind(("127.0.0.1", 0))
            port = int(a.getsockname()[1])
            if port >= MAX_PORT:
                continue
            with socket.socket() as b:
                try:
                    b.bind(("127.0.0.1", port + 1))
                except OSError:
                    continue
                return port
    raise UserError("no two consecutive TCP ports are free on 127.0.0.1; close some programs and try again")
