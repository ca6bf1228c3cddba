"""Availability against false accepts, and the worth of a confidence, of frames whose decision is known."""

import numpy as np

from flyaround.hil.evaluate.decision_curves import reliability, trade_off
from flyaround.hil.evaluate.pose_errors import frame_record
from flyaround.hil.evaluate.result_rows import EvaluatedFrame

UPRIGHT, AHEAD_M = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 10.0)


def frame(number, confidence, *, right, feasible=True):
    q = np.array(UPRIGHT if right else (0.0, 1.0, 0.0, 0.0))
    record = frame_record(
        UPRIGHT,
        AHEAD_M,
        q,
        np.array(AHEAD_M),
        accepted=True,
        feasible=feasible,
        frame_class="feasible" if feasible else "dark",
    )
    return EvaluatedFrame(
        frame=number,
        method="hybrid",
        record=record,
        reason="",
        failure="",
        confidence=confidence,
        q_wxyz=UPRIGHT,
        t_m=AHEAD_M,
        stages_ms={},
        counts={},
    )


def test_thresholds_accept_in_the_order_of_confidence_and_equals_together():
    rows = [
        frame(0, 0.9, right=True),
        frame(1, 0.5, right=True),
        frame(2, 0.7, right=False, feasible=False),
        frame(3, 0.5, right=False),
        frame(4, 0.2, right=True),
    ]
    curve = trade_off(rows)
    np.testing.assert_allclose(curve.threshold, [0.9, 0.7, 0.5, 0.2])
    np.testing.assert_allclose(curve.availability, [1 / 4, 1 / 4, 3 / 4, 1.0])
    np.testing.assert_allclose(curve.false_accept, [0.0, 1 / 2, 2 / 4, 2 / 5])


def test_a_confidence_that_is_a_probability_lies_within_the_intervals():
    rng = np.random.default_rng(3)
    told = rng.uniform(0, 1, 4000)
    honest = [frame(k, float(c), right=bool(rng.random() < c)) for k, c in enumerate(told)]
    boastful = [frame(k, float(np.sqrt(c)), right=bool(rng.random() < c)) for k, c in enumerate(told)]
    # 95 % intervals: one bin of eight may miss
    assert sum(b.low <= b.confidence <= b.high for b in reliability(honest)) >= 7
    assert sum(b.low <= b.confidence <= b.high for b in reliability(boastful)) <= 2
    assert sum(b.n for b in reliability(honest)) == len(told)
