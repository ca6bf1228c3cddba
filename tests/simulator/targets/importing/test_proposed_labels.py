"""Proposed labels of imported meshes: outlines of bodies, visible edges, rods."""

import cv2
import numpy as np
import pytest
import trimesh

from flyaround.simulator.geometry.directions import sphere_directions
from flyaround.simulator.targets.importing.add import import_mesh

SIZE = 192


def craft():
    """A box under a thin panel of many tiles with hair-fine grooves, an antenna, a ring that closes round nothing."""
    tiles = [
        trimesh.creation.box((0.098, 0.098, 0.01), trimesh.transformations.translation_matrix((x, y, 0.325)))
        for x in np.arange(-4.5, 5) * 0.1
        for y in np.arange(-3.5, 4) * 0.1
    ]
    board = trimesh.creation.box((1.1, 0.9, 0.02), trimesh.transformations.translation_matrix((0, 0, 0.312)))
    bus = trimesh.creation.box((0.5, 0.5, 0.6))
    antenna = trimesh.creation.cylinder(0.02, segment=((0.2, 0.25, 0.0), (0.5, 0.7, -0.1)), sections=24)
    ring = trimesh.creation.annulus(0.16, 0.2, 0.05)
    ring.apply_translation((0, 0, -0.33))
    return trimesh.util.concatenate([bus, board, antenna, ring, *tiles])


@pytest.fixture(scope="module")
def target(tmp_path_factory):
    path = tmp_path_factory.mktemp("mesh") / "craft.stl"
    craft().export(path)
    return import_mesh(path, "craft")[0]


def silhouette(points, triangles, direction, center, radius):
    helper = np.eye(3)[int(np.argmin(np.abs(direction)))]
    x = np.cross(helper, direction)
    x /= np.linalg.norm(x)
    axes = np.stack([x, np.cross(direction, x)])
    pixels = (((points - center) @ axes.T) / radius * 0.95 + 1) * (SIZE - 1) / 2
    image = np.zeros((SIZE, SIZE), np.uint8)
    for corners in np.rint(pixels[triangles] * 16).astype(np.int32):
        cv2.fillConvexPoly(image, corners, 1, shift=4)
    return image > 0


def test_occluders_have_the_outline_of_the_craft(target):
    mesh = craft()
    center, radius = mesh.bounds.mean(axis=0), float(np.linalg.norm(np.ptp(mesh.bounds, axis=0))) / 2
    assert 12 <= len(target.occluders.triangles) <= 600
    for direction in sphere_directions(9):
        own = silhouette(mesh.vertices, mesh.faces, direction, center, radius)
        body = silhouette(target.occluders.vertices_m, target.occluders.triangles, direction, center, radius)
        assert (own & ~body).sum() < 0.06 * own.sum()
        assert (body & ~own).sum() < 0.06 * own.sum()


def test_wireframe_has_what_shows_and_leaves_out_what_does_not(target):
    rods = [e for e in target.wireframe if e.radius_m > 0]
    assert len(rods) == 1
    assert rods[0].radius_m == pytest.approx(0.02, rel=0.05)
    ends = np.sort([rods[0].a_m, rods[0].b_m], axis=0)
    assert np.allclose(ends, np.sort([(0.2, 0.25, 0.0), (0.5, 0.7, -0.1)], axis=0), atol=0.01)
    lines = [(np.array(e.a_m), np.array(e.b_m)) for e in target.wireframe if e.radius_m == 0]
    long = [(a, b) for a, b in lines if np.linalg.norm(b - a) > 0.85]
    # the panel's four sides, above or below, are there; grooves of 2 mm are not
    for axis, half in ((0, 0.45), (1, 0.55)):
        for sign in (-1, 1):
            assert any(
                abs(a[1 - axis] - sign * half) < 0.03 and abs(b[1 - axis] - sign * half) < 0.03
                for a, b in long
            ), (axis, sign)
    inner = [
        (a, b)
        for a, b in lines
        if min(a[2], b[2]) > 0.32 and max(abs(a[0] + b[0]) / 2, abs(a[1] + b[1]) / 2) < 0.38
    ]
    assert not inner
    upright = [(a, b) for a, b in lines if abs(a[2] - b[2]) > 0.5]
    assert len(upright) == 4


def test_a_plain_cube_has_its_twelve_edges(tmp_path):
    trimesh.creation.box((1.0, 1.0, 1.0)).export(tmp_path / "cube.stl")
    cube, *_ = import_mesh(tmp_path / "cube.stl", "cube")
    assert len(cube.wireframe) == 12
    assert all(
        np.linalg.norm(np.subtract(e.b_m, e.a_m)) == pytest.approx(1.0) and len(e.normals) == 2
        for e in cube.wireframe
    )
    assert len(cube.occluders.triangles) == 12


def test_an_edge_that_fittings_interrupt_is_one(tmp_path):
    parts = [
        trimesh.creation.box((0.48, 0.3, 0.2), trimesh.transformations.translation_matrix((x, 0, 0)))
        for x in (-0.25, 0.25)
    ]
    trimesh.util.concatenate(parts).export(tmp_path / "two.stl")
    two, *_ = import_mesh(tmp_path / "two.stl", "two")
    lengths = sorted((float(np.linalg.norm(np.subtract(e.b_m, e.a_m))) for e in two.wireframe), reverse=True)
    assert lengths[:4] == pytest.approx([0.98] * 4)


def test_keypoints_are_spread_over_the_craft_and_not_along_its_boom(tmp_path):
    """A bus with fittings and a boom four times as long, with a collar every half metre: many corners on a line."""
    pieces = [trimesh.creation.box((1.2, 1.0, 1.0))]
    for x, y in ((-0.4, -0.3), (0.4, -0.3), (-0.4, 0.3), (0.4, 0.3)):
        pieces.append(
            trimesh.creation.box((0.2, 0.2, 0.15), trimesh.transformations.translation_matrix((x, y, 0.58)))
        )
    pieces.append(
        trimesh.creation.box((5.0, 0.05, 0.05), trimesh.transformations.translation_matrix((3.1, 0, 0)))
    )
    pieces += [
        trimesh.creation.box((0.08, 0.12, 0.12), trimesh.transformations.translation_matrix((x, 0, 0)))
        for x in np.arange(1.0, 5.5, 0.5)
    ]
    path = tmp_path / "boom.stl"
    path.write_bytes(trimesh.util.concatenate(pieces).export(file_type="stl"))
    points = np.array([k.position_m for k in import_mesh(path, "boom")[0].keypoints])
    assert len(points) == 16
    on_boom = points[:, 0] > 0.7
    assert 1 <= on_boom.sum() <= 5
    assert points[:, 0].max() > 5.5
    assert np.ptp(points[~on_boom], axis=0).min() > 0.9


@pytest.mark.parametrize(
    ("bus", "boom_at_m", "turns"),
    [
        ((1.0, 0.8, 0.4), None, ["half a turn about x", "half a turn about y", "half a turn about z"]),
        ((1.0, 1.0, 0.4), None, ["half a turn about x", "half a turn about y", "a quarter turn about z"]),
        ((1.0, 0.8, 0.4), (0.5, 0.4, 0.6), []),
    ],
)
def test_turns_that_leave_the_shape_as_it_is_are_said(tmp_path, bus, boom_at_m, turns):
    pieces = [trimesh.creation.box(bus)]
    if boom_at_m is not None:
        there = trimesh.transformations.translation_matrix(boom_at_m)
        pieces.append(trimesh.creation.box((0.2, 0.2, 1.0), there))
    trimesh.util.concatenate(pieces).export(tmp_path / "craft.stl")
    lines = import_mesh(tmp_path / "craft.stl", "craft")[1]
    said = [line for line in lines if "coincides with itself" in line]
    assert len(said) == bool(turns)
    assert all(turn in said[0] for turn in turns)
