"""Hidden lines: geometry that can be done by hand."""

import numpy as np
import pytest
import trimesh

from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.geometry.mesh import TriangleMesh
from flyaround.simulator.labels.wireframe import view_edges
from flyaround.simulator.targets.joined_mesh import joined_mesh
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.targets.model import Edge
from flyaround.simulator.world.frames.pose import Pose

CAMERA = load_camera("speed")


class _Model:
    """A mesh and edges: all that view_edges reads of a target."""

    def __init__(self, edges):
        self.wireframe = edges


def _mesh(*solids):
    joined = trimesh.util.concatenate(solids)
    return TriangleMesh(np.asarray(joined.vertices, float), np.asarray(joined.faces, np.int64))


def _box(size, centre):
    solid = trimesh.creation.box(extents=size)
    solid.apply_translation(centre)
    return solid


def visible_share(view):
    return sum(b - a for a, b in view.intervals)


def test_a_bar_behind_a_plate_is_hidden_exactly_where_the_plate_is():
    # plate 1 m wide at z = 0, a line 2 m behind it: from 10 m away the plate's edges fall at x = +-0.5 * 12 / 10
    plate = _mesh(_box((1.0, 1.0, 1e-4), (0, 0, 0)))
    line = Edge(name="line", a_m=(-1.0, 0.1, 2.0), b_m=(1.0, 0.1, 2.0))
    pose = Pose.from_arrays("camera", "target", (1.0, 0, 0, 0), (0.0, 0.0, 10.0))
    (view,) = view_edges(CAMERA, pose, _Model([line]), plate)
    (left, right) = view.intervals
    # the plate's front face is at 10 m less half its thickness
    edge = 0.5 * 12.0 / (10.0 - 5e-5)
    assert left == pytest.approx((0.0, (1 - edge) / 2), abs=1e-9)
    assert right == pytest.approx(((1 + edge) / 2, 1.0), abs=1e-9)


def test_a_line_that_pierces_a_plate_is_hidden_behind_it():
    plate = _mesh(_box((4.0, 4.0, 1e-6), (0, 0, 0)))
    line = Edge(name="line", a_m=(-1.0, 0.0, -1.0), b_m=(1.0, 0.0, 1.0))
    pose = Pose.from_arrays("camera", "target", (1.0, 0, 0, 0), (0.0, 0.0, 10.0))
    (view,) = view_edges(CAMERA, pose, _Model([line]), plate)
    ((first, last),) = view.intervals
    assert first == 0.0
    # it dives at x = 0: on the screen the ends are at -1/9 and +1/11, so the share is (1/9) / (1/9 + 1/11); the
    # tolerance of 2 mm lets it show a little longer
    assert last == pytest.approx((1 / 9) / (1 / 9 + 1 / 11), abs=2e-3)
    assert last > (1 / 9) / (1 / 9 + 1 / 11)


def test_a_cube_from_its_corner_shows_nine_edges_and_from_a_face_four():
    cube = _box((1, 1, 1), (0, 0, 0))
    corners = [np.array(c) for c in np.ndindex(2, 2, 2)]
    edges = []
    for a in corners:
        for b in corners:
            if np.abs(a - b).sum() == 1 and tuple(a) < tuple(b):
                axis = int(np.argmax(np.abs(a - b)))
                normals = tuple(
                    tuple(float(v) for v in np.eye(3)[k] * (2 * a[k] - 1)) for k in range(3) if k != axis
                )
                edges.append(Edge(name="e", a_m=tuple(a - 0.5), b_m=tuple(b - 0.5), normals=normals))
    assert len(edges) == 12
    for q, shown in (((1.0, 0, 0, 0), 4), ((0.88, 0.28, 0.36, 0.12), 9)):
        views = view_edges(
            CAMERA, Pose.from_arrays("camera", "target", q, (0.0, 0.0, 8.0)), _Model(edges), _mesh(cube)
        )
        visible_intervals = [visible_share(v) for v in views]
        assert sum(s > 0.999 for s in visible_intervals) == shown
        assert sum(s < 0.001 for s in visible_intervals) == 12 - shown


@pytest.mark.parametrize("lean_deg", [90, 60, 45, 30, 15])
def test_a_rod_in_the_open_is_seen_whole_and_behind_a_plate_not_at_all(lean_deg):
    """Its edge is the axis, which the rod's own surface hides: the longer before it the more the rod leans."""
    radius = 0.03
    lean = trimesh.transformations.rotation_matrix(np.deg2rad(lean_deg), (1, 0, 0))
    way, outward = lean[:3, 2], -lean[:3, 1]  # along the rod, and across it towards the camera
    rod = trimesh.creation.cylinder(radius, 1.0, sections=24, transform=lean)
    axis = Edge(name="rod", a_m=tuple(-0.5 * way), b_m=tuple(0.5 * way), radius_m=radius)
    pose = Pose.from_arrays("camera", "target", (1.0, 0, 0, 0), (0.0, 0.0, 10.0))
    (view,) = view_edges(CAMERA, pose, _Model([axis]), _mesh(rod))
    assert visible_share(view) > 0.99
    assert view.length_px > 10
    # another body, beyond the rod's surface by as much as its radius
    plate = trimesh.creation.box((2.0, 1e-4, 2.0), transform=lean)
    plate.apply_translation(2 * radius * outward)
    (view,) = view_edges(CAMERA, pose, _Model([axis]), _mesh(rod, plate))
    assert visible_share(view) < 0.01


def test_nothing_is_seen_of_edges_behind_the_camera():
    target = load_target("tango")
    mesh = joined_mesh(target)
    assert (
        view_edges(CAMERA, Pose.from_arrays("camera", "target", (1.0, 0, 0, 0), (0, 0, -5.0)), target, mesh)
        == ()
    )


def test_lines_through_a_cloud_of_triangles_are_hidden_where_rays_are():
    rng = np.random.default_rng(7)
    middles = rng.uniform(-1, 1, (300, 1, 3)) * (1.0, 1.0, 0.5)
    corners = (middles + rng.normal(size=(300, 3, 3)) * rng.choice([0.02, 0.3], (300, 1, 1))).reshape(-1, 3)
    mesh = TriangleMesh(corners, np.arange(900).reshape(-1, 3))
    ends = rng.uniform(-1.2, 1.2, (40, 2, 3))
    ends[:4, :, 1] = ends[:4, :1, 1]  # some of them level
    lines = [Edge(name=str(k), a_m=tuple(a), b_m=tuple(b)) for k, (a, b) in enumerate(ends)]
    pose = Pose.from_arrays("camera", "target", (1.0, 0, 0, 0), (0.0, 0.0, 4.0))
    seen_of_all = 0.0
    for view, (a, b) in zip(view_edges(CAMERA, pose, _Model(lines), mesh), pose.apply(ends), strict=True):
        bounds = np.array(view.intervals).ravel()
        share = (np.arange(25) + 0.5) / 25
        # shares of the projection are shares of the line over depth
        along = share / b[2] / ((1 - share) / a[2] + share / b[2])
        point = a + along[:, None] * (b - a)
        first = _first_along(pose.apply(corners).reshape(-1, 3, 3), point)
        clear = np.abs(first - 1) * np.linalg.norm(point, axis=1) > 0.01
        clear &= np.abs(share[:, None] - bounds).min(axis=1, initial=1.0) > 1e-3
        shown = np.searchsorted(bounds, share) % 2 == 1
        assert np.array_equal(shown[clear], (first > 1)[clear])
        seen_of_all += shown.mean() / len(lines)
    assert 0.1 < seen_of_all < 0.9


def _first_along(corners, points):
    """Where rays from the origin through points (K, 3) first meet triangles (M, 3, 3), in lengths of the points."""
    a, e1, e2 = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    matrix = np.stack([np.broadcast_to(p, a.shape) for p in points])  # each ray against each triangle
    system = np.stack(
        [matrix, np.broadcast_to(-e1, matrix.shape), np.broadcast_to(-e2, matrix.shape)], axis=-1
    )
    at, u, v = np.moveaxis(
        np.linalg.solve(system, np.broadcast_to(a, matrix.shape)[..., None])[..., 0], -1, 0
    )
    met = (u >= 0) & (v >= 0) & (u + v <= 1) & (at > 0)
    return np.where(met, at, np.inf).min(axis=1)
