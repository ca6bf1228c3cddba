"""The comparison of methods in the demo: right, accepted, time, and the stage that lost the right pose."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flyaround.hil.board.estimation import PoseResult
from flyaround.hil.demo.method_comparison import comparison_rows, comparison_section, method_answer

Q, T_M = np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 5.0])
FAR_M = np.array([0.0, 0.0, 6.0])
TRUTH: Any = SimpleNamespace(q_camera_from_target_wxyz=tuple(Q), t_camera_from_target_m=tuple(T_M))


def result(t, *, accepted, stages=("pnp", "rank")):
    q = None if t is None else Q
    return PoseResult(accepted, "" if accepted else "declined", q, t, 0.5, dict.fromkeys(stages, 10.0), {})


def handed_on(*stages):
    """Stages with the position of the one pose that each hands on, None for no pose."""
    return [
        (name, np.zeros((0, 4)), np.zeros((0, 3))) if t is None else (name, Q[None], t[None])
        for name, t in stages
    ]


@pytest.mark.parametrize(
    ("answer", "poses", "failed_at"),
    [
        (result(T_M, accepted=True), handed_on(("pnp", T_M), ("rank", T_M)), ""),
        (result(T_M, accepted=False), handed_on(("pnp", T_M), ("rank", T_M)), "decision"),
        (result(FAR_M, accepted=True), handed_on(("pnp", T_M), ("rank", T_M)), "decision"),
        (result(FAR_M, accepted=False), handed_on(("pnp", T_M), ("rank", FAR_M)), "rank"),
        (result(None, accepted=False), handed_on(("pnp", None)), "pnp"),
        (result(None, accepted=False, stages=("regions", "lines")), [], "lines"),
        # a second round finds it
        (
            result(FAR_M, accepted=False),
            handed_on(("pnp", FAR_M), ("rank", FAR_M), ("rank", T_M)),
            "decision",
        ),
    ],
)
def test_a_failure_is_named_by_the_stage_that_lost_the_right_pose(answer, poses, failed_at):
    told = method_answer("svd-2018", 3, answer, poses, TRUTH)
    assert told.failed_at == failed_at
    assert told.accepted == answer.accepted
    assert told.ms == 20.0


def test_a_method_has_one_row():
    right = method_answer("hybrid", 0, result(T_M, accepted=True), [], TRUTH)
    wrong = method_answer("svd-2018", 0, result(FAR_M, accepted=True), handed_on(("pnp", FAR_M)), TRUTH)
    assert comparison_rows([right, right, wrong]) == [
        ("hybrid", "2", "2", "2", "0", "20", "\N{EN DASH}"),
        ("svd-2018", "1", "0", "1", "1", "20", "pnp (1)"),
    ]
    assert "svd-2018" in str(comparison_section([right, wrong]))
