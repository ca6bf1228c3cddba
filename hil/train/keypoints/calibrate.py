"""Calibration of the estimator for one craft, by its answers to frames that its network was not trained on.

The weights of the confidence are fitted again, with a Gaussian prior at those of an uncalibrated craft, because some
hundred frames do not determine twelve numbers (docs/lab/2026-11-keypoint-network.md, Calibration).
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np
from scipy.optimize import minimize

from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.hybrid.decide.confidence import UNCALIBRATED, Evidence, decide, terms
from flyaround.hil.board.hybrid.estimator import PoseEstimator
from flyaround.hil.board.hybrid.propose.keypoints.calibration import MAX_COVARIANCE_FACTOR, Calibration
from flyaround.hil.evaluate.greyscale import grey
from flyaround.hil.evaluate.pose_errors import FrameScore, frame_record
from flyaround.simulator.dataset.capture import capture
from flyaround.simulator.dataset.card import read_card
from flyaround.simulator.dataset.formats.native import frame_paths, is_frame_complete, read_png
from flyaround.simulator.labels.imported import read_label_record
from flyaround.simulator.recipes.plan import plan_recipe

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from flyaround.hil.board.estimation import BoardModel
    from flyaround.hil.board.estimation.result import PoseResult
    from flyaround.simulator.runtime.arrays import BoolArray, FloatArray

# Recipes of the frames: in front of space, and of the Earth.
RECIPES = ("eval-black", "eval-earth")

# Penalty on squared deviations of the standardised weights from the prior, and standard deviation of the prior's logit
# at the mean of the answers.
RIDGE, PRIOR_SIGMA = 0.5, 2.0

# Upper 5 % point of the chi-square distribution with six degrees of freedom.
CHI2_95 = 12.592


class Answer(NamedTuple):
    """Answer to one frame that was decided by the whole image.

    Parameters
    ----------
    score : FrameScore
        Errors of its pose.
    evidence : Evidence
        Evidence of its decision.
    result : PoseResult
        The answer.
    """

    score: FrameScore
    evidence: Evidence
    result: PoseResult

    def is_accepted(self, calibration: Calibration) -> bool:
        """Return True if the pose is accepted with a calibration."""
        return not decide(replace(self.evidence, calibration=calibration))


def answers(
    folder: Path, model: BoardModel, progress: Callable[[int, int], None] = lambda _done, _total: None
) -> Iterator[Answer]:
    """Run the estimator on the frames of a data set, feasible or not.

    Parameters
    ----------
    folder : Path
        Data set.
    model : BoardModel
        Model of its target.
    progress : callable, optional
        Called with the number of finished frames, and the total.

    Yields
    ------
    Answer
        Answer to each frame with a pose that was decided by the whole image.

    Raises
    ------
    UserError
        If a file of the data set cannot be read.
    """
    card = read_card(folder)
    camera = CameraIntrinsics.from_dict(msgspec.to_builtins(card.camera))
    estimator = PoseEstimator(model, camera)
    for k in range(card.n_frames):
        progress(k, card.n_frames)
        if not is_frame_complete(folder, k):
            continue
        paths = frame_paths(folder, k)
        truth = read_label_record(paths.truth)
        result = estimator.estimate(grey(read_png(paths.image), camera.encoding))
        evidence = result.evidence
        if not isinstance(evidence, Evidence) or evidence.score is None:
            continue
        score = frame_record(
            truth.q_camera_from_target_wxyz,
            truth.t_camera_from_target_m,
            result.q_camera_from_target_wxyz,
            result.t_camera_from_target_m,
            accepted=result.accepted,
            feasible=truth.feasible,
            covariance=result.covariance,
        )
        yield Answer(score, evidence, result)


def held_out_answers(
    name: str,
    model: BoardModel,
    folder: Path,
    *,
    frames: int,
    seed: int,
    workers: int,
    progress: Callable[[int, int], None],
) -> list[Answer]:
    """Render frames of a target, and run the uncalibrated estimator on them.

    Parameters
    ----------
    name : str
        Name of the target.
    model : BoardModel
        Its model, with an uncalibrated network.
    folder : Path
        Folder of the frames; those of an interrupted run are used.
    frames : int
        Number of frames. Infeasible ones count, because a board decides on dark images, too.
    seed : int
        Seed of the frames.
    workers : int
        Number of render processes.
    progress : callable
        Called with the number of finished steps, and the total.

    Returns
    -------
    list of Answer
        Answers to the frames with a pose.

    Raises
    ------
    UserError
        If the disk is full, or the folder holds other frames.
    """
    given: list[Answer] = []
    for k, recipe in enumerate(RECIPES if frames else ()):
        n = max(frames // len(RECIPES), 1)
        first, total = 2 * n * k, 2 * n * len(RECIPES)
        plan = plan_recipe(recipe, n, seed=seed, target=name)
        draw = partial(_advance, progress, first, total)
        capture(plan, folder / recipe, labels=(), resume=True, workers=workers, progress=draw)
        given += answers(folder / recipe, model, partial(_advance, progress, first + n, total))
    return given


def _advance(progress: Callable[[int, int], None], first: int, total: int, done: int, _of: int) -> None:
    progress(first + done, total)


def fitted_calibration(given: Sequence[Answer]) -> Calibration:
    """Fit a calibration to answers of an uncalibrated estimator.

    The covariance is only ever widened, so that it contains 95 % of the right poses: errors have heavy tails, and their
    quantile over some 60 poses is uncertain by a factor of 3.

    Returns
    -------
    Calibration
        Calibration; without answers the weights and covariance of an uncalibrated craft.
    """
    if not given:
        return UNCALIBRATED
    X = np.array([terms(answer.evidence, answer.evidence.score or 0.0) for answer in given])
    is_right = np.array([answer.score.coarse for answer in given], bool)
    weights = ridge_weights(X, is_right, np.array(UNCALIBRATED.weights), 0.5 / PRIOR_SIGMA**2)
    nees = [a.score.nees for a in given if a.score.coarse and a.score.nees is not None]
    factor = float(np.quantile(nees, 0.95)) / CHI2_95 if nees else 1.0
    return Calibration(
        tuple(weights.tolist()), float(np.clip(factor, 1.0, MAX_COVARIANCE_FACTOR)), len(given)
    )


def ridge_weights(X: FloatArray, is_right: BoolArray, prior: FloatArray, bias_penalty: float) -> FloatArray:
    """Return bias and weights of a logistic regression with a penalty on the deviation from prior ones.

    Parameters
    ----------
    X : (N, M) array
        Regressors of each answer.
    is_right : (N,) array of bool
        True for the right answers.
    prior : (1 + M,) array
        Bias and weights that are not penalised.
    bias_penalty : float
        Penalty on the squared deviation of the logit at the mean of the answers.

    Returns
    -------
    (1 + M,) array
        Bias, and a weight for each regressor; that of a constant regressor is the prior's.
    """
    mean, spread = X.mean(axis=0), X.std(axis=0)
    # a constant regressor determines nothing
    spread = np.where(spread > 1e-6, spread, np.inf)
    Z, before = (X - mean) / spread, prior[0] + X @ prior[1:]

    def cost(w: FloatArray) -> float:
        z = before + w[0] + Z @ w[1:]
        log_loss = np.logaddexp(0, np.where(is_right, -z, z)).sum()
        return float(log_loss + bias_penalty * w[0] ** 2 + RIDGE * w[1:] @ w[1:])

    w = minimize(cost, np.zeros(X.shape[1] + 1), method="L-BFGS-B").x
    weights = w[1:] / spread
    return np.asarray(prior + np.concatenate([[w[0] - weights @ mean], weights]))
