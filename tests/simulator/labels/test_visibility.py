"""Visibility of points by projection, against geometry that can be done by hand and against ray casting."""

from dataclasses import replace
from functools import lru_cache
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.geometry.mesh import TriangleMesh
from flyaround.simulator.labels.keypoints import geometric_states
from flyaround.simulator.labels.visibility import hidden_from_direction, occluded_from_camera
from flyaround.simulator.labels.wireframe import view_edges
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.targets.joined_mesh import join_parts, joined_mesh
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.targets.model import Part
from flyaround.simulator.world.frames.pose import Pose

CUBE = trimesh.creation.box(extents=(1, 1, 1))
MESH = TriangleMesh(np.asarray(CUBE.vertices, float), np.asarray(CUBE.faces, np.int64))
CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def test_cube_seen_along_its_axis_shows_four_corners():
    hidden = occluded_from_camera(
        MESH, CORNERS, Pose.from_arrays("camera", "target", (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 5.0))
    )
    # perspective: the far face's corners project inside the near face
    assert np.array_equal(hidden, CORNERS[:, 2] > 0)


def test_sun_behind_a_face_shadows_its_centre():
    centres = np.array([[0, 0, 0.5], [0, 0, -0.5], [0.5, 0, 0]])
    sun = np.array([0.1, 0.2, 1.0]) / np.linalg.norm([0.1, 0.2, 1.0])
    assert hidden_from_direction(MESH, centres, sun).tolist() == [False, True, False]


@pytest.mark.parametrize("end_m", [0.5, 1e-3, 0.0, -3.0, -40.0])
def test_a_bar_that_reaches_past_the_camera_hides_what_lies_behind_its_part_before_it(end_m):
    """Two long triangles, 0.2 m wide, from 2 m before the camera to beside or behind it, and out to its right."""
    far, near = np.array([0.0, 0.0, 2.0]), np.array([0.4 * (2 - end_m) / 2, 0.0, end_m])
    up = np.array([0.0, 0.1, 0.0])
    corners = np.array([far - up, near - up, near + up, far + up])
    bar = TriangleMesh(corners - (0, 0, 5), np.array([[0, 1, 2], [0, 2, 3]]))
    # behind the bar at z = 1, where it is at x = 0.2, and beside it
    points = np.array([[0.2, 0.0, 1.0], [0.2, 0.08, 1.0], [0.2, 0.12, 1.0], [-0.1, 0.0, 1.0]]) * 1.5
    camera = Pose.from_arrays("camera", "target", (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 5.0))
    assert occluded_from_camera(bar, points - (0, 0, 5), camera).tolist() == [True, True, False, False]


@pytest.mark.parametrize(("sunlight", "share"), [(True, 1.0), (True, 0.0), (False, 1.0), (False, 0.0)])
def test_keypoints_without_sunlight_are_eclipsed_whatever_takes_it(sunlight, share):
    """The Earth, or the environment's switch; those in sight alone."""
    plan = plan_flight(load_scenario("tango-space-10m"), n=1)
    scene = plan.scene(0)
    environment = msgspec.structs.replace(scene.environment, sunlight=sunlight)
    scene = replace(scene, environment=environment, sun_visible_fraction=share)
    states = geometric_states(scene, plan.target, joined_mesh(plan.target))
    in_sight = {state for state in states if state not in {"out_of_frame", "self_occluded"}}
    assert in_sight
    assert ("eclipsed" in in_sight) == (not sunlight or share == 0.0)
    assert in_sight <= {None, "shadowed"} or in_sight == {"eclipsed"}


class _Wires:
    """Edges: all that view_edges reads of a target."""

    def __init__(self, edges):
        self.wireframe = edges


def _with_a_sheet(normal_z):
    """A closed cube and before it (at z = -1) an open sheet of 1 m that looks along ``normal_z``."""
    cube = Part(
        name="cube",
        material="",
        positions_m=np.asarray(CUBE.vertices, np.float32),
        normals=np.zeros((8, 3), np.float32),
        triangles=np.asarray(CUBE.faces, np.int64),
    )
    square = np.array([[-0.5, -0.5, -1], [0.5, -0.5, -1], [0.5, 0.5, -1], [-0.5, 0.5, -1]], np.float32)
    turn = [[0, 1, 2], [0, 2, 3]] if normal_z > 0 else [[0, 2, 1], [0, 3, 2]]
    sheet = Part(
        name="sheet",
        material="",
        positions_m=square,
        normals=np.tile(np.float32([0, 0, normal_z]), (4, 1)),
        triangles=np.array(turn, np.int64),
    )
    return join_parts((cube, sheet))


@pytest.mark.parametrize("normal_z", [1, -1])
def test_an_open_sheet_hides_what_is_behind_it_whichever_way_it_looks(normal_z):
    """Only of closed shells may what looks away be left out: a sheet has no other side that would hide the point."""
    mesh = _with_a_sheet(normal_z)
    assert mesh.in_shell.tolist() == [True] * 12 + [False] * 2
    points = np.array([[0.0, 0.0, -0.5], [0.1, -0.2, -0.5]])
    pose = Pose.from_arrays("camera", "target", (1.0, 0, 0, 0), (0, 0, 6.0))
    assert occluded_from_camera(mesh, points, pose).all()
    assert hidden_from_direction(mesh, points, (0.0, 0.0, -1.0)).all()
    assert not hidden_from_direction(mesh, points, (0.8, 0.0, -0.6)).any()
    line = SimpleNamespace(a_m=(-0.4, 0.1, -0.5), b_m=(0.4, 0.1, -0.5), normals=(), radius_m=0.0)
    (view,) = view_edges(load_camera("speed"), pose, _Wires([line]), mesh)
    assert view.intervals == ()


@lru_cache(maxsize=1)
def _tango():
    """The model, its mesh, and a ray caster of it, whose tree takes longer to make than to use."""
    target = load_target("tango")
    mesh = joined_mesh(target)
    solid = trimesh.Trimesh(mesh.positions_m, mesh.triangles, process=False)
    return target, mesh, trimesh.ray.ray_triangle.RayMeshIntersector(solid)


@settings(max_examples=25, deadline=None)
@given(
    q=st.tuples(*[st.floats(-1, 1) for _ in range(4)]).filter(lambda q: np.linalg.norm(q) > 0.1),
    z=st.floats(3, 18),
)
def test_agrees_with_independent_ray_casting_on_tango(q, z):
    target, mesh, caster = _tango()
    pose = Pose.from_arrays("camera", "target", q, (0.1, -0.2, z))
    R, t = pose.R, np.asarray(pose.t_m)
    points = np.array([k.position_m for k in target.keypoints])
    ours = occluded_from_camera(mesh, points, pose)
    eye = -R.T @ t
    rays = eye - points
    length = np.linalg.norm(rays, axis=1)
    theirs = np.zeros(len(points), bool)
    directions = rays / length[:, None]
    where, which, _ = caster.intersects_location(points + 1e-4 * directions, directions, multiple_hits=True)
    for k in range(len(points)):
        along = np.linalg.norm(where[which == k] - points[k], axis=1)
        # between 1.5 and 2.5 mm the tolerance decides: such hits may go either way
        theirs[k] = bool(np.any(along > 2.5e-3))
        if np.any((along > 1.5e-3) & (along <= 2.5e-3)):
            theirs[k] = ours[k]
    assert np.mean(ours == theirs) >= 0.9  # rays that graze an edge may differ by rounding
