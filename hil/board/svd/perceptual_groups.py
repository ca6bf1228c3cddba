"""Perceptual groups among the lines of an image.

Sharma, Ventura & D'Amico (2018), feature synthesis: antenna, parallel pair, proximity pair, open polygonal triad,
open tetrad and closed tetrad. A chain of lines joined at corners is a triad; a chain whose ends meet is a closed
tetrad.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, List, Tuple

import numpy as np

Array = np.ndarray

# Largest number of groups of each kind kept per image. The number of hypotheses is proportional to it.
MAX_GROUPS = {
    "closed_tetrad": 12,
    "open_tetrad": 12,
    "open_triad": 20,
    "proximity_pair": 20,
    "parallel_pair": 12,
    "antenna": 4,
}

# Overlap of parallel lines that makes them a pair, relative to the shorter one. Less pairs lines of unrelated parts.
PARALLEL_OVERLAP = 0.4

# Largest width of a rod relative to its length, and to the region's diagonal. Wider pairs are sides of a face.
ROD_WIDTH, ROD_WIDTH_OF_REGION = 0.4, 0.08

# Largest angle between parallel lines, and smallest between lines that form a corner. Reach of a corner, and gap of an
# open tetrad, relative to the region's diagonal. Chosen by eye.
PARALLEL_RAD, CORNER_RAD = np.radians(8.0), np.radians(12.0)
CORNER_REACH, TETRAD_GAP = 0.08, 0.25

# Largest distance between centres of one tetrad that is detected twice, from noise of its corners; chosen by eye.
SAME_TETRAD_PX = 3.0

# Largest number of triads, from which tetrads are made; chosen by eye.
MAX_TRIADS = 48

# Smallest area of a triad [px2]: smaller ones are pieces of one thick line.
MIN_TRIAD_PX2 = 40.0


@dataclass(frozen=True, eq=False)
class Lines:
    """Segments with the quantities needed for grouping.

    Parameters
    ----------
    ends : (N, 2, 2) array
        End points.
    direction : (N, 2) array
        Unit direction vectors.
    length : (N,) array
        Lengths [px].
    """

    ends: Array
    direction: Array
    length: Array

    @staticmethod
    def from_segments(segments: Array) -> Lines:
        """Make lines from segments (N, 4) x0 y0 x1 y1."""
        ends = np.asarray(segments, float).reshape(-1, 2, 2)
        d = ends[:, 1] - ends[:, 0]
        length = np.linalg.norm(d, axis=1)
        return Lines(ends, d / np.maximum(length, 1e-9)[:, None], length)


def parallel_pairs(lines: Lines, angle_rad: float = PARALLEL_RAD) -> Array:
    """Return pairs (P, 2) of nearly parallel lines that overlap along their direction."""
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
    keep = overlap > PARALLEL_OVERLAP * np.minimum(lines.length[i], lines.length[j])
    return np.stack([i[keep], j[keep]], axis=-1)


def antennas(lines: Lines, pairs: Array, diagonal_px: float) -> Array:
    """Return parallel pairs (A, 2) that are much longer than wide: the outlines of rods."""
    if not len(pairs):
        return pairs
    i, j = pairs[:, 0], pairs[:, 1]
    middle = lines.ends[j].mean(axis=1) - lines.ends[i, 0]
    width = np.abs(_cross(lines.direction[i], middle))
    length = np.minimum(lines.length[i], lines.length[j])
    # less than a pixel apart they are one line, found twice
    is_rod = (width < ROD_WIDTH * length) & (width < ROD_WIDTH_OF_REGION * diagonal_px) & (width > 1.0)
    return np.asarray(pairs[is_rod])


@dataclass(frozen=True, eq=False)
class Corners:
    """Proximity pairs: two lines whose ends nearly meet at an angle.

    Parameters
    ----------
    line : (C, 2) array
        Indices of the two lines.
    end : (C, 2) array
        Which end of each line is at the corner.
    point : (C, 2) array
        Intersection of the lines.
    """

    line: Array
    end: Array
    point: Array


def proximity_pairs(lines: Lines, reach_px: float, least_angle_rad: float = CORNER_RAD) -> Corners:
    """Return the intersections within ``reach_px`` of one end of both lines, of at least ``least_angle_rad``."""
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
    # lines may be cut short by up to half of their length, or by the rounding of the Hough transform
    near = (di.min(axis=1) < np.minimum(reach_px, 0.5 * lines.length[i] + 3)) & (
        dj.min(axis=1) < np.minimum(reach_px, 0.5 * lines.length[j] + 3)
    )
    return Corners(np.stack([i[near], j[near]], axis=-1), np.stack([ei[near], ej[near]], axis=-1), p[near])


@dataclass(frozen=True, eq=False)
class Chains:
    """Open triads and closed tetrads as four points in order: far end, corner, corner, far end.

    Parameters
    ----------
    points : (T, 4, 2) or (T, 4, 3) array
        Far end, corner, corner, far end.
    closed : (T,) array
        True if a fourth line joins the far ends.
    """

    points: Array
    closed: Array


def image_triads(lines: Lines, corners: Corners, limit: int = MAX_TRIADS) -> Chains:
    """Return chains of three lines bent to the same side at both ends of the middle one, largest first."""
    corners_by_end: Dict[Tuple[int, int], List[Tuple[int, int, Array]]] = {}
    for (i, j), (ei, ej), p in zip(  # noqa: B905 - Python 3.9 has no strict=
        corners.line, corners.end, corners.point
    ):
        corners_by_end.setdefault((int(i), int(ei)), []).append((int(j), int(ej), p))
        corners_by_end.setdefault((int(j), int(ej)), []).append((int(i), int(ei), p))
    points, closed, size = [], [], []
    for m in range(len(lines.length)):
        for i, ei, pa in corners_by_end.get((m, 0), []):
            for j, ej, pb in corners_by_end.get((m, 1), []):
                if i == j:
                    continue
                far_i, far_j = lines.ends[i, 1 - ei], lines.ends[j, 1 - ej]
                # both arms on one side of the middle line: the outline of a face
                side_i = _cross(pb - pa, far_i - pa)
                side_j = _cross(pb - pa, far_j - pa)
                if side_i * side_j <= 0:
                    continue
                is_closed = False
                for k, _, p in corners_by_end.get((i, 1 - ei), []):
                    for k2, _, p2 in corners_by_end.get((j, 1 - ej), []):
                        if k == k2:
                            far_i, far_j, is_closed = p, p2, True
                quad = np.array([far_i, pa, pb, far_j])
                area = _area(quad)
                if area < MIN_TRIAD_PX2:
                    continue
                points.append(quad)
                closed.append(is_closed)
                size.append(area * (1 + is_closed))
    if not points:
        return Chains(np.zeros((0, 4, 2)), np.zeros(0, bool))
    order = np.argsort(-np.array(size))[:limit]
    return Chains(np.array(points)[order], np.array(closed, bool)[order])


@dataclass(frozen=True, eq=False)
class PointGroups:
    """Groups by kind, each (N, P, 2) or (N, P, 3) points in a matching order.

    Notes
    -----
    closed_tetrad: four corners in order. open_tetrad: far end, three corners, far end. open_triad: far end, two
    corners, far end. proximity_pair: far end, corner, far end. parallel_pair: both ends of one line, then of the
    other, in the same direction. antenna: both ends of the axis.
    """

    by_kind: Dict[str, Array]

    def of_kind(self, kind: str) -> Array:
        """Return the groups (N, P, D) of a kind."""
        return self.by_kind[kind]


def image_point_groups(segments: Array, diagonal_px: float) -> PointGroups:
    """Return the groups among merged segments (N, 4)."""
    lines = Lines.from_segments(segments)
    corners = proximity_pairs(lines, CORNER_REACH * diagonal_px)
    chains = image_triads(lines, corners)
    parallel = parallel_pairs(lines)
    rods = antennas(lines, parallel, diagonal_px)
    pairs = [
        np.stack([lines.ends[i, 1 - ei], p, lines.ends[j, 1 - ej]])
        for (i, j), (ei, ej), p in zip(corners.line, corners.end, corners.point)  # noqa: B905 - 3.9 has no strict=
    ]
    by_kind = {
        "closed_tetrad": _unique(chains.points[chains.closed]),
        "open_tetrad": _open_tetrads(chains, lines, TETRAD_GAP * diagonal_px),
        "open_triad": chains.points[~chains.closed],
        "proximity_pair": np.array(pairs).reshape(-1, 3, 2),
        "parallel_pair": np.array(
            [same_direction(lines.ends[i], lines.ends[j]) for i, j in parallel]
        ).reshape(-1, 4, 2),
        "antenna": np.array([_axis(lines.ends[i], lines.ends[j]) for i, j in rods]).reshape(-1, 2, 2),
    }
    return PointGroups({kind: _largest(points, MAX_GROUPS[kind]) for kind, points in by_kind.items()})


def _largest(points: Array, keep: int) -> Array:
    if len(points) <= keep:
        return points
    extent = np.ptp(points, axis=1).sum(axis=1)
    return np.asarray(points[np.argsort(-extent, kind="stable")[:keep]])


def _unique(quads: Array) -> Array:
    """Return each closed tetrad once; it is detected from all four sides."""
    out: List[Array] = []
    for q in quads:
        centre = q.mean(axis=0)
        if all(np.abs(centre - o.mean(axis=0)).max() > SAME_TETRAD_PX for o in out):
            out.append(q)
    return np.array(out).reshape(-1, 4, 2)


def _open_tetrads(chains: Chains, lines: Lines, gap_px: float) -> Array:
    """Return open tetrads: a triad whose far end meets a fourth line that runs back towards the other far end."""
    out: List[Array] = []
    for points, closed in zip(chains.points, chains.closed):  # noqa: B905 - Python 3.9 has no strict=
        if closed:
            continue
        for p in (points, points[::-1]):
            d = np.linalg.norm(lines.ends - p[3], axis=2)
            # the fourth line starts where the third ends, but for a part of the gap and the Hough transform's rounding
            for k in np.flatnonzero(d.min(axis=1) < 0.15 * gap_px + 2.0):
                far = lines.ends[k, 1 - int(d[k].argmin())]
                if np.linalg.norm(far - p[0]) < gap_px and np.linalg.norm(far - p[2]) > gap_px:
                    out.append(np.concatenate([p, far[None]]))
    return np.array(out).reshape(-1, 5, 2)


def same_direction(a: Array, b: Array) -> Array:
    """Return both ends of two lines, with the second reversed if it runs against the first."""
    return np.concatenate([a, b if (a[1] - a[0]) @ (b[1] - b[0]) > 0 else b[::-1]])


def _axis(a: Array, b: Array) -> Array:
    ends = same_direction(a, b)
    return 0.5 * (ends[:2] + ends[2:])


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _area(quad: Array) -> float:
    x, y = quad[:, 0], quad[:, 1]
    return 0.5 * abs(float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))))
