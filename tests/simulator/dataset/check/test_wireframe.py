"""The wireframe's check against labels that are right, and against one planted fault at a time."""

from types import SimpleNamespace

import numpy as np
import pytest
from msgspec.structs import replace

from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.dataset.check.wireframe import check_wireframe
from flyaround.simulator.labels.truth import WireLabel
from flyaround.simulator.labels.wireframe import view_edges
from flyaround.simulator.targets.joined_mesh import joined_mesh
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.frames.pose import Pose

CAMERA = load_camera("speed")
TANGO = load_target("tango")


def label(q_wxyz, t_m=(0.0, 0.0, 7.0), target=TANGO):
    """What a record says of the wireframe: all that the check reads of one."""
    pose = Pose.from_arrays("camera", "target", q_wxyz, t_m)
    wires = tuple(
        WireLabel(name=v.edge.name, ends_px=tuple(map(tuple, v.ends_px.tolist())), visible=v.intervals)
        for v in view_edges(CAMERA, pose, target, joined_mesh(target))
    )
    return SimpleNamespace(
        layers=("wireframe",),
        wireframe=wires,
        camera=CAMERA,
        q_camera_from_target_wxyz=pose.q_wxyz,
        t_camera_from_target_m=t_m,
        seed=1,
        frame_index=0,
    )


def changed(truth, names, visible):
    wires = tuple(replace(w, visible=visible) if w.name in names else w for w in truth.wireframe)
    return SimpleNamespace(**{**vars(truth), "wireframe": wires})


def poses(n):
    q = np.random.default_rng(3).standard_normal((n, 4))
    return [tuple(row) for row in (q / np.linalg.norm(q, axis=1, keepdims=True)).tolist()]


def seen_share(truth, name):
    (wire,) = (w for w in truth.wireframe if w.name == name)
    return sum(b - a for a, b in wire.visible)


@pytest.mark.parametrize("q_wxyz", poses(12))
def test_what_the_labels_say_is_what_rays_say(q_wxyz):
    assert check_wireframe(label(q_wxyz), TANGO) == []


def test_a_rod_that_is_hidden_by_itself_alone_is_found():
    """What a ray meets before the axis of a rod in the open is the rod's surface: a label that hides it is wrong."""
    named = [e.name for e in TANGO.wireframe if e.radius_m > 0.02]
    assert len(named) == 3
    found = 0
    for q_wxyz in poses(12):
        truth = label(q_wxyz)
        clear = [n for n in named if seen_share(truth, n) > 0.95 and length_px(truth, n) > 30]
        wrong = check_wireframe(changed(truth, clear, ()), TANGO)
        assert len(wrong) == len(clear)
        assert all(any(f"edge {n} is hidden" in text for text in wrong) for n in clear)
        found += len(clear)
    assert found >= 8


def length_px(truth, name):
    (wire,) = (w for w in truth.wireframe if w.name == name)
    return float(np.hypot(*np.subtract(*wire.ends_px)))


def test_a_rod_behind_the_body_that_is_said_to_be_seen_is_found():
    named = [e.name for e in TANGO.wireframe if e.radius_m > 0.02]
    found = 0
    for q_wxyz in poses(40):
        truth = label(q_wxyz)
        behind = [n for n in named if seen_share(truth, n) == 0 and length_px(truth, n) > 30]
        if behind:
            wrong = check_wireframe(changed(truth, behind, ((0.0, 1.0),)), TANGO)
            found += sum(f"edge {n} is seen" in text for n in behind for text in wrong)
    assert found >= 3


def test_rods_are_asked_about_however_many_other_edges_there_are():
    """The check asks about a limited number of stretches: rods, at the end of Tango's list, are among them."""
    truth = label((1.0, 0.0, 0.0, 0.0))
    names = [w.name for w in truth.wireframe]
    assert len(names) > 60
    late = names.index("antenna_1")
    assert check_wireframe(changed(truth, [names[late]], ((0.0, 0.01),)), TANGO)
