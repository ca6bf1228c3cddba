"""Cutting a mesh: every edge short, the same surface, no gap between neighbours, order and ranges kept."""

import numpy as np
import pytest

from flyaround.simulator.baking.mesh_edges import find_edges
from flyaround.simulator.geometry.subdivision import subdivide
from tests.harness.boxes import closed_box


def test_a_cut_mesh_is_the_same_closed_surface_with_short_edges():
    # an octahedron with very different edges, each face with vertices of its own (as flat shading has them)
    corners = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 0.2], [0, 0, -2.5]], float)
    faces = [(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4), (1, 0, 5), (2, 1, 5), (3, 2, 5), (0, 3, 5)]
    p = corners[np.array(faces).ravel()]
    made = subdivide(p, np.arange(24).reshape(-1, 3), 0.3)
    q = made.extended(p.astype(np.float32)).astype(float)
    t = q[made.triangles]
    assert max(np.linalg.norm(t[:, k] - t[:, k - 1], axis=1).max() for k in range(3)) <= 0.3 + 1e-6
    volume = np.einsum("ij,ij->", t[:, 0], np.cross(t[:, 1], t[:, 2])) / 6
    assert abs(volume - 2 * 2.7 / 3) < 1e-6
    # each edge is met once in each direction: nothing gapes
    place = np.unique(np.round(q, 5), axis=0, return_inverse=True)[1].ravel()[made.triangles]
    edges = np.stack([place, np.roll(place, -1, axis=1)], -1).reshape(-1, 2)
    forward, backward = edges[:, 0] * len(q) + edges[:, 1], edges[:, 1] * len(q) + edges[:, 0]
    assert np.array_equal(np.sort(forward), np.sort(backward))
    assert len(np.unique(forward)) == len(forward)
    # the pieces of face k lie in face k
    for k in range(8):
        a, b, c = p[3 * k : 3 * k + 3]
        normal = np.cross(b - a, c - a)
        mine = t[made.first[k] : made.first[k + 1]].reshape(-1, 3)
        assert np.abs((mine - a) @ normal).max() < 1e-6
        assert len(mine) >= 3


def test_short_edges_are_left_alone():
    p = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]], float)
    made = subdivide(p, np.array([[0, 1, 2]]), 0.2)
    assert made.parents == ()
    assert made.triangles.tolist() == [[0, 1, 2]]
    assert made.of.tolist() == [0]
    assert made.first.tolist() == [0, 1]


def test_edges_are_cut_where_triangles_are():
    box = closed_box("body", (-0.4, -0.3, 0.0), (0.7, 0.3, 0.2))
    edges = find_edges((box,), {"m": 1}, is_closed=True)
    pieces, of = edges.cut(0.1)
    ends = pieces.vertices_m[pieces.ends]
    assert np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).max() <= 0.1
    assert np.all(np.diff(of) >= 0)
    assert np.array_equal(pieces.faces, edges.faces[of])
    # the pieces of an edge go from its start to its end
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    whole = edges.vertices_m[edges.ends]
    assert np.bincount(of, length) == pytest.approx(np.linalg.norm(whole[:, 1] - whole[:, 0], axis=1))
    made = subdivide(box.positions_m.astype(float), np.asarray(box.triangles), 0.1)
    corners = made.extended(box.positions_m.astype(float))
    places = {tuple(place) for place in corners}
    assert {tuple(place) for place in ends.reshape(-1, 3).astype(np.float32)} <= places
