"""Perceptual groups: the same small figures found among picture lines and on the wireframe.

Sharma et al. (2018) list antenna, parallel pair, proximity pair, open polygonal triad, open tetrad and closed
tetrad. A chain of lines joined at corners is a triad; a chain whose ends meet, a closed tetrad.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, List, Tuple

import numpy as np

from flyaround.hil.board.svd.model.target_model import BoardModel

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Lines:
    """Segments with what the grouping needs of them.

    Parameters
    ----------
    ends : (N, 2, 2). direction : (N, 2) unit. length : (N,).
    """

    ends: Array
    direction: Array
    length: Array

    @staticmethod
    def of(segments: Array) -> Lines:
        """From (N, 4) x0 y0 x1 y1."""
        ends = np.asarray(segments, float).reshape(-1, 2, 2)
        d = ends[:, 1] - ends[:, 0]
        length = np.linalg.norm(d, axis=1)
        return Lines(ends, d / np.maximum(length, 1e-9)[:, None], length)


def parallel_pairs(lines: Lines, angle_rad: float = np.radians(8.0)) -> Array:
    """(P, 2) pairs of about one direction that overlap along it."""
    n = len(lines.length)
    cross = np.abs(_cross(lines.direction[:, None], lines.direction[None]))
    i, j = np.nonzero(np.triu(cross < np.sin(angle_rad), 1))
    if not n or not len(i):
        return np.zeros((0, 2), int)
    d = lines.direction[i]
    base = lines.ends[i, 0]
    a = np.einsum("pk,pk->p", lines.ends[j, 0] - base, d)
    b = np.einsum("pk,pk->p", lines.ends[j, 1] - base, d)
    overlap = np.minimum(np.maximum(a, b), lines.length[i]) - np.maximum(np.minimum(a, b), 0.0)
    keep = overlap > 0.4 * np.minimum(lines.length[i], lines.length[j])
    return np.stack([i[keep], j[keep]], axis=-1)


def antennas(lines: Lines, pairs: Array, diagonal_px: float) -> Array:
    """(A, 2) parallel pairs that are much longer than wide: the outlines of rods."""
    if not len(pairs):
        return pairs
    i, j = pairs[:, 0], pairs[:, 1]
    middle = lines.ends[j].mean(axis=1) - lines.ends[i, 0]
    width = np.abs(_cross(lines.direction[i], middle))
    length = np.minimum(lines.length[i], lines.length[j])
    return np.asarray(pairs[(width < 0.4 * length) & (width < 0.08 * diagonal_px) & (width > 1.0)])


@dataclass(frozen=True, eq=False)
class Corners:
    """Proximity pairs: two lines whose ends nearly meet at an angle.

    Parameters
    ----------
    line, end : (C, 2) lines, and which end of each. point : (C, 2) where the lines intersect.
    """

    line: Array
    end: Array
    point: Array


def proximity_pairs(lines: Lines, reach_px: float, least_angle_rad: float = np.radians(12.0)) -> Corners:
    """Corners: intersections no farther than ``reach_px`` from one end of both lines."""
    n = len(lines.length)
    i, j = np.triu_indices(n, 1)
    det = _cross(lines.direction[i], lines.direction[j])
    ok = np.abs(det) > np.sin(least_angle_rad)
    i, j, det = i[ok], j[ok], det[ok]
    if not len(i):
        return Corners(np.zeros((0, 2), int), np.zeros((0, 2), int), np.zeros((0, 2)))
    s = _cross(lines.ends[j, 0] - lines.ends[i, 0], lines.direction[j]) / det
    p = lines.ends[i, 0] + s[:, None] * lines.direction[i]
    di = np.linalg.norm(lines.ends[i] - p[:, None], axis=2)
    dj = np.linalg.norm(lines.ends[j] - p[:, None], axis=2)
    ei, ej = di.argmin(axis=1), dj.argmin(axis=1)
    near = (di.min(axis=1) < np.minimum(reach_px, 0.5 * lines.length[i] + 3)) & (
        dj.min(axis=1) < np.minimum(reach_px, 0.5 * lines.length[j] + 3)
    )
    return Corners(np.stack([i[near], j[near]], axis=-1), np.stack([ei[near], ej[near]], axis=-1), p[near])


@dataclass(frozen=True, eq=False)
class Chains:
    """Open triads and closed tetrads as four points in order: far end, corner, corner, far end.

    Parameters
    ----------
    points : (T, 4, 2) or (T, 4, 3). closed : (T,) whether a fourth line joins the far ends.
    """

    points: Array
    closed: Array


def image_triads(lines: Lines, corners: Corners, limit: int = 48) -> Chains:
    """Chains of three lines bent the same way at both ends of the middle one, largest first."""
    at: Dict[Tuple[int, int], List[Tuple[int, int, Array]]] = {}
    for (i, j), (ei, ej), p in zip(  # noqa: B905 - Python 3.9 has no strict=
        corners.line, corners.end, corners.point
    ):
        at.setdefault((int(i), int(ei)), []).append((int(j), int(ej), p))
        at.setdefault((int(j), int(ej)), []).append((int(i), int(ei), p))
    points, closed, size = [], [], []
    for m in range(len(lines.length)):
        for i, ei, pa in at.get((m, 0), []):
            for j, ej, pb in at.get((m, 1), []):
                if i == j:
                    continue
                far_i, far_j = lines.ends[i, 1 - ei], lines.ends[j, 1 - ej]
                # both arms on one side of the middle line: the outline of a face
                side_i = _cross(pb - pa, far_i - pa)
                side_j = _cross(pb - pa, far_j - pa)
                if side_i * side_j <= 0:
                    continue
                joined = 0
                for k, _, p in at.get((i, 1 - ei), []):
                    for k2, _, p2 in at.get((j, 1 - ej), []):
                        if k == k2:
                            far_i, far_j, joined = p, p2, 1
                quad = np.array([far_i, pa, pb, far_j])
                area = _area(quad)
                if area < 40.0:
                    continue
                points.append(quad)
                closed.append(joined)
                size.append(area * (1 + joined))
    if not points:
        return Chains(np.zeros((0, 4, 2)), np.zeros(0, bool))
    order = np.argsort(-np.array(size))[:limit]
    return Chains(np.array(points)[order], np.array(closed, bool)[order])


def model_triads(model: BoardModel, join_m: float = 0.02) -> Chains:
    """Plane chains of three wireframe edges bent the same way, both ways round."""
    edges = [e for e in model.wireframe if e.radius_m == 0]
    n = len(edges)
    ends = np.array([[e.a_m, e.b_m] for e in edges]).reshape(n, 2, 3)
    points, closed = [], []
    for m in range(n):
        for mi in (0, 1):
            pa, pb = ends[m, mi], ends[m, 1 - mi]
            arms_a = _arms(ends, m, pa, join_m)
            arms_b = _arms(ends, m, pb, join_m)
            for i, fa in arms_a:
                for j, fb in arms_b:
                    if i == j:
                        continue
                    quad = np.array([fa, pa, pb, fb])
                    if _flat_convex(quad):
                        points.append(quad)
                        closed.append(_joined(ends, fa, fb, join_m))
    if not points:
        return Chains(np.zeros((0, 4, 3)), np.zeros(0, bool))
    return Chains(np.array(points), np.array(closed, bool))


def _arms(ends: Array, m: int, p: Array, join_m: float) -> List[Tuple[int, Array]]:
    near = np.linalg.norm(ends - p, axis=2) < join_m
    return [(int(k), ends[k, 1 - int(near[k].argmax())]) for k in np.flatnonzero(near.any(axis=1)) if k != m]


def _joined(ends: Array, a: Array, b: Array, join_m: float) -> bool:
    one = np.linalg.norm(ends - a, axis=2) < join_m
    two = np.linalg.norm(ends - b, axis=2) < join_m
    return bool(np.any((one[:, 0] & two[:, 1]) | (one[:, 1] & two[:, 0])))


def _flat_convex(quad: Array) -> bool:
    """A plane chain whose arms lie on one side, neither too thin to be told from a line."""
    side = np.linalg.norm(np.diff(quad, axis=0), axis=1)
    if side.min() < 0.15 * side.max():
        return False
    base = quad[2] - quad[1]
    n1, n2 = np.cross(quad[0] - quad[1], base), np.cross(quad[3] - quad[2], base)
    s = np.linalg.norm(n1) * np.linalg.norm(n2)
    return bool(s > 1e-9 and n1 @ n2 > 0.999 * s)


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _area(quad: Array) -> float:
    x, y = quad[:, 0], quad[:, 1]
    return 0.5 * abs(float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))))
