"""Comparison of methods on the same frames: correct and accepted poses, time, and the stage at which each failed."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.method_names import HYBRID
from flyaround.hil.board.methods import PUBLISHED, make_estimator
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.hil.evaluate.pose_errors import COARSE_DEG, COARSE_SHARE
from flyaround.simulator.reports.markup import Markup, markup
from flyaround.simulator.reports.page import note, table

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from flyaround.hil.board.estimation.result import PoseResult
    from flyaround.simulator.frame import Frame
    from flyaround.simulator.labels.truth import Truth
    from flyaround.simulator.targets.model import Target

Array = np.ndarray[Any, Any]

COMPARED = (HYBRID, *PUBLISHED)

# Number of frames that are compared; the published methods take a second each.
N_COMPARED = 8

DECISION = "decision"


@dataclass(frozen=True)
class MethodAnswer:
    """Result of a method on one frame.

    Parameters
    ----------
    method : str
        Name of the method.
    frame_id : int
        Number of the frame.
    right : bool
        True if the pose is within 5 deg and 5 % of the range.
    accepted : bool
        True if the method accepts its pose.
    ms : float
        Wall time of all stages.
    failed_at : str
        Stage that lost the correct pose, or never had it; ``decision`` if it was declined or another pose selected.
        Empty if a correct pose is accepted.
    """

    method: str
    frame_id: int
    right: bool
    accepted: bool
    ms: float
    failed_at: str


def compare_methods(
    frames: Mapping[int, Frame], target: Target, progress: Callable[[int, int], None]
) -> tuple[MethodAnswer, ...]:
    """Estimate frames, spread evenly over those given, with every method in this process.

    Parameters
    ----------
    frames : mapping
        Frames with their truth, by frame number.
    target : Target
        Target visible in the frames.
    progress : callable
        Called with the number of estimates done, and the total.
    """
    numbers = sorted(k for k, frame in frames.items() if frame.truth is not None)
    numbers = numbers[:: max(len(numbers) // N_COMPARED, 1)][:N_COMPARED]
    answers: list[MethodAnswer] = []
    model = board_model(target)
    for method in COMPARED:
        for k in numbers:
            truth = frames[k].truth
            assert truth is not None  # noqa: S101 - frames with truth were selected
            camera = CameraIntrinsics.from_dict(msgspec.to_builtins(truth.camera))
            trace: dict[str, Any] = {}
            result = make_estimator(model, camera, method).estimate(frames[k].image, trace)
            answers.append(method_answer(method, k, result, trace.get("poses", ()), truth))
            progress(len(answers), len(COMPARED) * len(numbers))
    return tuple(answers)


def method_answer(
    method: str, frame_id: int, result: PoseResult, poses: Sequence[tuple[str, Any, Any]], truth: Truth
) -> MethodAnswer:
    """Return an estimate scored against the truth.

    Parameters
    ----------
    method : str
        Name of the estimator.
    frame_id : int
        Number of the frame.
    result : PoseResult
        Result of the method.
    poses : sequence
        Stage name, q (N, 4) and t (N, 3) of the poses that each stage passed on, in order.
    truth : Truth
        Truth record of the frame.
    """
    q, t = result.q_camera_from_target_wxyz, result.t_camera_from_target_m
    right = q is not None and t is not None and _any_correct(truth, q[None], t[None])
    failed_at = "" if right and result.accepted else DECISION
    if not right:
        stages = list(dict.fromkeys(name for name, _, _ in poses))
        # a stage of a second round may recover a pose that the first round lost
        holding = [
            stages.index(name) for name, some_q, some_t in poses if _any_correct(truth, some_q, some_t)
        ]
        # a method that stopped before it had any pose failed where it stopped
        stages = stages or list(result.stages_ms)[-1:]
        failed_at = [*stages, DECISION][max(holding, default=-1) + 1]
    return MethodAnswer(method, frame_id, right, result.accepted, sum(result.stages_ms.values()), failed_at)


def _any_correct(truth: Truth, q: Array, t: Array) -> bool:
    """Return True if any of N poses q (N, 4), t (N, 3) is within 5 deg and 5 % of the range."""
    true_t = np.asarray(truth.t_camera_from_target_m)
    turn = 2 * np.arccos(np.minimum(np.abs(q @ np.asarray(truth.q_camera_from_target_wxyz)), 1.0))
    share = np.linalg.norm(t - true_t, axis=1) / np.linalg.norm(true_t)
    return bool(np.any((np.degrees(turn) <= COARSE_DEG) & (share <= COARSE_SHARE)))


HEAD = ("method", "frames", "right", "accepted", "accepted, wrong", "median time [ms]", "failed at (frames)")


def comparison_rows(answers: Sequence[MethodAnswer]) -> list[tuple[str, ...]]:
    """Return a table row for each method, in the order of the answers."""
    rows: list[tuple[str, ...]] = []
    for method in dict.fromkeys(a.method for a in answers):
        method_answers = [a for a in answers if a.method == method]
        failures = Counter(a.failed_at for a in method_answers if a.failed_at)
        rows.append(
            (
                method,
                str(len(method_answers)),
                str(sum(a.right for a in method_answers)),
                str(sum(a.accepted for a in method_answers)),
                str(sum(a.accepted and not a.right for a in method_answers)),
                f"{np.median([a.ms for a in method_answers]):.0f}",
                ", ".join(f"{stage} ({n})" for stage, n in failures.most_common()) or "\N{EN DASH}",
            )
        )
    return rows


def comparison_section(answers: Sequence[MethodAnswer]) -> Markup:
    """Return the section of the page with the table and the meaning of its columns."""
    return markup(
        note(
            "hybrid is the project's own method, which also ran on the board; svd-2018 is the algorithm of Sharma, "
            "Ventura and D'Amico (2018), and svd-thesis its variant in the Milan thesis. All three estimated the same "
            "frames on this machine. A pose is right within 5 deg and 5 % of the range. A frame counts as failed at "
            "the stage that lost the right pose or never had it, or at the decision if it was declined or another "
            "selected."
        ),
        table(HEAD, comparison_rows(answers)),
    )
