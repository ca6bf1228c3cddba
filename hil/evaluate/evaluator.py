"""Estimators of one evaluation process, made once and called frame by frame."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2

from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics, Estimator
from flyaround.hil.board.hybrid.image.noise import noise_sigma
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.evaluate.added_estimators import any_estimator
from flyaround.hil.evaluate.failure_stage import failure_kind
from flyaround.hil.evaluate.greyscale import grey
from flyaround.hil.evaluate.method_choice import MethodChoice
from flyaround.hil.evaluate.pose_errors import frame_record
from flyaround.hil.evaluate.result_rows import EvaluatedFrame
from flyaround.simulator.dataset.formats.native import frame_paths, read_png
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.imported import LabelRecord, read_label_record

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Evaluator:
    """Estimators of one or more methods for the frames of a data set.

    Parameters
    ----------
    folder : Path
        Data set.
    model : BoardModel
        Model of the target.
    camera : dict
        Camera object of the data set.
    choices : tuple of MethodChoice
        Methods with their options.
    """

    def __init__(
        self, folder: Path, model: BoardModel, camera: dict[str, Any], choices: tuple[MethodChoice, ...]
    ) -> None:
        self.folder = folder
        intrinsics = CameraIntrinsics.from_dict(camera)
        self._encoding = intrinsics.encoding
        self.craft = PreparedTarget.prepare(model, intrinsics)
        self.estimators: dict[str, Estimator] = {
            c.label: any_estimator(model, intrinsics, c) for c in choices
        }
        self._last: tuple[int, LabelRecord, NDArray[Any]] | None = None

    def _frame(self, k: int) -> tuple[LabelRecord, NDArray[Any]]:
        """Return a frame's truth and image, linear and grey; the last frame is cached for the next method."""
        if self._last is None or self._last[0] != k:
            paths = frame_paths(self.folder, k)
            self._last = k, read_label_record(paths.truth), grey(read_png(paths.image), self._encoding)
        return self._last[1:]

    def answer(self, k: int, label: str) -> EvaluatedFrame:
        """Return the answer of the method ``label`` to frame ``k``.

        Raises
        ------
        UserError
            If the frame's files cannot be read.
        """
        truth, image = self._frame(k)
        trace: dict[str, Any] = {}
        threads = cv2.getNumThreads()
        cv2.setNumThreads(1)
        try:
            result = self.estimators[label].estimate(image, trace, truth.t_s)
        finally:
            cv2.setNumThreads(threads)
        q, t = result.q_camera_from_target_wxyz, result.t_camera_from_target_m
        record = frame_record(
            truth.q_camera_from_target_wxyz,
            truth.t_camera_from_target_m,
            q,
            t,
            accepted=result.accepted,
            feasible=truth.feasible,
            frame_class=truth.infeasible_reason or "feasible",
            covariance=result.covariance,
        )
        failure = ""
        if truth.feasible and not record.coarse:
            failure = failure_kind(
                image,
                truth.box_px,
                truth.q_camera_from_target_wxyz,
                truth.t_camera_from_target_m,
                result,
                trace.get("regions", ()),
                self.craft,
                max(noise_sigma(image, float(image.max())), 1e-3 * max(float(image.max()), 1.0)),
            )
        return EvaluatedFrame(
            frame=k,
            method=label,
            record=record,
            reason=result.reason,
            failure=failure,
            confidence=float(result.confidence),
            q_wxyz=None if q is None else (float(q[0]), float(q[1]), float(q[2]), float(q[3])),
            t_m=None if t is None else (float(t[0]), float(t[1]), float(t[2])),
            stages_ms={name: round(float(ms), 3) for name, ms in result.stages_ms.items()},
            counts={name: int(n) for name, n in result.counts.items()},
        )


_evaluator: Evaluator | None = None


def start_worker(
    folder: Path, model: BoardModel, camera: dict[str, Any], choices: tuple[MethodChoice, ...]
) -> None:
    """Make the estimators of this process."""
    global _evaluator  # noqa: PLW0603 - initialiser of a process pool, which cannot pass state to its tasks otherwise
    _evaluator = Evaluator(folder, model, camera, choices)


def answer_in_worker(task: tuple[int, str]) -> EvaluatedFrame | str:
    """Evaluate one (frame, method) in a pool process; return a message if the frame cannot be read.

    Raises
    ------
    RuntimeError
        If `start_worker` was not called in this process.
    """
    if _evaluator is None:
        raise RuntimeError("start_worker was not called in this process")
    try:
        return _evaluator.answer(*task)
    except UserError as error:
        return str(error)
