"""Stages of the published method on inputs whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.svd.perceptual_groups import (
    Lines,
    antennas,
    image_triads,
    parallel_pairs,
    proximity_pairs,
)
from flyaround.hil.board.svd.pose_solvers import solve_points
from flyaround.hil.board.svd.region_of_interest import marginal_interval
from flyaround.hil.board.svd.segment_merging import merge_segments
from flyaround.hil.board.svd.weak_gradients import eliminate_weak_gradients, exponential_threshold
from flyaround.hil.board.svd.wireframe_groups import model_triads
from tests.harness.box_model import box_model

MODEL = BoardModel.from_dict(box_model())
POSE_Q = quat.normalise(np.array([0.7, 0.5, -0.3, 0.2]))
POSE_T = np.array([0.1, -0.05, 3.0])


def test_threshold_of_an_exponential_is_4605_times_its_mean() -> None:
    x = np.random.default_rng(2).exponential(0.02, 400_000)
    counts = np.histogram(x, 100, (0, 1))[0]
    threshold = exponential_threshold(counts, 0.99)
    assert threshold == pytest.approx(4.605 * 0.02, rel=0.05)
    assert (x > threshold).mean() == pytest.approx(0.01, abs=0.003)


def test_weak_gradients_vanish_and_the_outline_stays() -> None:
    image = np.random.default_rng(3).normal(20, 3, (120, 160)).astype(np.float32)
    image[40:80, 50:110] += 150
    strong = eliminate_weak_gradients(image).strong
    ys, xs = np.nonzero(strong)
    assert (xs.min(), xs.max(), ys.min(), ys.max()) == pytest.approx((49, 110, 39, 80), abs=2)
    assert not strong[45:75, 56:104].any()
    assert marginal_interval(np.ones(1000), 0.025, 0.975) == pytest.approx((24, 974), abs=1)


def test_broken_and_doubled_segments_become_one_line() -> None:
    pieces = [[10, 10, 50, 30], [56, 33, 90, 50], [12, 11.5, 60, 35.2], [10, 100, 90, 100]]
    merged = merge_segments(np.array(pieces, float), 150.0)
    assert len(merged) == 2
    first = merged[0].reshape(2, 2)
    assert first[np.argsort(first[:, 0])] == pytest.approx(np.array([[10, 10], [90, 50]]), abs=1.0)


def test_figures_of_a_square_and_a_rod() -> None:
    square = [[20, 20, 98, 20], [100, 22, 100, 100], [98, 100, 22, 100], [20, 98, 20, 23]]
    rod = [[130, 20, 130, 90], [136, 20, 136, 90]]
    lines = Lines.of(np.array(square + rod, float))
    corners = proximity_pairs(lines, 8.0)
    assert len(corners.line) == 4
    chains = image_triads(lines, corners)
    assert chains.closed.sum() == 4
    assert np.sort(chains.points[0][:, 0]) == pytest.approx([20, 20, 100, 100], abs=1e-6)
    pairs = parallel_pairs(lines)
    assert [4, 5] in pairs.tolist()
    assert antennas(lines, pairs, 150.0).tolist() == [[4, 5]]


def test_the_box_has_closed_figures_on_its_six_faces() -> None:
    chains = model_triads(MODEL)
    # 6 faces x 4 middle edges x 2 ways round
    assert len(chains.closed) == 48
    assert chains.closed.all()


@pytest.mark.parametrize("solver", ["epnp", "sqpnp", "ap3p", "p3p", "iterative"])
def test_point_solvers_hold_the_true_pose(solver: str) -> None:
    # not one plane: EPnP and three-point solvers are ill-posed there
    points = np.array(
        [
            [-0.5, -0.4, 0.2],
            [0.5, -0.4, 0.2],
            [0.5, 0.4, -0.2],
            [-0.4, 0.4, 0.1],
            [0.1, 0.2, 0.3],
            [0.3, 0, -0.3],
        ]
    )
    if solver in ("ap3p", "p3p"):
        points = points[:4]
    p = points @ quat.matrix(POSE_Q).T + POSE_T
    q, t = solve_points(points, p[:, :2] / p[:, 2:], solver)
    k = int(np.argmin(quat.angle_rad(q, POSE_Q)))
    assert quat.angle_rad(q[k], POSE_Q) < 1e-3
    assert t[k] == pytest.approx(POSE_T, abs=5e-3)
