"""Pose errors and their summary: values worked out by hand."""

import json

import jsonschema
import msgspec
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flyaround.hil.evaluate.metrics import (
    Metrics,
    bootstrap_intervals,
    compose,
    summarise,
    wilson_interval,
)
from flyaround.hil.evaluate.pose_errors import FrameScore, frame_errors, frame_record
from flyaround.hil.evaluate.pose_spread import pose_spread


def about_z(deg):
    return [float(np.cos(np.radians(deg) / 2)), 0.0, 0.0, float(np.sin(np.radians(deg) / 2))]


def test_errors_of_a_known_turn_and_shift():
    E_T, e_t, E_R = frame_errors(about_z(0), [0, 0, 10], about_z(30), [0.3, 0.4, 10])
    assert (E_T, e_t, E_R) == pytest.approx((0.5, 0.05, 30.0))


@pytest.mark.parametrize("deg", [1e-7, 0.05, 90.0, 179.999, 180.0])
def test_rotation_error_ignores_the_sign_and_keeps_small_angles(deg):
    q = np.array(about_z(deg))
    for sign in (1, -1):
        assert frame_errors(about_z(0), [0, 0, 1], sign * q, [0, 0, 1])[2] == pytest.approx(deg, rel=1e-6)


@pytest.mark.parametrize(
    ("q", "t"), [([0, 0, 0, 0], [0, 0, 1]), ([1, 0, 0, np.nan], [0, 0, 1]), ([1, 0, 0, 0], [np.inf, 0, 1])]
)
def test_useless_poses_are_refused(q, t):
    with pytest.raises(ValueError, match="finite"):
        frame_errors([1, 0, 0, 0], [0, 0, 5], q, t)


def test_accepted_without_a_pose_is_refused():
    with pytest.raises(ValueError, match="without a pose"):
        frame_record([1, 0, 0, 0], [0, 0, 5], None, None, accepted=True)


def test_wilson_agrees_with_published_values():
    # Brown, Cai & DasGupta (2001): n = 10, none seen: upper end 0.2775; and 50 of 100: 0.4038..0.5962
    low, high = wilson_interval(0, 10) or (9, 9)
    assert low == 0.0
    assert high == pytest.approx(0.2775, abs=5e-5)
    low, high = wilson_interval(50, 100) or (9, 9)
    assert [low, high] == pytest.approx([0.4038, 0.5962], abs=5e-5)
    assert wilson_interval(0, 0) is None


def record(range_m, deg, share, *, ok, feasible=True):
    E_T = None if share is None else share * range_m
    return FrameScore(
        range_m=range_m, E_T_m=E_T, e_t=share, E_R_deg=deg, accepted=ok, feasible=feasible, frame_class="x"
    )


RECORDS = [
    record(4.0, 0.1, 0.001, ok=True),  # fine
    record(4.0, 2.0, 0.02, ok=True),  # coarse
    record(10.0, 90.0, 0.01, ok=True),  # falsely accepted
    record(10.0, 1.0, 0.01, ok=False),  # right but declined
    record(10.0, None, None, ok=False),  # nothing found
    record(17.0, 120.0, 0.5, ok=True, feasible=False),  # infeasible and falsely accepted
]


def test_bootstrap_intervals_cover_the_truth_as_often_as_they_say():
    rng = np.random.default_rng(3)
    held = 0
    for _ in range(200):
        median, mean = bootstrap_intervals(rng.normal(4.0, 1.0, 40).tolist(), 400)
        assert median is not None
        assert mean is not None
        held += (median[0] < 4.0 < median[1]) + (mean[0] < 4.0 < mean[1])
        assert mean[1] - mean[0] == pytest.approx(4 * 1.96 / 2 / np.sqrt(40), rel=0.5)
    # 95 % of 400, less what percentile intervals of 40 values lose
    assert 360 < held < 395
    assert bootstrap_intervals([1.0, 2.0, 3.0]) == (None, None)
    assert bootstrap_intervals([1.0] * 6) == ((1.0, 1.0), (1.0, 1.0))


def test_shares_follow_their_definitions():
    m = summarise(RECORDS)
    assert (m.n, m.n_feasible, m.n_accepted) == (6, 5, 4)
    assert m.coarse_success == pytest.approx(3 / 5)
    assert m.fine_success == pytest.approx(1 / 5)
    assert m.coarse_accepted == pytest.approx(2 / 5)
    assert m.availability == pytest.approx(3 / 5)
    assert m.false_accept == pytest.approx(2 / 4)


def test_averages_are_over_accepted_and_over_all_feasible():
    m = summarise(RECORDS)
    assert m.median_E_R_deg == pytest.approx(46.0)  # of 0.1 2 90 120
    assert m.median_E_R_deg_all == pytest.approx(1.5)  # of 0.1 1 2 90
    assert m.mean_E_T_m == pytest.approx((0.004 + 0.08 + 0.1 + 8.5) / 4)
    assert m.mean_E_T_m_all == pytest.approx((0.004 + 0.08 + 0.1 + 0.1) / 4)


def test_speed_scores():
    m = summarise(RECORDS[:2])
    assert m.speed_score == pytest.approx((np.radians(2.1) + 0.021) / 2)
    # the first frame is below what the labels are good for
    assert m.speed_plus_score == pytest.approx((np.radians(2.0) + 0.02) / 2)


def test_range_bins_cover_every_frame_once():
    m = summarise(RECORDS)
    assert [(b.from_m, b.to_m, b.n) for b in m.by_range] == [(3, 6, 2), (9, 12, 3), (15, 18, 1)]
    assert sum(b.n for b in m.by_range) == m.n


def test_an_empty_set_has_no_figures():
    m = summarise([])
    assert m.n == 0
    assert m.coarse_success is None
    assert m.false_accept_wilson is None


def test_json_matches_the_schema_and_reads_back():
    m = compose([summarise(RECORDS, method="hybrid"), summarise(RECORDS[:2], method="svd-2018")])
    assert m.by_method["svd-2018"].n == 2
    assert m.n == len(RECORDS)
    text = msgspec.json.encode(m)
    jsonschema.validate(json.loads(text), msgspec.json.schema(Metrics))
    assert json.loads(text)["schema"] == "flyaround.metrics"
    assert json.loads(text)["version"] == 1
    assert msgspec.json.decode(text, type=Metrics) == m


def test_errors_along_the_camera_axes_carry_their_signs():
    # a turn of 30 deg about the camera's z on top of a turn about x: p = z30 x q
    q = np.array([np.cos(0.4), np.sin(0.4), 0, 0])
    z = np.array(about_z(30))
    p = [z[0] * q[0], z[0] * q[1], z[3] * q[1], z[3] * q[0]]
    r = frame_record(q, [1.0, 2.0, 8.0], [-v for v in p], [1.1, 1.8, 8.3], accepted=True)
    assert r.shift_camera_m == pytest.approx((0.1, -0.2, 0.3))
    assert r.turn_camera_deg == pytest.approx((0, 0, 30), abs=1e-9)
    m = summarise([r, r], failures=["edges"], times_ms=[10.0, 30.0])
    assert m.bias_m == pytest.approx((0.1, -0.2, 0.3))
    assert (m.time_ms_p50, m.failures) == (20.0, {"edges": 1})


def test_errors_drawn_from_a_covariance_are_chi_square_over_it():
    rng = np.random.default_rng(6)
    root = rng.normal(size=(6, 6)) * np.array([1e-3] * 3 + [1e-2] * 3)[:, None]
    covariance = root @ root.T
    records = []
    for error in rng.normal(size=(600, 6)) @ root.T:
        q = Rotation.random(random_state=rng).as_quat(scalar_first=True)
        turned = (Rotation.from_rotvec(error[:3]) * Rotation.from_quat(q, scalar_first=True)).as_quat(
            scalar_first=True
        )
        t = np.array([0.3, -0.2, 9.0])
        records.append(frame_record(q, t, turned, t + error[3:], accepted=True, covariance=covariance))
    figures = summarise(records, method="hybrid")
    # of six degrees of freedom: median 5.35, 95 % below 12.59
    assert figures.median_nees == pytest.approx(5.35, abs=0.5)
    assert figures.nees_inside_95 == pytest.approx(0.95, abs=0.025)
    flat = np.array([[6.0, 8, 5, 6, 6, 7], [4.0, 8, 5, 5, 2, 5]])  # its eigenvalues round to above zero
    for missing in (None, np.zeros((6, 6)), np.full((6, 6), np.nan), flat.T @ flat):
        assert frame_record(q, t, q, t, accepted=True, covariance=missing).nees is None


def test_poses_that_are_all_wrong_have_no_spread():
    scores = []
    for k in range(12):
        errors = [0.01 * np.sin(k + axis) for axis in range(6)]
        errors[k % 6] = 50.0
        scores.append(
            FrameScore(
                range_m=10.0,
                E_T_m=1.0,
                e_t=0.1,
                E_R_deg=1.0,
                accepted=True,
                feasible=True,
                shift_camera_m=tuple(errors[:3]),
                turn_camera_deg=tuple(errors[3:]),
            )
        )
    assert pose_spread(scores) is None
