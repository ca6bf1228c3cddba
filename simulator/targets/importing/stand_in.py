"""Coarse closed bodies that stand for the craft in visibility tests: hulls of convex pieces, shells of others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from simulator.arrays import FloatArray, IntArray
from simulator.targets.importing.decimate import decimate
from simulator.targets.importing.repair import Tally, oriented
from simulator.targets.importing.topology import Body, edge_table, face_bodies
from simulator.targets.model import Occluders

MOST_TRIANGLES = 400
MOST_PIECES = 24
CONVEX = 0.85
"""Share of its hull that a piece must fill for the hull to stand for it."""
INSET = 0.99
"""Occluders are drawn in a little, so that they do not hide the edges on their own surface."""


def propose_occluders(bodies: list[Body], extent: float) -> Occluders:
    """At most about 400 triangles for the largest pieces of the craft."""
    pieces = sorted(_pieces(bodies), key=lambda b: -_area(b))
    pieces = [b for b in pieces if _area(b) > 2e-3 * extent**2][:MOST_PIECES]
    total = sum(_area(b) for b in pieces)
    vertices: list[FloatArray] = []
    triangles: list[IntArray] = []
    count = 0
    for piece in pieces:
        budget = max(12, int(MOST_TRIANGLES * _area(piece) / total))
        v, t = _coarse(piece, budget)
        if len(t) and count + len(t) <= MOST_TRIANGLES + 100:
            middle = (v.min(axis=0) + v.max(axis=0)) / 2
            triangles.append(t + sum(len(x) for x in vertices))
            vertices.append(middle + INSET * (v - middle))
            count += len(t)
    if not vertices:
        return Occluders()
    return Occluders(vertices_m=np.concatenate(vertices), triangles=np.concatenate(triangles))


def _pieces(bodies: list[Body]) -> list[Body]:
    out = []
    for body in bodies:
        n, label = face_bodies(body.triangles, edge_table(body.triangles))
        if n == 1:
            out.append(body)
            continue
        largest = np.argsort(-np.bincount(label), kind="stable")[:MOST_PIECES]
        out += [_compact(body.kept(label == k)) for k in largest]
    return out


def _compact(body: Body) -> Body:
    used, index = np.unique(body.triangles, return_inverse=True)
    return replace(
        body, positions_m=body.positions_m[used], triangles=index.reshape(-1, 3), corner_normals=None
    )


def _area(body: Body) -> float:
    return float(np.linalg.norm(body.face_vectors, axis=1).sum()) / 2


def _coarse(piece: Body, budget: int) -> tuple[FloatArray, IntArray]:
    """Vertices and triangles of the piece's stand-in."""
    p = piece.positions_m[piece.triangles]
    middle = piece.positions_m.mean(axis=0)
    volume = float(np.einsum("ij,ij->", p[:, 0] - middle, np.cross(p[:, 1] - middle, p[:, 2] - middle))) / 6
    try:
        hull = ConvexHull(piece.positions_m)
    except (QhullError, ValueError):
        return np.zeros((0, 3)), np.zeros((0, 3), np.int64)  # a flat sheet has no inside to hide behind
    if volume > CONVEX * hull.volume:
        points = piece.positions_m[hull.vertices]
        steps = 12
        while len(hull.simplices) > budget and steps > 1:
            low = points.min(axis=0)
            size = float((points.max(axis=0) - low).max()) / steps
            cell = np.unique(np.floor((points - low) / size), axis=0, return_inverse=True)[1].ravel()
            n = int(cell.max()) + 1
            sums = np.stack([np.bincount(cell, points[:, k], n) for k in range(3)], axis=1)
            mean = sums / np.bincount(cell, minlength=n)[:, None]
            try:
                hull = ConvexHull(mean)
            except (QhullError, ValueError):
                break
            steps -= 1
        return _outward(hull)
    if len(piece.triangles) > budget:
        reduced = decimate([piece], budget)
        if not reduced:
            return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
        piece = oriented(_compact(reduced[0]), piece.name, Tally(), lenient=True)
    return piece.positions_m, piece.triangles


def _outward(hull: ConvexHull) -> tuple[FloatArray, IntArray]:
    used, index = np.unique(hull.simplices, return_inverse=True)
    v, t = np.asarray(hull.points[used]), index.reshape(-1, 3)
    n = np.cross(v[t[:, 1]] - v[t[:, 0]], v[t[:, 2]] - v[t[:, 0]])
    wrong = np.einsum("ij,ij->i", n, hull.equations[:, :3]) < 0
    t[wrong] = t[wrong][:, ::-1]
    return v, t.astype(np.int64)
