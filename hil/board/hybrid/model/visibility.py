"""Visibility of the wireframe samples: back-face and occlusion tests."""

from __future__ import annotations

from typing import Tuple

import numpy as np

from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.hybrid.geometry.wireframe import EdgeSamples, OccludingTriangles
from flyaround.hil.board.hybrid.native.interface import contiguous
from flyaround.hil.board.hybrid.native.library import library

Array = np.ndarray


def sample_edges(model: BoardModel, spacing_m: float) -> EdgeSamples:
    """Return samples of every edge, ``spacing_m`` apart, at least one on each."""
    points, tangents, radius, normals, faces, edge = [], [], [], [], [], []
    for k, e in enumerate(model.wireframe):
        d = e.b_m - e.a_m
        length = float(np.linalg.norm(d))
        if length < 1e-6:
            continue
        n = max(1, round(length / spacing_m))
        s = (np.arange(n) + 0.5) / n
        N = np.zeros((2, 3))
        adjacent = e.normals[:2]
        if len(adjacent):
            N[: len(adjacent)] = adjacent / np.maximum(np.linalg.norm(adjacent, axis=1, keepdims=True), 1e-9)
        for side in (-1.0, 1.0) if e.radius_m > 0 else (0.0,):
            points.append(e.a_m + s[:, None] * d)
            tangents.append(np.repeat(d[None] / length, n, axis=0))
            radius.append(np.full(n, side * e.radius_m))
            normals.append(np.repeat(N[None], n, axis=0))
            faces.append(np.full(n, len(adjacent)))
            edge.append(np.full(n, k))
    return EdgeSamples(
        np.concatenate(points),
        np.concatenate(tangents),
        np.concatenate(radius),
        np.concatenate(normals),
        np.concatenate(faces),
        np.concatenate(edge),
    )


def occluders(model: BoardModel) -> OccludingTriangles:
    """Return the model's occluding mesh as vertices and edge vectors."""
    tri = model.vertices_m[model.triangles] if model.triangles.size else np.zeros((0, 3, 3))
    e1, e2 = tri[:, 1] - tri[:, 0], tri[:, 2] - tri[:, 0]
    n = np.cross(e1, e2)
    keep = np.linalg.norm(n, axis=1) > 1e-12
    return OccludingTriangles(tri[keep, 0], e1[keep], e2[keep], n[keep])


def visible_samples(samples: EdgeSamples, occ: OccludingTriangles, C_m: Array) -> Tuple[Array, Array]:
    """Test the samples' visibility from a camera centre ``C_m`` (3,), target frame.

    Moeller and Trumbore's test (1997) of each sample against each front-facing triangle.

    Returns
    -------
    visible : (S,) array of bool
        True for the samples that have a face towards the camera, or none at all, and that no triangle hides.
    outline : (S,) array of bool
        True for the samples of which one of two faces is towards the camera, or that have none; hidden ones included.

    Raises
    ------
    MemoryError
        If the library is out of memory.
    """
    visible, outline = np.empty(len(samples), bool), np.empty(len(samples), bool)
    C = contiguous(C_m, "float64", (3,))
    if library().fly_visible_samples(samples.native, occ.native, C, visible, outline):
        raise MemoryError("out of memory while testing the wireframe's visibility")
    return visible, outline
