"""Every state of a keypoint, drawn, right by the check, and caught when another one is written in its place."""

import typing
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from small_flight import small_flight

from flyaround.simulator.dataset.check.verify import check_frame
from flyaround.simulator.frame import take_frame
from flyaround.simulator.labels.request import LabelRequest
from flyaround.simulator.labels.truth import KeypointState
from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.world.ephemeris.eclipse import sun_fraction_past_bodies
from tools.validation.labels.report import dataset_card

pytestmark = pytest.mark.gl

STATES = typing.get_args(KeypointState)


def _in_eclipse(scene):
    """The Sun on the other side of the Earth."""
    away = -np.asarray(scene.r_target_eci_m)
    sun = away / np.linalg.norm(away) * np.linalg.norm(scene.r_sun_eci_m)
    share = sun_fraction_past_bodies(scene.bodies, scene.r_target_eci_m, sun)
    return replace(scene, r_sun_eci_m=vec3(sun), sun_visible_fraction=share)


@pytest.fixture(scope="module")
def frames(renderer):
    """The craft as it is, under- and over-exposed, and in the Earth's shadow; cropped by the image's edge."""
    plan = small_flight(256, times=(20.0,))
    camera = plan.camera
    plan = replace(plan, camera=replace(camera, fx_px=2 * camera.fx_px, fy_px=2 * camera.fy_px, cx_px=40.0))
    scene = plan.scene(0)
    scenes = (
        scene,
        replace(scene, exposure_s=scene.exposure_s * 300),
        replace(scene, exposure_s=scene.exposure_s / 300),
        _in_eclipse(scene),
    )
    request = LabelRequest(layers=("clean",))
    return [(take_frame(renderer, s, plan.target, labels=request), plan.target) for s in scenes]


def _faults(renderer, frame, target, truth):
    card = dataset_card(renderer, frame, truth.seed)
    return check_frame(0, truth, frame.image, frame.mask, card, target, frame.layers)


@pytest.mark.parametrize("state", STATES)
def test_each_state_is_drawn_and_every_other_one_in_its_place_is_caught(renderer, frames, state):
    frame, target, which = next(
        (frame, target, k)
        for frame, target in frames
        for k, point in enumerate(frame.truth.keypoints)
        if point.state == state
    )
    assert _faults(renderer, frame, target, frame.truth) == []
    for other in STATES:
        if (state, other) == ("saturated", "below_noise"):
            continue  # what lies half a digital number below full scale reads as full: the twin cannot tell
        points = list(frame.truth.keypoints)
        points[which] = msgspec.structs.replace(points[which], state=other)
        truth = msgspec.structs.replace(frame.truth, keypoints=tuple(points))
        faults = _faults(renderer, frame, target, truth)
        assert (other == state) == (faults == []), f"{points[which].name} called {other} passes"
        assert all(points[which].name in fault for fault in faults)
