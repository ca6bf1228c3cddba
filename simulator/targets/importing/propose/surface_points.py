"""Points spread evenly over the surface of bodies, with normal, material and connected piece."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flyaround.simulator.geometry.topology import MeshBody, edge_table, face_bodies
from flyaround.simulator.runtime.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Samples of a surface.

    Parameters
    ----------
    points_m : (N, 3) array
        Positions [m].
    normals : (N, 3) array
        Unit normals.
    material : (N,) array
        Material indices.
    piece : (N,) array
        Number of the connected piece.
    pieces : int
        Number of connected pieces.
    """

    points_m: FloatArray
    normals: FloatArray
    material: IntArray
    piece: IntArray
    pieces: int


def surface_points(bodies: list[MeshBody], count: int, *, vertices: bool = True) -> SurfacePoints:
    """Sample about ``count`` points uniformly by area, and every vertex of the bodies.

    The sampling is stratified along the list of faces, so that small faces are represented, and it is deterministic.

    Parameters
    ----------
    bodies : list of MeshBody
        Bodies to sample.
    count : int
        Number of points besides the vertices.
    vertices : bool, optional
        True to add the vertices.
    """
    rng = np.random.default_rng(0)
    areas = [np.linalg.norm(b.face_vectors, axis=1) for b in bodies]
    total = float(sum(a.sum() for a in areas))
    rows: list[tuple[FloatArray, FloatArray, IntArray, IntArray]] = []
    pieces = 0
    for body, area in zip(bodies, areas, strict=True):
        n_pieces, label = face_bodies(body.triangles, edge_table(body.triangles))
        n_points = max(1, round(count * float(area.sum()) / total))
        cumulative_area = np.cumsum(area) / area.sum()
        face = np.searchsorted(cumulative_area, (np.arange(n_points) + rng.random(n_points)) / n_points)
        face = np.minimum(face, len(area) - 1)
        # folded into the triangle (Osada et al. 2002, Shape distributions)
        u, v = rng.random((2, n_points))
        u, v = np.where(u + v > 1, (1 - u, 1 - v), (u, v))
        p = body.positions_m[body.triangles]
        sampled = p[face, 0] + u[:, None] * (p[face, 1] - p[face, 0]) + v[:, None] * (p[face, 2] - p[face, 0])
        vertex, first = np.unique(body.triangles if vertices else body.triangles[:0], return_index=True)
        face = np.concatenate([face, first // 3])
        unit = body.face_vectors / np.maximum(area[:, None], 1e-300)
        rows.append(
            (
                np.concatenate([sampled, body.positions_m[vertex]]),
                unit[face],
                body.face_material[face],
                label[face] + pieces,
            )
        )
        pieces += n_pieces
    points, normals, material, piece = (np.concatenate(r) for r in zip(*rows, strict=True))
    return SurfacePoints(points, normals, material, piece, pieces)
