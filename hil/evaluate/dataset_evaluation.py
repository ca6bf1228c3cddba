"""Evaluation of estimators on a labelled data set: one answer per frame and method, metrics, and a report page."""

from __future__ import annotations

import logging
from contextlib import closing
from typing import TYPE_CHECKING, Any

import msgspec

from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.estimation import BoardModel
from flyaround.hil.board.hybrid.native.library import describe_library
from flyaround.hil.board.method_names import HYBRID
from flyaround.hil.evaluate.evaluation_page import write_page
from flyaround.hil.evaluate.evaluator import Evaluator, answer_in_worker, start_worker
from flyaround.hil.evaluate.greyscale import describe_pictures
from flyaround.hil.evaluate.mean_predictor import MeanPredictor, mean_predictor
from flyaround.hil.evaluate.method_choice import MethodChoice, board_model
from flyaround.hil.evaluate.metrics import MethodMetrics, Metrics, compose, summarise
from flyaround.hil.evaluate.result_rows import EvaluatedFrame, RunHeader, append_row, frames_csv, read_rows
from flyaround.simulator.dataset.card import read_card
from flyaround.simulator.dataset.formats.native import frame_paths, is_frame_complete, read_png
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.truth import read_truth
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.runtime.task_pool import run_tasks
from flyaround.simulator.targets.library import load_target

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Sequence
    from pathlib import Path


log = logging.getLogger(__name__)

METRICS_JSON, FRAMES_CSV, ROWS = "metrics.json", "frames.csv", "rows.jsonl"


def evaluate_dataset(
    folder: Path,
    report: Path,
    *,
    methods: tuple[MethodChoice, ...] = (MethodChoice(HYBRID),),
    model: BoardModel | None = None,
    workers: int = 1,
    frames: Sequence[int] | None = None,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> Metrics:
    """Evaluate methods on every frame; write ``metrics.json``, ``frames.csv`` and ``index.html``.

    Parameters
    ----------
    folder : Path
        Data set.
    report : Path
        Output folder; an interrupted run of the same evaluation is resumed.
    methods : tuple of MethodChoice
        Methods to evaluate. The metrics of the first one are also those of the document's top level.
    model : BoardModel, optional
        Model for the estimators; by default the target's own.
    workers : int
        Number of processes; with one, the measured times are undisturbed.
    frames : sequence of int, optional
        Frames to evaluate; by default all.
    progress : callable
        Receives the number of answers so far, and the total.

    Returns
    -------
    Metrics
        Content of ``metrics.json``.

    Raises
    ------
    UserError
        If the folder is not a data set, has no complete frame, or the report belongs to another evaluation.
    """
    card = read_card(folder)
    complete_frames = [
        k for k in (range(card.n_frames) if frames is None else frames) if is_frame_complete(folder, k)
    ]
    if not complete_frames:
        raise UserError(f"data set {folder} has no complete frame; capture some first")
    craft = model or board_model(load_target(card.target.name))
    if model is None and craft.sha256 != card.target.sha256:
        log.warning(
            "data set %s was rendered with another version of target %s (%s) than the estimators use (%s)",
            folder,
            card.target.name,
            card.target.sha256[:12],
            craft.sha256[:12],
        )
    labels = tuple(c.label for c in methods)
    path = report / ROWS
    done = _resume_rows(
        path, RunHeader(f"{card.scenario_name} {card.seed}", card.target.sha256, labels, craft.sha256)
    )
    evaluated = {(row.frame, row.method) for row in done}
    tasks = [(k, label) for k in complete_frames for label in labels if (k, label) not in evaluated]
    total = len(tasks) + len(done)
    setting = (folder, craft, msgspec.to_builtins(card.camera), methods)
    with closing(_answers(tasks, setting, workers)) as answers:
        for answer in answers:
            if isinstance(answer, str):
                log.warning("a frame is skipped: %s", answer)
                total -= 1
            else:
                append_row(path, answer)
                done.append(answer)
            progress(len(done), total)
    if not done:
        raise UserError(f"no frame of data set {folder} can be read; run flyaround check on it")
    done.sort(key=lambda row: (labels.index(row.method), row.frame))
    metrics = _metrics(folder, labels, done)
    write_atomic(report / METRICS_JSON, msgspec.json.format(msgspec.json.encode(metrics), indent=1))
    write_atomic(report / FRAMES_CSV, frames_csv(done))
    write_page(report, folder, card, craft, metrics, done)
    return metrics


def _resume_rows(path: Path, header: RunHeader) -> list[EvaluatedFrame]:
    """Return the rows of an interrupted evaluation, and remove an incomplete last line from the file."""
    done: list[EvaluatedFrame] = []
    if path.is_file():
        done = read_rows(path, header)
        write_atomic(path, b"")
    append_row(path, header)
    for row in done:
        append_row(path, row)
    return done


def _metrics(folder: Path, labels: Sequence[str], rows: Sequence[EvaluatedFrame]) -> Metrics:
    """Return the metrics of all methods, with the kernels and a description of the images."""
    kind, colour = _pictures(folder, rows, read_card(folder).camera.pixel_encoding)
    return compose(
        [method_metrics(label, [r for r in rows if r.method == label]) for label in labels],
        describe_library(),
        kind,
        grey_from_colour=colour,
        mean_predictor=_mean_predictor(folder, rows),
    )


def _mean_predictor(folder: Path, rows: Sequence[EvaluatedFrame]) -> MeanPredictor | None:
    """Return the errors of the mean pose on every feasible frame."""
    poses = []
    for k in sorted({row.frame for row in rows if row.record.feasible}):
        try:
            truth = read_truth(frame_paths(folder, k).truth)
        except UserError:
            # a resumed run may have rows of files that have been deleted since
            continue
        poses.append((truth.q_camera_from_target_wxyz, truth.t_camera_from_target_m))
    return mean_predictor(*zip(*poses, strict=True)) if poses else None


def _pictures(folder: Path, rows: Sequence[EvaluatedFrame], encoding: str) -> tuple[str, bool]:
    """Describe the images of a data set by the first evaluated one, and return whether they are in colour."""
    for row in rows:
        try:
            image = read_png(frame_paths(folder, row.frame).image)
        except UserError:
            # a resumed run may have rows of files that have been deleted since
            continue
        return describe_pictures(image, encoding), image.ndim == 3
    return "", False


def method_metrics(label: str, rows: Sequence[EvaluatedFrame]) -> MethodMetrics:
    """Return the metrics of one method's rows.

    Returns
    -------
    MethodMetrics
        Metrics over all rows, by range and by class, under the name ``label``.
    """
    return summarise(
        [r.record for r in rows],
        method=label,
        failures=[r.failure for r in rows if r.failure],
        times_ms=[r.total_ms for r in rows],
    )


def _answers(
    tasks: list[tuple[int, str]],
    setting: tuple[Path, BoardModel, dict[str, Any], tuple[MethodChoice, ...]],
    workers: int,
) -> Generator[EvaluatedFrame | str]:
    try:
        if not tasks:
            return
        in_order = {c.label for c in setting[3] if c.in_order}
        local_tasks = [task for task in tasks if workers <= 1 or task[1] in in_order]
        tasks = [task for task in tasks if task not in set(local_tasks)]
        if local_tasks:
            evaluator = Evaluator(*setting)
            for task in local_tasks:
                try:
                    yield evaluator.answer(*task)
                except UserError as error:
                    yield str(error)
        yield from run_tasks(
            answer_in_worker, tasks, workers, start=start_worker, arguments=setting, chunk_size=2
        )
    except BoardModelError as error:
        raise UserError(str(error)) from error
