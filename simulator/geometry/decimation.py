"""Decimation by vertex clustering; each cluster's point minimises the distance to the planes of its faces.

One pass without a priority queue, so that millions of triangles take seconds. Small features are lost; the largest
deviation is reported.

References
----------
Lindstrom (2000), Out-of-core simplification of large polygonal models, SIGGRAPH.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from flyaround.simulator.geometry.topology import MeshBody
from flyaround.simulator.geometry.triangles import distance_to_triangles, face_vectors
from flyaround.simulator.runtime.arrays import FloatArray, IntArray

SAMPLES = 20_000  # vertices at which the deviation is measured
NEAREST_POINTS = 6  # surface points whose triangles are tested for each vertex
SURFACE_POINTS = 300_000  # points on the reduced surface
FINEST_STEPS = 4000  # cells along the longest side
BISECTION_STEPS = 12  # attempts to find the finest allowed grid


@dataclass(frozen=True)
class Deviation:
    """Distance from the original vertices to the reduced surface: RMS and largest [m]."""

    rms_m: float
    largest_m: float


def decimate(bodies: list[MeshBody], max_triangles: int) -> list[MeshBody]:
    """Reduce bodies to at most ``max_triangles`` triangles in total; pieces smaller than a cluster disappear.

    Returns
    -------
    list of MeshBody
        New bodies in the order of the input, with positions at single precision and without normals and texture
        coordinates; bodies that have lost all triangles are left out.
        If all grids leave more than ``max_triangles``, those of the coarsest one, of two cells along the longest side.
    """
    low = np.min([b.positions_m.min(axis=0) for b in bodies], axis=0)
    high = np.max([b.positions_m.max(axis=0) for b in bodies], axis=0)
    extent = float((high - low).max())
    # the triangle count is roughly proportional to the square of the steps, on sheets and on solids
    steps, best, best_count = 48.0, 2, 0
    steps_too_fine = float(FINEST_STEPS)
    for _ in range(BISECTION_STEPS):
        steps_now = max(2, int(min(steps, steps_too_fine - 1, FINEST_STEPS)))
        count = sum(len(_surviving_faces(b, _cells(b, low, extent / steps_now))) for b in bodies)
        if count > max_triangles:
            steps_too_fine = min(steps_too_fine, steps_now)
        elif count >= best_count:
            best, best_count = steps_now, count
        # within 5 % of the limit the search ends
        if count <= max_triangles and (count > 0.95 * max_triangles or steps_now + 1 >= steps_too_fine):
            break
        # the count grows with the square of the steps; aim slightly below the limit
        steps = steps_now * float(np.sqrt(0.985 * max_triangles / max(count, 1)))
        if steps >= steps_too_fine or steps <= best:
            steps = (best + steps_too_fine) / 2 if steps_too_fine < FINEST_STEPS else 2.0 * best
    cell_m = extent / best
    reduced = [_cluster(b, _cells(b, low, cell_m), cell_m) for b in bodies]
    return [b for b in reduced if len(b.triangles)]


def _cells(body: MeshBody, low: FloatArray, cell_m: float) -> IntArray:
    """Return the (V,) index of each vertex's occupied cell."""
    c = ((body.positions_m - low) / cell_m + 0.5).astype(np.int64)
    key = (c[:, 0] << 42) | (c[:, 1] << 21) | c[:, 2]
    return np.unique(key, return_inverse=True)[1].ravel()


def _surviving_faces(body: MeshBody, cell: IntArray) -> IntArray:
    """Return the faces that keep three distinct cells, without duplicates."""
    t = cell[body.triangles]
    faces = np.flatnonzero((t[:, 0] != t[:, 1]) & (t[:, 1] != t[:, 2]) & (t[:, 2] != t[:, 0]))
    s = np.sort(t[faces], axis=1)
    n = int(cell.max(initial=0)) + 1
    if n > 2_000_000:
        return faces  # three indices overflow a 64-bit key; so fine a grid merges few faces
    _, first = np.unique((s[:, 0] * n + s[:, 1]) * n + s[:, 2], return_index=True)
    return faces[np.sort(first)]


def _cluster(body: MeshBody, cell: IntArray, cell_m: float) -> MeshBody:
    faces = _surviving_faces(body, cell)
    points = _best_points(body, cell, cell_m)
    occupied, index = np.unique(cell[body.triangles[faces]], return_inverse=True)
    return MeshBody(
        name=body.name,
        positions_m=points[occupied].astype(np.float32).astype(float),
        triangles=index.reshape(-1, 3),
        face_material=body.face_material[faces],
    )


def _best_points(body: MeshBody, cell: IntArray, cell_m: float) -> FloatArray:
    """Return the (C, 3) point of each cell with the least sum of squared distances to the planes of its faces."""
    n = int(cell.max()) + 1
    count = np.bincount(cell, minlength=n)
    mean = np.stack([np.bincount(cell, body.positions_m[:, k], n) for k in range(3)], axis=1) / count[:, None]
    normal = body.face_vectors  # twice the area long, so that large faces weigh more
    A = np.zeros((n, 3, 3))
    b = np.zeros((n, 3))
    for corner in range(3):
        cells = cell[body.triangles[:, corner]]
        # relative to the cell's mean, so that no digits are lost far from the origin
        offset = np.einsum("ij,ij->i", normal, body.positions_m[body.triangles[:, corner]] - mean[cells])
        for i in range(3):
            b[:, i] += np.bincount(cells, normal[:, i] * offset, n)
            for j in range(i, 3):
                A[:, i, j] += np.bincount(cells, normal[:, i] * normal[:, j], n)
    for i in range(3):
        for j in range(i):
            A[:, i, j] = A[:, j, i]
    # flat cells have one plane only: a small weight keeps their point at the mean
    A += np.eye(3) * (1e-3 * np.trace(A, axis1=1, axis2=2) + 1e-30)[:, None, None]
    step = np.linalg.solve(A, b[..., None])[..., 0]
    return mean + np.clip(step, -cell_m / 2, cell_m / 2)


def deviation(before: list[MeshBody], after: list[MeshBody]) -> Deviation:
    """Measure the distances of sampled original vertices to the nearest triangles of the reduced surface.

    Returns
    -------
    Deviation
        RMS and largest distance [m] of up to `SAMPLES` vertices.
    """
    vertices = np.concatenate([b.positions_m for b in before])
    sample = vertices[:: len(vertices) // SAMPLES + 1]
    corners = np.concatenate([b.positions_m[b.triangles] for b in after])
    # points sampled on the reduced surface give candidate nearest triangles for each vertex
    twice_area = np.linalg.norm(face_vectors(corners), axis=1)
    rng = np.random.default_rng(0)
    owner = np.concatenate(
        [np.arange(len(corners)), rng.choice(len(corners), SURFACE_POINTS, p=twice_area / twice_area.sum())]
    )
    weight = rng.dirichlet((1.0, 1.0, 1.0), len(owner))
    points = np.einsum("nk,nkc->nc", weight, corners[owner])
    _, near = cKDTree(points).query(sample, k=NEAREST_POINTS)
    d = distance_to_triangles(np.repeat(sample, NEAREST_POINTS, axis=0), corners[owner[near].ravel()])
    d = d.reshape(near.shape).min(axis=1)
    return Deviation(float(np.sqrt(np.mean(d**2))), float(d.max()))
