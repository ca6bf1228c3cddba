"""A scene of a plan with the target at a pose of one's own."""

import numpy as np
import pytest

import flyaround as fa


@pytest.fixture(scope="module")
def plan():
    return fa.plan_flight(fa.load_scenario("tango-space-10m"), n=2)


def test_the_pose_is_the_one_given_and_the_rest_is_the_frames(plan):
    q, t = np.array([-0.3, 0.8, 0.4, -0.3]), (0.4, -0.2, 8.0)
    scene, own = fa.scene_at(plan, q, t, frame=1), plan.scene(1)
    assert scene.t_camera_from_target_m == t
    # normalised, and of the two signs of one attitude the one with w >= 0
    assert scene.q_camera_from_target_wxyz == pytest.approx(tuple(-q / np.linalg.norm(q)))
    for name in (
        "epoch_utc",
        "camera",
        "sensor",
        "exposure_s",
        "r_camera_eci_m",
        "q_camera_from_eci_wxyz",
        "seed",
    ):
        assert getattr(scene, name) == getattr(own, name)
    assert (scene.frame_index, fa.scene_at(plan, q, t, index=7).frame_index) == (1, 7)
    # the light is the frame's too: the Sun stays where it is
    assert scene.r_sun_eci_m == own.r_sun_eci_m


@pytest.mark.parametrize(
    ("q", "t", "says"),
    [
        ((3.0, 0.0, 0.0, 0.0), (0.0, 0.0, 9.0), "length is 3; it must be one"),
        ((1.0, 0.0, 0.0), (0.0, 0.0, 9.0), "a quaternion of four numbers"),
        ((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, np.nan), "a position of three"),
        ((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), "0 m away"),
    ],
)
def test_what_is_no_pose_is_said(plan, q, t, says):
    with pytest.raises(fa.UserError, match=says):
        fa.scene_at(plan, q, t)
