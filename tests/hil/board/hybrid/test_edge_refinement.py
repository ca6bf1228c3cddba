"""Pose refinement on edges: bounds of a step, and poses without a visible edge."""

from __future__ import annotations

import numpy as np
import pytest

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.refine.edges import Gradients, fine_align, limit_one_step, limit_step
from tests.harness.box_model import box_model

RADIUS_M = 0.8
T_M = np.array([0.1, -0.05, 3.0])

STEPS = [
    (np.inf, 0, 0, 0, 0, 0),
    (1e200, 0, 0, 0, 0, 0),
    (10, 0, 0, 0, 0, np.nan),
    (np.nan,) * 6,
    (0, 0, 0, 1e200, -np.inf, 1e300),
    (3, 0, 0, 5, 0, -9),
    (0.1, 0, 0, 0.1, 0, -0.1),
]


@pytest.mark.parametrize("values", STEPS)
def test_no_step_leaves_its_bounds(values: tuple[float, ...]) -> None:
    step = np.array(values, float)
    for limited in (limit_step(step[None], T_M[None], RADIUS_M)[0], limit_one_step(step, T_M, RADIUS_M)):
        assert np.isfinite(limited).all()
        assert np.linalg.norm(limited[:3]) <= 0.25 * (1 + 1e-12)
        assert np.linalg.norm(limited[3:5]) <= RADIUS_M * (1 + 1e-12)
        assert abs(limited[5]) <= 0.2 * T_M[2] * (1 + 1e-12)
    if np.abs(step).max() < 0.2:
        assert np.array_equal(limited, step)


def test_a_pose_without_visible_edges_stays() -> None:
    camera = CameraIntrinsics(640, 480, 800.0, 800.0, 320.0, 240.0)
    craft = PreparedTarget.prepare(BoardModel.from_dict(box_model()), camera)
    flat = np.zeros((48, 64), np.float32)
    q = np.array([1.0, 0.0, 0.0, 0.0])
    for empty in (False, True):
        gradients = Gradients(flat, flat, 1.0, 0.0, 0.0, 10.0, empty)
        pose, fit = fine_align(craft, q, T_M, np.zeros(0, int), gradients, (8, 6))
        assert np.array_equal(pose.q, q)
        assert np.array_equal(pose.t, T_M)
        assert np.linalg.eigvalsh(pose.covariance).min() > 0
        assert fit.matched_share == fit.tight == 0
