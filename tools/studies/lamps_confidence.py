"""The confidence in the light of lamps: what each bias accepts on development sets, and the bias of a rule.

    python -m tools.studies.lamps_confidence SET... --target tango [--bent SEED]

The estimator looks at each frame once: the selection of its first round, the same held against near leans, and that of
the second round are kept with the truth. What it would decide with another bias follows without looking again. With
``--bent`` the model is bent by 8 mm, as a mock-up is no exact copy of it.

The rule: the lowest bar at which (wrong + 1) / (accepted + 1) is at most 1 in 40 over all frames that go the lamps'
way, those that cannot be solved among them. Sets that a bias was chosen on say nothing of how it does: judge it on
others.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.hybrid.decide.confidence import ACCEPT_AT, LAMPS_BIAS, Evidence, confidence, decide
from flyaround.hil.board.hybrid.decide.near_minima import check_near_minima
from flyaround.hil.board.hybrid.estimator import (
    CLEAR,
    LIKELY,
    PoseEstimator,
    choose,
    propose_learned,
    propose_many_scales,
    ranked,
)
from flyaround.hil.board.hybrid.hypotheses.ambiguity import same_end
from flyaround.hil.board.hybrid.hypotheses.hypothesis import PoseFit
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.image.regime import Regime
from flyaround.hil.board.hybrid.prepare import prepare
from flyaround.hil.board.hybrid.refine.settling import settle
from flyaround.hil.evaluate.greyscale import grey
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.hil.evaluate.pose_errors import COARSE_DEG, COARSE_SHARE, frame_errors
from flyaround.simulator.dataset.card import read_card
from flyaround.simulator.dataset.formats.native import frame_paths, is_whole, read_png
from flyaround.simulator.labels.imported import read_label_record
from flyaround.simulator.targets.library import load_target
from tools.studies.published_methods import wrong_model

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.hil.board.hybrid.search_states import Choice

Array = np.ndarray[Any, Any]

# One wrong among so many accepted is what the rule allows.
ONE_IN = 40

# Standard deviation of a deformed model's vertices [m].
BENT_M = 0.008

# Biases that are tried, from today's on.
SHIFTS = np.round(np.arange(-3.0, 3.01, 0.1), 1)


@dataclass(frozen=True)
class Judged:
    """Evidence of a decision, and whether the pose is right."""

    evidence: Evidence
    right: bool
    pose: PoseFit


@dataclass(frozen=True)
class JudgedFrame:
    """One frame: the selection of the first round, that after near leans, and that of the second round."""

    first: Judged
    leant: Judged
    second: Judged


def judged_frame(estimator: PoseEstimator, image: NDArray[Any], q: Array, t: Array) -> JudgedFrame | None:
    """Return the data on which a frame's decision depends; None if the method for lamps is not used or nothing is
    visible.

    Parameters
    ----------
    q : (4,) true attitude, camera from target. t : (3,) true position [m].
    """
    lit = prepare(estimator.setup, Observation(image))
    if lit.regime is not Regime.LAMPS or lit.learned is None:
        return None
    proposals = propose_learned(lit)
    if not proposals.hypotheses:
        return None
    first = choose(ranked(proposals))
    leant = replace(
        first, selection=check_near_minima(estimator.target, lit.frame, lit.regime, first.selection)
    )
    second = choose(ranked(propose_many_scales(first.proposals, lit.learned)))
    return JudgedFrame(*(_judged(choice, q, t) for choice in (first, leant, second)))


def _judged(choice: Choice, q: Array, t: Array) -> Judged:
    selection, setup = choice.selection, choice.image.setup
    pose = settle(setup.target, choice.image.frame, selection.close, selection.best)
    _, share, deg = frame_errors(q, t, pose.q, pose.t)
    evidence = replace(selection.evidence, tried=setup.tried, looked=True, regime=Regime.LAMPS)
    return Judged(evidence, deg <= COARSE_DEG and share <= COARSE_SHARE, pose)


def accepted(frame: JudgedFrame, shift: float) -> Judged | None:
    """Return the pose accepted of a frame with the bias by lamps shifted, None if it would be declined."""

    def sure(judged: Judged) -> float:
        return _shifted(confidence(judged.evidence), shift)

    def held(judged: Judged) -> Judged | None:
        return None if decide(judged.evidence, _shifted(ACCEPT_AT, -shift)) else judged

    first = frame.leant if LIKELY < sure(frame.first) < CLEAR else frame.first
    if held(first) is not None:
        return first
    # the surest answer of both rounds stands, surer where both are the same
    agreed = same_end(first.pose, frame.second.pose)
    both = [replace(j, evidence=replace(j.evidence, agreed=agreed)) for j in (first, frame.second)]
    return held(max(both, key=sure))


def _shifted(probability: float, shift: float) -> float:
    """Return a probability with its logit shifted."""
    return float(1.0 / (1.0 + (1.0 / max(probability, 1e-12) - 1.0) * np.exp(-shift)))


def counts(frames: Sequence[JudgedFrame], shift: float) -> tuple[int, int]:
    """Return the frames accepted with a bias shifted, and how many of these are wrong."""
    some = [a for f in frames if (a := accepted(f, shift)) is not None]
    return len(some), sum(not a.right for a in some)


def chosen_shift(frames: Sequence[JudgedFrame]) -> float | None:
    """Return the largest shift of the bias, which is the lowest threshold, that the rule allows; None if there is
    none.
    """
    for shift in SHIFTS[::-1]:
        n, wrong = counts(frames, float(shift))
        if ONE_IN * (wrong + 1) <= n + 1:
            return float(shift)
    return None


def frames_of(dataset: Path, target: str, bent: int | None) -> Iterator[JudgedFrame]:
    """Yield the frames of a data set that use the method for lamps; ``bent`` is the seed of a deformed model."""
    card = read_card(dataset)
    model = board_model(load_target(target))
    if bent is not None:
        model = wrong_model(model, BENT_M, bent)
    estimator = PoseEstimator(model, CameraIntrinsics.from_dict(msgspec.to_builtins(card.camera)))
    for k in range(card.n_frames):
        if not is_whole(dataset, k):
            continue
        paths = frame_paths(dataset, k)
        truth = read_label_record(paths.truth)
        q = np.asarray(truth.q_camera_from_target_wxyz, float)
        frame = judged_frame(
            estimator, grey(read_png(paths.image)), q, np.asarray(truth.t_camera_from_target_m, float)
        )
        if frame is not None:
            yield frame


def main() -> None:
    """Look at the sets, and tell."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("datasets", type=Path, nargs="+")
    parser.add_argument("--target", default="tango", help="the estimator's model")
    parser.add_argument("--bent", type=int, default=None, help="seed of a model bent by 8 mm")
    options = parser.parse_args()
    frames = [f for d in options.datasets for f in frames_of(d, options.target, options.bent)]
    print(f"{len(frames)} frames by lamps\n\n| bias | accepted | wrong |\n|---|---|---|")
    for shift in SHIFTS:
        n, wrong = counts(frames, float(shift))
        print(f"| {LAMPS_BIAS + shift:.1f} | {n} | {wrong} |")
    best = chosen_shift(frames)
    print("\nno bias holds the rule" if best is None else f"\nby the rule: {LAMPS_BIAS + best:.1f}")


if __name__ == "__main__":
    main()
