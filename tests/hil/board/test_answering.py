"""The answer to one image: what an estimator returns, as a POSE message or as a decline that says why."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from flyaround.hil.board.answering import FrameContext, estimated_pose

IMAGE = np.zeros((4, 5), np.uint8)


def answer(**changes):
    result = {
        "accepted": True,
        "reason": "",
        "q_camera_from_target_wxyz": (1.0, 0.0, 0.0, 0.0),
        "t_camera_from_target_m": (0.0, 0.0, 5.0),
        "confidence": 0.5,
        "stages_ms": {"edges": 1.0},
    }
    estimator = SimpleNamespace(estimate=lambda _image: SimpleNamespace(**(result | changes)))
    return estimated_pose(estimator, IMAGE, FrameContext(1, 0.0, 5, 6, takes_fields=True))


def test_a_covariance_is_sent_row_by_row():
    covariance = np.arange(36.0).reshape(6, 6)
    pose = answer(covariance=covariance)
    assert pose.accepted
    assert pose.covariance == tuple(covariance[i, k] for i in range(6) for k in range(i, 6))


def test_a_translation_of_opencv_is_a_column():
    assert answer(t_camera_from_target_m=np.array([[0.0], [0.0], [5.0]])).t_camera_from_target_m == (
        0.0,
        0.0,
        5.0,
    )


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e35])
def test_a_pose_goes_without_a_covariance_that_cannot_be_sent(value):
    pose = answer(covariance=np.full((6, 6), value))
    assert pose.accepted
    assert pose.covariance is None


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"covariance": np.eye(3)}, r"the covariance has shape \(3, 3\), not \(6, 6\)"),
        ({"covariance": np.eye(7)}, r"the covariance has shape \(7, 7\), not \(6, 6\)"),
        ({"covariance": -np.eye(6)}, "negative variance"),
        ({"q_camera_from_target_wxyz": (1.0, 0.0, 0.0)}, r"the quaternion has shape \(3,\), not \(4,\)"),
        ({"t_camera_from_target_m": (1.0, 2.0)}, r"the position has shape \(2,\), not \(3,\)"),
        ({"confidence": 5.0}, "must be 0 to 1"),
        ({"q_camera_from_target_wxyz": (2.0, 0.0, 0.0, 0.0)}, "has length 2"),
    ],
)
def test_a_result_that_breaks_the_contract_is_declined_with_the_reason(changes, reason):
    pose = answer(**changes)
    assert not pose.accepted
    assert pose.reason.startswith("the estimator failed: ")
    assert re.search(reason, pose.reason)
