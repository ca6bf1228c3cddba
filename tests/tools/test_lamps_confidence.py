"""What another bias of the confidence by lamps would have accepted, and the bias that the rule chooses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lamp_lit import MOCK_UP

from flyaround.hil.board.hybrid.decide.confidence import (
    Evidence,
    confidence,
)
from flyaround.hil.board.hybrid.hypotheses.hypothesis import PoseFit
from flyaround.hil.board.hybrid.image.regime import Regime
from tools.studies.lamps_confidence import Judged, JudgedFrame, chosen_shift, counts

SEEN = replace(MOCK_UP, likeness=0.99, covered=0.4, regime=Regime.LAMPS)
FAINT = replace(SEEN, drawn=0.1, likeness=0.8)


Q = np.array([1.0, 0.0, 0.0, 0.0])
HERE, THERE = PoseFit(Q, np.array([0.0, 0.0, 5.0])), PoseFit(Q, np.array([0.0, 0.0, 9.0]))


def frame(evidence: Evidence, *, right: bool, second: Evidence = FAINT, pose: PoseFit = THERE) -> JudgedFrame:
    """A frame whose first round ended here, and the second at ``pose``."""
    first = Judged(evidence, right, HERE)
    return JudgedFrame(first, first, Judged(second, right=False, pose=pose))


@pytest.mark.slow
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
