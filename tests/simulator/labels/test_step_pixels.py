"""Which pixels a keypoint's contrast and an edge's step are looked for in: not one more, not one less, both sides."""

import numpy as np
import pytest

from flyaround.simulator.labels.feasible import wireframe_step_share
from flyaround.simulator.labels.keypoints import label_keypoints
from flyaround.simulator.labels.wireframe import ProjectedEdge
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.targets.joined_mesh import mesh_of
from flyaround.simulator.targets.model import Edge

RADIUS_PX, REACH_PX = 2, 2.0  # as labels have them, and not taken from there
GREY, BRIGHT = 0.3, 0.6


@pytest.fixture(scope="module")
def plan():
    return plan_flight(load_scenario("tango-space-10m"), n=1)


@pytest.fixture(scope="module")
def seen(plan):
    """A keypoint that the picture alone decides on, and its label's pixel, rounded up one way at least."""
    scene = plan.scene(0)
    camera = scene.camera
    # alternate pixels: contrast everywhere
    chequered = np.indices((camera.height_px, camera.width_px)).sum(axis=0) % 2
    labels = label_keypoints(scene, plan.target, mesh_of(plan.target), chequered.astype(np.float32))
    visible = [k for k, label in enumerate(labels) if label.state == "visible"]
    # where cutting the fraction off would take another pixel
    rounded_up = [k for k in visible if any(x % 1 >= 0.5 for x in labels[k].pixel_px)]
    return rounded_up[0], np.rint(labels[rounded_up[0]].pixel_px).astype(int)


def state_with(plan, seen, pixels):
    """State of the keypoint where some pixels are brighter than a grey picture."""
    scene, (k, _) = plan.scene(0), seen
    signal = np.full((scene.camera.height_px, scene.camera.width_px), GREY, np.float32)
    for u, v in pixels:
        signal[v, u] = BRIGHT
    return label_keypoints(scene, plan.target, mesh_of(plan.target), signal)[k].state


@pytest.mark.parametrize("way", [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, -1)])
def test_a_keypoints_contrast_is_that_of_two_pixels_each_way(plan, seen, way):
    _, centre = seen
    farthest, beyond = (centre + np.array(way) * r for r in (RADIUS_PX, RADIUS_PX + 1))
    assert state_with(plan, seen, [farthest]) == "visible"
    assert state_with(plan, seen, [beyond]) == "below_noise"


def step_share(plan, step_at_px, normal):
    """Share of an edge's length with a step, in a picture that is bright beyond a distance from it along its normal."""
    scene = plan.scene(0)
    camera = scene.camera
    middle = np.array([camera.width_px // 2, camera.height_px // 2], float)
    along = np.array([normal[1], -normal[0]], float)
    ends = np.array([middle - 100 * along, middle + 100 * along])
    edge = Edge(name="e", a_m=(0.0, 0.0, 0.0), b_m=(1.0, 0.0, 0.0))
    view = ProjectedEdge(edge, ends, np.ones(2), ((0.0, 1.0),))
    v, u = np.indices((camera.height_px, camera.width_px))
    distance = (u - middle[0]) * normal[0] + (v - middle[1]) * normal[1]
    signal = np.where(distance > step_at_px, BRIGHT, GREY).astype(np.float32)
    return wireframe_step_share(scene, [view], signal, GREY)


@pytest.mark.parametrize("normal", [(0.0, 1.0), (1.0, 0.0)])
@pytest.mark.parametrize(
    ("step_at_px", "share"),
    [
        # a pixel to either side: a look to one side alone misses one of them
        (-0.5, 1.0),
        (0.5, 1.0),
        (REACH_PX - 0.5, 1.0),
        (-REACH_PX + 0.5, 1.0),
        (REACH_PX + 0.5, 0.0),
        (-REACH_PX - 0.5, 0.0),
    ],
)
def test_an_edges_step_is_looked_for_on_both_sides(plan, step_at_px, share, normal):
    assert step_share(plan, step_at_px, normal) == share
