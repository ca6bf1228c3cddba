"""The loop: every frame to every sink, along a plan or one at a time, here or in another process, always the same."""

from dataclasses import replace

import numpy as np
import pytest

from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.errors import UserError
from flyaround.simulator.frame import Frame
from flyaround.simulator.labels.request import LabelRequest
from flyaround.simulator.loop import FrameRequest, open_frames, run_frames, whole_frame
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.scenario.poses import PosePlan
from flyaround.simulator.world.frames.pose import Pose

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module")
def plan():
    plan = plan_flight(load_scenario("tango-space-10m"), n=3, quality="draft")
    small = Camera(width_px=160, height_px=120, fx_px=250.0, fy_px=250.0, cx_px=79.5, cy_px=59.5)
    return replace(plan, camera=small)


class Kept:
    """A sink that remembers."""

    def __init__(self):
        self.frames: list[Frame] = []

    def write(self, frame):
        self.frames.append(frame)


def number_and_mean(frame):
    """A stage: what leaves the process of each frame."""
    return frame.number, float(frame.image.mean())


def fail(_frame):
    raise UserError("the disk is full")


def test_every_sink_is_given_every_frame_in_order(renderer, plan):
    sinks = [Kept(), Kept()]
    yielded = list(run_frames(plan, renderer, sinks))
    assert [frame.number for frame in yielded] == [0, 1, 2]
    for sink in sinks:
        assert all(a is b for a, b in zip(sink.frames, yielded, strict=True))
    assert all(frame.truth is not None and frame.truth.frame_index == frame.number for frame in yielded)


def test_chosen_frames_with_labels_by_number(renderer, plan):
    labels = {0: LabelRequest(layers=("depth",)), 2: LabelRequest(layers=("parts",))}
    frames = list(run_frames(plan, renderer, labels=labels.__getitem__, numbers=(0, 2)))
    assert [(frame.number, *frame.layers) for frame in frames] == [(0, "depth"), (2, "parts")]


def test_a_frame_is_the_same_wherever_it_is_drawn(renderer, plan):
    here = list(run_frames(plan, renderer))
    with open_frames(Frame.image_and_truth, processes=2, first=plan.scene(0)) as producer:
        elsewhere = list(run_frames(plan, producer))
        for ours, theirs in zip(here, elsewhere, strict=True):
            assert ours.image.dtype == theirs.image.dtype
            assert np.array_equal(ours.image, theirs.image)
            assert ours.truth == theirs.truth
        assert elsewhere[0].mask is None
        assert elsewhere[0].radiance.size == 0
        # and one at a time, from whatever the newest state is: as many as there is room for
        for k in (2, 0, 1, 2):
            assert producer.submit(FrameRequest(scene=plan.scene(k)))
        assert not producer.submit(FrameRequest(scene=plan.scene(1)))
        assert [producer.result().number for _ in range(4)] == [2, 0, 1, 2]
        with pytest.raises(RuntimeError, match="no job"):
            producer.result()


def test_what_is_made_where_a_frame_is_drawn_is_what_sinks_get(plan):
    with open_frames(number_and_mean, processes=1, first=plan.scene(0)) as producer:
        elsewhere = list(run_frames(plan, producer, labels=False))
    with open_frames(number_and_mean, first=plan.scene(0)) as producer:
        assert producer.info.renderer
        assert list(run_frames(plan, producer, labels=False)) == elsewhere
    assert [number for number, _ in elsewhere] == [0, 1, 2]


def test_here_nothing_is_drawn_before_it_is_collected(plan):
    with open_frames(whole_frame, first=plan.scene(0)) as producer:
        asked = []

        def requests():
            for k in range(3):
                asked.append(k)
                yield FrameRequest(scene=plan.scene(k), labels=False)

        frames = producer.frames(requests())
        assert next(frames).number == 0
        # the next moment is asked for once this frame is there: a closed loop may decide by it
        assert asked == [0]
        frames.close()
        assert producer.submit(FrameRequest(scene=plan.scene(1), labels=False))
        assert not producer.submit(FrameRequest(scene=plan.scene(2), labels=False))
        assert [frame.number for frame in producer.finished()] == [1]


def test_a_stage_that_fails_is_the_callers_to_hear_of(plan):
    for processes in (0, 1):
        with open_frames(fail, processes=processes) as producer, pytest.raises(UserError, match="disk"):
            list(run_frames(plan, producer, labels=False))


def test_a_run_that_was_broken_off_is_not_taken_for_the_next(plan):
    with open_frames(number_and_mean, processes=1) as producer:
        next(run_frames(plan, producer, labels=False))
        with pytest.raises(RuntimeError, match="interrupted run"):
            next(run_frames(plan, producer, labels=False))


def test_poses_are_a_plan(renderer, plan):
    poses = tuple(
        Pose.from_arrays("camera", "target", (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, z)) for z in (8.0, 16.0)
    )
    near, far = run_frames(PosePlan(plan.scene(0), plan.target, poses), renderer)
    assert near.truth.t_camera_from_target_m == (0.0, 0.0, 8.0)
    assert (near.mask > 0).sum() > 2 * (far.mask > 0).sum() > 0
