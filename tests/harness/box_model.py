"""A board model of a closed box, small enough to reason about."""

from __future__ import annotations

from typing import Any

import numpy as np


def box_model(half_m: tuple[float, ...] = (0.5, 0.4, 0.2)) -> dict[str, Any]:
    """A closed box of 1.0 x 0.8 x 0.4 m, or of other half sizes."""
    h = np.array(half_m)
    v = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * h
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    normals = [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]]
    edges: dict[tuple[int, ...], list[list[int]]] = {}
    triangles = []
    for f, n in zip(faces, normals, strict=True):
        triangles += [[f[0], f[1], f[2]], [f[0], f[2], f[3]]]
        for k in range(4):
            edges.setdefault(tuple(sorted((f[k], f[(k + 1) % 4]))), []).append(n)
    return {
        "schema": "flyaround.board_model",
        "version": 1,
        "name": "box",
        "sha256": "0",
        "keypoints": [{"name": f"corner_{i}", "position_m": p} for i, p in enumerate(v.tolist())],
        "wireframe": [
            {
                "name": f"edge_{a}_{b}",
                "a_m": v[a].tolist(),
                "b_m": v[b].tolist(),
                "normals": n,
                "radius_m": 0.0,
            }
            for (a, b), n in edges.items()
        ],
        "occluders": {"vertices_m": v.tolist(), "triangles": triangles},
        "symmetry_wxyz": [[0, 0, 0, 1]],
        "mass_kg": 10.0,
    }
