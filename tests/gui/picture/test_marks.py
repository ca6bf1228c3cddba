"""The truth overlay: its marks are where the labels say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flyaround.gui.picture.truth_overlay import AXIS_M, Marker
from flyaround.gui.picture.view_settings import Overlays
from flyaround.simulator.labels.keypoints import label_keypoints
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scene.state import SceneState
from flyaround.simulator.targets.joined_mesh import joined_mesh
from flyaround.simulator.world.frames.rotation import quat_from_rotvec, quat_multiply

ALL = Overlays(keypoints=True, box=True, axes=True, wireframe=True)


@pytest.fixture
def session() -> FlightSession:
    return FlightSession.of(load_scenario("tango-flyaround"))


def turned(scene: SceneState, degrees: float) -> SceneState:
    q = quat_multiply(quat_from_rotvec([0.0, np.radians(degrees), 0.0]), scene.q_camera_from_target_wxyz)
    return replace(scene, q_camera_from_target_wxyz=tuple(float(x) for x in q))


def test_keypoints_agree_with_the_labels(session: FlightSession) -> None:
    scene, target = session.scene(), session.plan.target
    # a checkerboard has contrast everywhere: only geometry decides the labels
    rows, columns = np.indices((scene.camera.height_px, scene.camera.width_px))
    signal = ((rows + columns) % 2 * 0.9).astype(np.float32)
    labels = {k.name: k for k in label_keypoints(scene, target, joined_mesh(target), signal)}
    marks = Marker(target).marks(scene, ALL)
    assert {seen for _, seen, _ in marks.keypoints} >= {"visible", "hidden"}
    states = {"self_occluded": "hidden", "shadowed": "shadowed", "visible": "visible"}
    for pixel, seen, name in marks.keypoints:
        assert states[labels[name].state] == seen, name
        np.testing.assert_allclose(pixel, labels[name].pixel_px, atol=1e-9)


def test_all_marks_lie_in_the_box_of_the_target(session: FlightSession) -> None:
    marks = Marker(session.plan.target).marks(session.scene(), ALL)
    assert marks.box is not None
    x0, y0, x1, y1 = marks.box
    ends = np.array([p for segment in marks.wireframe for p in segment] + [p for p, _, _ in marks.keypoints])
    assert len(marks.wireframe) > 12
    assert np.all(ends >= np.array([x0, y0]) - 1.0)
    assert np.all(ends <= np.array([x1, y1]) + 1.0)


def test_axes_are_half_a_metre_long_and_start_at_the_model_origin(session: FlightSession) -> None:
    scene = session.scene()
    marks = Marker(session.plan.target).marks(scene, ALL)
    origin = scene.camera.project(np.array(scene.t_camera_from_target_m))
    tip = scene.camera.project(scene.camera_from_target.apply(np.array([0.0, AXIS_M, 0.0])))
    np.testing.assert_allclose(marks.axes[1], (origin, tip))


def test_nothing_is_made_that_nobody_asked_for(session: FlightSession) -> None:
    marks = Marker(session.plan.target).marks(session.scene(), Overlays())
    assert (marks.keypoints, marks.box, marks.axes, marks.wireframe) == ((), None, (), ())


def test_visibility_is_asked_again_when_the_view_has_turned(session: FlightSession) -> None:
    scene = session.scene()
    marker = Marker(session.plan.target)
    first = [seen for _, seen, _ in marker.marks(scene, ALL).keypoints]
    behind = turned(scene, 180.0)
    after = [seen for _, seen, _ in marker.marks(behind, ALL).keypoints]
    assert after == [seen for _, seen, _ in Marker(session.plan.target).marks(behind, ALL).keypoints]
    assert after != first


def test_a_target_behind_the_camera_has_no_marks(session: FlightSession) -> None:
    scene = replace(session.scene(), t_camera_from_target_m=(0.0, 0.0, -9.0))
    marks = Marker(session.plan.target).marks(scene, ALL)
    assert (marks.keypoints, marks.box, marks.axes, marks.wireframe) == ((), None, (), ())
