"""What another bias of the confidence by lamps would have accepted, and the bias that the rule chooses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flyaround.hil.board.hybrid.decide.confidence import (
    ACCEPT_AT,
    LAMPS_AGREED,
    LAMPS_SOUGHT,
    Evidence,
    confidence,
)
from flyaround.hil.board.hybrid.hypotheses.hypothesis import PoseFit
from flyaround.hil.board.hybrid.image.regime import Regime
from tools.studies.lamps_confidence import Judged, JudgedFrame, accepted, chosen_shift, counts

SEEN = Evidence(
    drawn=0.5,
    explained=0.65,
    outside=0.0,
    margin=0.1,
    found=0.5,
    tight=0.5,
    rms_px=0.0,
    sigma_rad=0.004,
    sigma_share=0.002,
    edges=300,
    size_px=500.0,
    empty=True,
    score=0.23,
    likeness=0.99,
    covered=0.4,
    regime=Regime.LAMPS,
)
FAINT = replace(SEEN, drawn=0.1, likeness=0.8)


Q = np.array([1.0, 0.0, 0.0, 0.0])
HERE, THERE = PoseFit(Q, np.array([0.0, 0.0, 5.0])), PoseFit(Q, np.array([0.0, 0.0, 9.0]))


def frame(evidence: Evidence, *, right: bool, second: Evidence = FAINT, pose: PoseFit = THERE) -> JudgedFrame:
    """A frame whose first round ended here, and the second at ``pose``."""
    first = Judged(evidence, right, HERE)
    return JudgedFrame(first, first, Judged(second, right=False, pose=pose))


def test_a_sure_first_round_is_accepted_until_the_bar_is_above_it() -> None:
    assert confidence(SEEN) > ACCEPT_AT > confidence(FAINT)
    own = accepted(frame(SEEN, right=True), 0.0)
    assert own is not None
    assert own.right
    assert accepted(frame(SEEN, right=True), -9.0) is None


def test_a_second_round_is_asked_where_the_first_is_declined() -> None:
    found = accepted(frame(FAINT, right=True, second=SEEN), 0.0)
    assert found is not None
    assert not found.right
    # nor is a rival as good let pass by any bias
    tied = replace(SEEN, margin=0.0)
    assert accepted(frame(tied, right=True, second=tied), 9.0) is None


def test_two_rounds_that_end_at_one_pose_are_surer_than_one_or_two_poses() -> None:
    logit = np.log(ACCEPT_AT / (1 - ACCEPT_AT)) - np.log(confidence(SEEN) / (1 - confidence(SEEN)))
    # between what one round needs and what two that agree need
    short = float(logit) - 0.5 * LAMPS_AGREED
    assert accepted(frame(SEEN, right=True, pose=HERE), short) is not None
    assert accepted(frame(SEEN, right=True, pose=THERE), float(logit) - 1.2 * LAMPS_SOUGHT) is None


def test_a_doubtful_first_round_is_held_against_near_leans() -> None:
    judged, leant = Judged(SEEN, right=False, pose=HERE), Judged(replace(SEEN), right=True, pose=HERE)
    both = JudgedFrame(judged, leant, Judged(FAINT, right=False, pose=THERE))
    assert accepted(both, 3.0) is judged
    # between the bar and what is clear it is doubtful
    shift = next(s for s in (-0.05 * k for k in range(200)) if accepted(both, s) is leant)
    assert counts([both], shift) == (1, 0)


def test_the_rule_allows_one_wrong_in_forty() -> None:
    weak = replace(SEEN, likeness=0.96)
    assert confidence(weak) < confidence(SEEN)
    right = [frame(SEEN, right=True)] * 80
    assert chosen_shift(right[:30]) is None
    assert chosen_shift(right) == pytest.approx(3.0)
    # one more wrong one than may be: the bar goes above it
    shift = chosen_shift([*right, *[frame(weak, right=False)] * 5])
    assert shift is not None
    assert counts([frame(weak, right=False)], shift) == (0, 0)
    assert counts(right, shift) == (80, 0)
