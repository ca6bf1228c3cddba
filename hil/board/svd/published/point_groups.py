"""Perceptual groups of the published method as ordered points: the same kinds on the picture and on the wireframe."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, List

import numpy as np

from flyaround.hil.board.svd.model.target_model import BoardModel
from flyaround.hil.board.svd.propose.perceptual_groups import (
    Chains,
    Lines,
    antennas,
    image_triads,
    model_triads,
    parallel_pairs,
    proximity_pairs,
)

Array = np.ndarray

KINDS = ("closed_tetrad", "open_tetrad", "open_triad", "proximity_pair", "parallel_pair", "antenna")

# Groups of each kind kept of a picture, the largest.
LARGEST = {
    "closed_tetrad": 12,
    "open_tetrad": 12,
    "open_triad": 20,
    "proximity_pair": 20,
    "parallel_pair": 12,
    "antenna": 4,
}


# Groups of the wireframe are as long as this at least, share of the model's radius.
LEAST_SIZE = 0.6


@dataclass(frozen=True, eq=False)
class PointGroups:
    """Groups by kind, each (N, P, 2) or (N, P, 3) points in an order that pairs them.

    Notes
    -----
    closed_tetrad: four corners in turn. open_tetrad: far end, three corners, far end. open_triad: far end, two
    corners, far end. proximity_pair: far end, corner, far end. parallel_pair: both ends of one line, then of the
    other, running alike. antenna: both ends of the axis.
    """

    by_kind: Dict[str, Array]

    def of(self, kind: str) -> Array:
        """(N, P, D) the groups of a kind."""
        return self.by_kind[kind]


def image_point_groups(segments: Array, diagonal_px: float) -> PointGroups:
    """Groups among merged segments (N, 4)."""
    lines = Lines.of(segments)
    corners = proximity_pairs(lines, 0.08 * diagonal_px)
    chains = image_triads(lines, corners)
    parallel = parallel_pairs(lines)
    rods = antennas(lines, parallel, diagonal_px)
    pairs = [
        np.stack([lines.ends[i, 1 - ei], p, lines.ends[j, 1 - ej]])
        for (i, j), (ei, ej), p in zip(corners.line, corners.end, corners.point)  # noqa: B905 - 3.9 has no strict=
    ]
    by_kind = {
        "closed_tetrad": _unique(chains.points[chains.closed]),
        "open_tetrad": _broken(chains, lines, 0.25 * diagonal_px),
        "open_triad": chains.points[~chains.closed],
        "proximity_pair": np.array(pairs).reshape(-1, 3, 2),
        "parallel_pair": np.array([_alike(lines.ends[i], lines.ends[j]) for i, j in parallel]).reshape(
            -1, 4, 2
        ),
        "antenna": np.array([_axis(lines.ends[i], lines.ends[j]) for i, j in rods]).reshape(-1, 2, 2),
    }
    return PointGroups({kind: _largest(points, LARGEST[kind]) for kind, points in by_kind.items()})


def model_point_groups(model: BoardModel) -> PointGroups:
    """Groups of the wireframe, in every order that a group of the picture could be paired in.

    The published wireframe holds panel, body and antennas alone; groups of smaller parts are left out likewise.
    """
    chains = model_triads(model)
    chains = _large(chains, LEAST_SIZE * model.radius_m)
    # a closed face stands in the chains once for each side as the middle one and each sense: all its orders
    closed = chains.points[chains.closed]
    plain = [e for e in model.wireframe if e.radius_m == 0]
    ends = np.array([[e.a_m, e.b_m] for e in plain]).reshape(-1, 2, 3)
    ends = ends[np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) > 0.5 * LEAST_SIZE * model.radius_m]
    rods = np.array([[e.a_m, e.b_m] for e in model.wireframe if e.radius_m > 0]).reshape(-1, 2, 3)
    corners = _model_corners(ends)
    return PointGroups(
        {
            "closed_tetrad": closed,
            "open_tetrad": np.concatenate([closed, closed[:, :1]], axis=1),
            "open_triad": chains.points,
            "proximity_pair": np.concatenate([corners, corners[:, ::-1]]),
            "parallel_pair": _model_parallel(ends),
            "antenna": np.concatenate([rods, rods[:, ::-1]]),
        }
    )


def _large(chains: Chains, least_m: float) -> Chains:
    keep = np.linalg.norm(np.ptp(chains.points, axis=1), axis=1) > least_m
    return Chains(chains.points[keep], chains.closed[keep])


def _largest(points: Array, keep: int) -> Array:
    if len(points) <= keep:
        return points
    extent = np.ptp(points, axis=1).sum(axis=1)
    return np.asarray(points[np.argsort(-extent, kind="stable")[:keep]])


def _unique(quads: Array) -> Array:
    """Each closed tetrad once: its four sides have each found it."""
    out: List[Array] = []
    for q in quads:
        centre = q.mean(axis=0)
        if all(np.abs(centre - o.mean(axis=0)).max() > 3.0 for o in out):
            out.append(q)
    return np.array(out).reshape(-1, 4, 2)


def _broken(chains: Chains, lines: Lines, gap_px: float) -> Array:
    """Open tetrads: a triad whose one far end meets a fourth line that runs back towards the other far end."""
    out: List[Array] = []
    for points, closed in zip(chains.points, chains.closed):  # noqa: B905 - Python 3.9 has no strict=
        if closed:
            continue
        for p in (points, points[::-1]):
            d = np.linalg.norm(lines.ends - p[3], axis=2)
            for k in np.flatnonzero(d.min(axis=1) < 0.15 * gap_px + 2.0):
                far = lines.ends[k, 1 - int(d[k].argmin())]
                if np.linalg.norm(far - p[0]) < gap_px and np.linalg.norm(far - p[2]) > gap_px:
                    out.append(np.concatenate([p, far[None]]))
    return np.array(out).reshape(-1, 5, 2)


def _alike(a: Array, b: Array) -> Array:
    """Both ends of two lines, the second turned to run as the first."""
    return np.concatenate([a, b if (a[1] - a[0]) @ (b[1] - b[0]) > 0 else b[::-1]])


def _axis(a: Array, b: Array) -> Array:
    both = _alike(a, b)
    return 0.5 * (both[:2] + both[2:])


def _model_corners(ends: Array) -> Array:
    """(N, 3, 3) far end, corner, far end of edges that meet at an angle."""
    out: List[Array] = []
    for i in range(len(ends)):
        for j in range(i + 1, len(ends)):
            gap = np.linalg.norm(ends[i][:, None] - ends[j][None], axis=2)
            ei, ej = np.unravel_index(int(gap.argmin()), (2, 2))
            if gap[ei, ej] > 0.02:
                continue
            a, b = ends[i, 1 - ei] - ends[i, ei], ends[j, 1 - ej] - ends[j, ej]
            if np.linalg.norm(np.cross(a, b)) > 0.2 * np.linalg.norm(a) * np.linalg.norm(b):
                out.append(np.stack([ends[i, 1 - ei], ends[i, ei], ends[j, 1 - ej]]))
    return np.array(out).reshape(-1, 3, 3)


def _model_parallel(ends: Array, most: int = 120) -> Array:
    """(N, 4, 3) parallel edges that overlap, longest first, in both senses and both orders."""
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    order = np.argsort(-length, kind="stable")[:40]
    out: List[Array] = []
    for x, i in enumerate(order):
        d = (ends[i, 1] - ends[i, 0]) / max(length[i], 1e-9)
        for j in order[x + 1 :]:
            e = ends[j, 1] - ends[j, 0]
            if abs(float(d @ e)) < 0.999 * length[j]:
                continue
            s = np.sort((ends[j] - ends[i, 0]) @ d)
            if min(s[1], length[i]) - max(s[0], 0.0) > 0.4 * length[j]:
                out.append(_alike(ends[i], ends[j]))
    pairs = np.array(out[:most]).reshape(-1, 4, 3)
    swapped = pairs[:, [2, 3, 0, 1]]
    both = np.concatenate([pairs, swapped])
    return np.concatenate([both, both[:, [1, 0, 3, 2]]])
