"""Frames as the host draws them in its other processes."""

import numpy as np
import pytest

from hil.host.stream import stream_frames
from simulator.loop import plan_flight
from simulator.scenario_load import load_scenario

pytestmark = pytest.mark.gl


def test_a_streamed_frame_has_its_image_camera_and_truth():
    plan = plan_flight(load_scenario("tango-space-10m"), n=2)
    frame = next(iter(stream_frames(plan)))
    assert frame.image.shape == (plan.camera.height_px, plan.camera.width_px)
    assert frame.image.std() > 1
    t = frame.truth["t_camera_from_target_m"]
    assert np.linalg.norm(t) == pytest.approx(10, abs=0.5)
    assert frame.camera["fx_px"] == plan.camera.fx_px


def test_two_workers_stream_what_one_does_in_order():
    plan = plan_flight(load_scenario("tango-space-10m"), n=3)
    one, two = (list(stream_frames(plan, workers=workers)) for workers in (1, 2))
    assert [frame.frame_id for frame in two] == [0, 1, 2]
    for ours, theirs in zip(one, two, strict=True):
        assert ours.truth == theirs.truth
        assert np.array_equal(ours.image, theirs.image)
