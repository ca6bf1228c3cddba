"""Cutting a mesh: every edge short, the same surface, no gap between neighbours, order and ranges kept."""

import numpy as np

from flyaround.simulator.geometry.subdivision import subdivide


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
