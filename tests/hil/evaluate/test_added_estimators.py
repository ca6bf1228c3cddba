"""Estimators of plug-in packages: an answer that is no pose is declined."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.evaluate.added_estimators import AddedEstimator

NAN, INF = math.nan, math.inf
UNIT, AHEAD = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 5.0)


@pytest.mark.parametrize(
    ("q", "t", "confidence", "says"),
    [
        ((NAN, 0, 0, 0), AHEAD, 0.9, "not finite"),
        ((2, 0, 0, 0), AHEAD, 0.9, "not a unit quaternion"),
        (UNIT, (0, 0, INF), 0.9, "not finite"),
        (UNIT, (0, 5), 0.9, "four and three numbers"),
        ("east", AHEAD, 0.9, "numbers"),
        (None, None, 0.9, "four and three numbers"),
        (UNIT, AHEAD, 7.0, "confidence of 7"),
    ],
)
def test_a_plug_ins_estimate_that_is_no_pose_is_declined(tango, q, t, confidence, says):
    estimate = SimpleNamespace(
        accepted=True, reason="", q_camera_from_target_wxyz=q, t_camera_from_target_m=t, confidence=confidence
    )
    intrinsics = CameraIntrinsics(640, 480, 500.0, 500.0, 319.5, 239.5)
    estimator = AddedEstimator("mine", SimpleNamespace(estimate=lambda _: estimate), tango, intrinsics)
    image = np.random.default_rng(0).integers(0, 255, (480, 640), np.uint8)
    result = estimator.estimate(image)
    assert not result.accepted
    assert says in result.reason
    assert result.q_camera_from_target_wxyz is None
