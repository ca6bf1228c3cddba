"""What plates cover of each other is cut away, nothing else, and what is left has no holes or doubles."""

import numpy as np
import pytest

from simulator.render.bake.hidden_faces import inside_bodies, remove_hidden_faces
from simulator.render.bake.occluders import MARGIN, convex_bodies
from simulator.targets.builders.mesh import merge
from simulator.targets.builders.solids import box
from tests.simulator.render.bake.test_occluders import part_of

LOW, HIGH = (-0.5, -0.4, -0.1), (0.5, 0.4, 0.0)
UPON = ((-0.4, -0.35, 0.0), (0.45, 0.3, 0.05))


def cut(*extents):
    meshes = [box(*extent) for extent in extents]
    corners = merge(meshes).positions_m.astype(float)[merge(meshes).triangles]
    return corners, remove_hidden_faces(corners, convex_bodies([part_of(mesh) for mesh in meshes], 1.0), 1.0)


def areas(corners):
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2


def test_of_a_face_under_a_plate_the_rest_is_left_and_every_point_of_it_once():
    corners, made = cut((LOW, HIGH), UPON)
    pieces = np.einsum("pkc,pcn->pkn", made.shares, corners[made.of])
    gone = np.setdiff1d(np.arange(len(corners)), made.kept)
    assert np.all(corners[gone, :, 2] == 0)  # both faces of the contact
    assert set(made.of) == set(gone)
    facing_up = np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0])[:, 2]
    # points on the lower box's top: outside of the plate each lies on one piece, well inside of it on none
    random = np.random.default_rng(1)
    points = np.column_stack([random.uniform(LOW[:2], HIGH[:2], (4000, 2)), np.zeros(4000)])
    above = pieces[facing_up > 0]
    turn = [
        np.cross(above[None, :, k] - points[:, None], above[None, :, (k + 1) % 3] - points[:, None])[..., 2]
        for k in range(3)
    ]
    met = (np.min(turn, axis=0) > 0).sum(axis=1)
    (x0, y0, _), (x1, y1, _) = UPON
    beyond = np.max([x0 - points[:, 0], points[:, 0] - x1, y0 - points[:, 1], points[:, 1] - y1], axis=0)
    assert np.all(met[beyond > 0] == 1)
    deep = beyond < -2 * MARGIN
    assert met[deep].max() <= 1
    assert np.mean(met[deep]) < 0.01  # a strip along the diagonal stays, where the face's triangles meet


def test_faces_flush_with_a_body_or_only_near_it_stay_whole():
    flush = ((-0.3, -0.2, -0.05), (0.45, 0.3, 0.0))  # in the lower box; its top looks the same way
    near = ((-0.3, -0.2, 0.001), (0.45, 0.3, 0.05))
    for other in (flush, near):
        corners, made = cut((LOW, HIGH), other)
        own = corners[: len(corners) // 2]
        assert set(range(len(own))) <= set(made.kept)


def test_values_at_the_pieces_corners_are_those_of_the_face():
    corners, made = cut((LOW, HIGH), UPON)
    vertices = corners.reshape(-1, 3)
    triangles = np.arange(len(vertices)).reshape(-1, 3)
    plane = vertices @ [0.3, -2.0, 0.7] + 0.1
    values = made.extended(np.column_stack([vertices, plane]).astype(np.float32), triangles)
    drawn = made.triangles(triangles, len(vertices))
    assert len(values) == len(vertices) + 3 * len(made.of)
    assert values[:, 3] == pytest.approx(values[:, :3] @ [0.3, -2.0, 0.7] + 0.1, abs=1e-6)
    # the whole surface, less what is covered on both sides of the contact
    covered = np.prod(np.subtract(UPON[1], UPON[0])[:2])
    lost = areas(corners).sum() - areas(values[:, :3].astype(float)[drawn]).sum()
    assert lost == pytest.approx(2 * covered, rel=0.03)


def test_feet_in_a_body_or_upon_it_are_found_and_flush_faces_are_not():
    body, foot, sunk, flush = (
        (LOW, HIGH),
        ((0.1, 0.1, 0.0), (0.2, 0.2, 0.1)),  # stands on it
        ((-0.3, 0.1, -0.05), (-0.2, 0.2, -0.01)),
        ((0.3, -0.2, -0.05), (0.4, -0.1, 0.0)),  # its top is level with the body's
    )
    meshes = [box(*extent) for extent in (body, foot, sunk, flush)]
    corners = merge(meshes).positions_m.astype(float)[merge(meshes).triangles]
    found = inside_bodies(corners, convex_bodies([part_of(mesh) for mesh in meshes], 1.0), 1.0).reshape(4, 12)
    up = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2].reshape(4, 12)
    assert not found[0].any()
    assert np.array_equal(found[1], up[1] < -1e-3)
    assert found[2].all()
    assert np.array_equal(found[3], up[3] < 1e-3)


def test_under_a_thin_plate_everything_stays_since_coarse_shadow_maps_leave_the_plate_out():
    for height, hides in ((0.0012, False), (0.002, True)):
        plate, foil = ((-0.4, -0.35, 0.0), (0.45, 0.3, height)), ((0.1, 0.1, -0.05), (0.2, 0.2, 0.5 * height))
        meshes = [box(*extent) for extent in (plate, foil)]
        corners = merge(meshes).positions_m.astype(float)[merge(meshes).triangles]
        corners[12:, :, 2] = np.maximum(corners[12:, :, 2], 0.0)  # all of the foil lies in the plate
        found = inside_bodies(corners, convex_bodies([part_of(meshes[0])], 1.0), 1.0)
        assert found[12:].any() == hides


def test_what_meets_a_bodys_edge_stays_since_rounding_opens_pixels_between_the_two():
    # a wall of the small one goes on in a wall of the large one
    body, beside = (
        (LOW, HIGH),
        ((HIGH[0] - 0.1, LOW[1] + 0.1, HIGH[2]), (HIGH[0], LOW[1] + 0.2, HIGH[2] + 0.1)),
    )
    meshes = [box(*extent) for extent in (body, beside)]
    corners = merge(meshes).positions_m.astype(float)[merge(meshes).triangles]
    found = inside_bodies(corners, convex_bodies([part_of(mesh) for mesh in meshes], 1.0), 1.0)
    assert not found.any()
