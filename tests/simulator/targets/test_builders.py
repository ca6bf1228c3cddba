"""Mesh builders: closed, outward, wound with their normals, and of the volume they claim."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from flyaround.simulator.targets.builders.cells import cell_grid, clipped_rectangle
from flyaround.simulator.targets.builders.mesh import Mesh, merge
from flyaround.simulator.targets.builders.prism import circle, prism, rectangle, triangulate
from flyaround.simulator.targets.builders.solids import bar, box, cone, dome, lathe, rod, truss

N = 96
RING_AREA = N / 2 * np.sin(2 * np.pi / N)  # of a regular polygon in the unit circle

BODIES = {
    "box": (box((-1, -2, -3), (1, 2, 3)), 48.0),
    "bevelled box": (
        box((0, 0, 0), (1, 1, 1), 0.1),
        1 - 12 * 0.005 * 0.8 - 8 * (0.005 * 0.1 * 2 - 0.001 / 6),
    ),
    "bar": (bar((0, 0, 0), (1, 2, 2), 0.1, 0.2, (0, 0, 1)), 0.06),
    "cylinder": (cone((0, 0, 1), (0, 3, 1), 0.5, 0.5, N), 3 * 0.25 * RING_AREA),
    "cone": (cone((1, 0, 0), (1, 0, 2), 0.3, 0.1, N), 2 / 3 * RING_AREA * (0.09 + 0.03 + 0.01)),
    "point": (lathe([(0, 0), (0.5, 0), (0, 1)], (0, 0, 0), (1, 1, 0), N), RING_AREA * 0.25 / 3),
    "plate with holes": (
        prism(rectangle((0, 0), (4, 2)), 0.5, holes=[circle((1, 1), 0.3, N), circle((3, 1), 0.2, N)]),
        0.5 * (8 - RING_AREA * (0.09 + 0.04)),
    ),
    "arrow": (prism([(0, 0), (2, 1), (0, 2), (1, 1)], 1.0, u=(0, 1, 0), v=(0, 0, 1)), 1.0),
}


def as_trimesh(mesh: Mesh) -> trimesh.Trimesh:
    tri = trimesh.Trimesh(mesh.positions_m, mesh.triangles, process=False)
    tri.merge_vertices(merge_norm=True, merge_tex=True)
    return tri


@pytest.mark.parametrize("name", BODIES)
def test_body_is_closed_outward_and_of_its_volume(name: str) -> None:
    mesh, volume = BODIES[name]
    tri = as_trimesh(mesh)
    assert tri.is_watertight
    assert tri.is_winding_consistent
    # exact but for the rounding of coordinates: the expected volumes are those of the polygons
    assert tri.volume == pytest.approx(volume, rel=1e-9)


@pytest.mark.parametrize("name", BODIES)
def test_vertex_normals_are_unit_and_agree_with_the_winding(name: str) -> None:
    mesh, _ = BODIES[name]
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-12)
    p = mesh.positions_m[mesh.triangles]
    face = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    # at most 32 degrees between a facet and the smoothed normals at its corners
    assert (np.einsum("ij,ikj->ik", face, mesh.normals[mesh.triangles]) > np.cos(np.deg2rad(33))).all()


def test_creases_are_sharp_and_curved_sides_smooth() -> None:
    flat = box((0, 0, 0), (1, 1, 1))
    assert {tuple(np.abs(n)) for n in flat.normals} == {(1, 0, 0), (0, 1, 0), (0, 0, 1)}
    round_side = cone((0, 0, 0), (0, 0, 1), 1.0, 1.0, 32)
    side = np.abs(round_side.normals[:, 2]) < 0.5
    radial = round_side.positions_m[side] * (1, 1, 0)
    assert np.allclose(round_side.normals[side], radial, atol=1e-12)


def test_dome_normals_are_those_of_the_sphere() -> None:
    mesh = dome((0, 0, 0), (0, 0, 1), 1.0, 1.0, segments=48, rings=16)
    curved = mesh.normals[:, 2] > -0.5
    lean = np.einsum("ij,ij->i", mesh.normals[curved], mesh.positions_m[curved])
    # half a facet (2.8 degrees) at the rim, where the profile ends, is the most that smoothing leaves
    assert lean.min() > np.cos(np.deg2rad(3))


def test_truss_members_are_separate_closed_bodies() -> None:
    mesh = truss([(0, 0, 0), (1, 0, 0), (0, 1, 0), (2, 0, 0)], [(0, 1), (0, 2), (1, 2), (1, 3)], 0.01)
    tri = as_trimesh(mesh)
    assert tri.is_watertight
    assert len(tri.split()) == 4 + 4


def test_mirroring_keeps_a_body_outward() -> None:
    solid = rod((1, 0, 0), (1, 1, 0), 0.1)
    assert as_trimesh(solid.mirrored(0)).volume == pytest.approx(as_trimesh(solid).volume)
    assert solid.mirrored(0).positions_m[:, 0].max() < 0


def test_rotation_and_merge_keep_counts() -> None:
    turned = box((0, 0, 0), (1, 1, 1)).rotated([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    both = merge([turned, turned.moved((5, 0, 0))])
    assert len(both.triangles) == 24
    assert as_trimesh(both).volume == pytest.approx(2.0)


def test_crossing_holes_are_refused() -> None:
    bow = np.array([(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.2)])
    with pytest.raises(ValueError, match="crosses"):
        triangulate(bow)


def test_cells_stand_apart() -> None:
    tile = clipped_rectangle(0.08, 0.04, 0.01, "all")
    assert len(tile) == 8
    grid = cell_grid([0.0, 0.1], [0.0, 0.05, 0.1], tile, 1.0, 0.001)
    assert len(as_trimesh(grid).split()) == 6
    assert grid.positions_m[:, 2].min() == 1.0
