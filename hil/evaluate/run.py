"""The board's estimator over a labelled data set: every frame's answer beside its truth, and the metrics."""

from __future__ import annotations

import csv
import io
import logging
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import cv2
import msgspec

from hil.board.svd import BoardModel, CameraIntrinsics, Estimator, make_estimator
from hil.evaluate.metrics import FrameRecord, Metrics, frame_record, summarise
from simulator.dataset.card import read_card
from simulator.dataset.native import frame_paths, is_whole, read_png
from simulator.errors import UserError
from simulator.files import write_atomic
from simulator.labels.truth import read_truth
from simulator.targets.board_file import write_board_model
from simulator.targets.library import load_target

if TYPE_CHECKING:
    from collections.abc import Callable

    from simulator.targets.model import Target

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class EvaluatedFrame:
    """One frame of the report: its record, why it was declined, and what it cost."""

    frame: int
    record: FrameRecord
    reason: str
    confidence: float
    total_ms: float


def board_model(target: Target) -> BoardModel:
    """The small form of a target, as a board reads it."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{target.name}.board.json"
        write_board_model(target, path)
        return BoardModel.read(str(path))


def evaluate_dataset(
    folder: Path,
    report: Path,
    *,
    method: str = "svd",
    progress: Callable[[int, int], None] = lambda _done, _of: None,
) -> Metrics:
    """Estimate every frame of a data set and write ``metrics.json`` and ``frames.csv``.

    Parameters
    ----------
    report : folder that receives the two files.

    Raises
    ------
    UserError
        If the folder is not a data set or holds no whole frame.
    """
    card = read_card(folder)
    frames = [k for k in range(card.n_frames) if is_whole(folder, k)]
    if not frames:
        raise UserError(f"data set {folder} has no whole frame; capture some first")
    estimator = make_estimator(
        board_model(load_target(card.target.name)),
        CameraIntrinsics.from_dict(msgspec.to_builtins(card.camera)),
        method=method,
    )
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        rows = []
        for done, k in enumerate(frames):
            try:
                rows.append(_evaluate(folder, k, estimator))
            except UserError as error:
                log.warning("frame %d is left out: %s", k, error)
            progress(done + 1, len(frames))
    finally:
        cv2.setNumThreads(threads)
    if not rows:
        raise UserError(f"no frame of data set {folder} can be read; run flyaround check on it")
    metrics = summarise([row.record for row in rows], method=method)
    write_atomic(report / "metrics.json", msgspec.json.format(msgspec.json.encode(metrics), indent=1))
    write_atomic(report / "frames.csv", _table(rows))
    return metrics


def _evaluate(folder: Path, k: int, estimator: Estimator) -> EvaluatedFrame:
    paths = frame_paths(folder, k)
    truth = read_truth(paths.truth)
    result = estimator.estimate(read_png(paths.image))
    record = frame_record(
        truth.q_camera_from_target_wxyz,
        truth.t_camera_from_target_m,
        result.q_camera_from_target_wxyz,
        result.t_camera_from_target_m,
        accepted=result.accepted,
        feasible=truth.feasible,
        frame_class=truth.infeasible_reason or "feasible",
    )
    total_ms = float(sum(result.stages_ms.values()))
    return EvaluatedFrame(k, record, result.reason, float(result.confidence), total_ms)


def _table(rows: list[EvaluatedFrame]) -> bytes:
    text = io.StringIO()
    names = ["frame", *FrameRecord.__struct_fields__, "reason", "confidence", "total_ms"]
    writer = csv.DictWriter(text, fieldnames=names, lineterminator="\n")
    writer.writeheader()
    for row in rows:
        values: dict[str, Any] = msgspec.structs.asdict(row.record)
        writer.writerow(
            values
            | {
                "frame": row.frame,
                "reason": row.reason,
                "confidence": row.confidence,
                "total_ms": row.total_ms,
            }
        )
    return text.getvalue().encode()
