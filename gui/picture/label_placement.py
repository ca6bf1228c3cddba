"""Placement of names beside points of a picture, without overlap, with leader lines where necessary."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from flyaround.simulator.runtime.arrays import FloatArray

Point = tuple[float, float]
Rect = tuple[float, float, float, float]
NEAR_PX = 8.0  # distance of a name without a leader line from its point
FAR_PX = (26.0, 46.0, 70.0)  # distances of names with a leader line
MARK_PX = 5.0  # half the size of a point's mark, which names must not cover
GAP_PX = np.array([6.0, 2.0])  # gaps between two names, wide enough that two do not read as one word
# directions from the point in which its name may stand
_DIRECTIONS = np.array([(1, 0), (1, -1), (1, 1), (-1, 0), (-1, -1), (-1, 1), (0, -1), (0, 1)], float)


@dataclass(frozen=True)
class PlacedLabel:
    """The position of a name.

    Parameters
    ----------
    corner : Point
        Upper left corner of the name.
    lead : Point or None
        End of the leader line from the point; None without one.
    choice : int
        Index of the candidate position, for the next picture.
    """

    corner: Point
    lead: Point | None
    choice: int


def place_labels(
    points: Sequence[Point],
    sizes: Sequence[Point],
    place: Rect,
    *,
    last_choices: Sequence[int | None] = (),
    obstacles: Sequence[Rect] = (),
) -> list[PlacedLabel | None]:
    """Return a position for each name, or None if there is none left.

    Parameters
    ----------
    points : sequence of Point
        Points of the names.
    sizes : sequence of Point
        Width and height of each name.
    place : tuple of float
        X, y, width, height of the region for names.
    last_choices : sequence of int or None, optional
        Candidate of each name in the last picture, tried first, for stability.
    obstacles : sequence of tuple of float, optional
        Rectangles to avoid, x, y, width, height.
    """
    n = len(points)
    if n == 0:
        return []
    anchors = np.asarray(points, float)
    marks = np.hstack([anchors - MARK_PX, anchors + MARK_PX])
    x, y, w, h = place
    blocked = [np.array([a, b, a + c, b + d]) for a, b, c, d in obstacles]
    labels: list[PlacedLabel | None] = [None] * n
    middle = anchors.mean(axis=0)
    # outermost first: there is space outside, which the others do not need
    away = np.linalg.norm(anchors - middle, axis=1)
    for k in sorted(range(n), key=lambda i: (-away[i], i)):
        boxes = candidates(anchors[k], sizes[k])
        inside = (boxes[:, 0] >= x) & (boxes[:, 1] >= y) & (boxes[:, 2] <= x + w) & (boxes[:, 3] <= y + h)
        occupied = np.vstack([np.delete(marks, k, axis=0), *(b[None] for b in blocked)])
        free = inside & ~_overlap(boxes, occupied).any(axis=1)
        if not free.any():
            continue
        last = last_choices[k] if k < len(last_choices) else None
        best = int(np.argmin(np.where(free, _cost(anchors[k] - middle), np.inf)))
        choice = last if last is not None and free[last] else best
        box = boxes[choice]
        lead = None
        if choice >= len(_DIRECTIONS):
            lead = pixel_of(np.clip(anchors[k], box[:2], box[2:]))
        labels[k] = PlacedLabel(pixel_of(box), lead, choice)
        blocked.append(box + np.hstack([-GAP_PX, GAP_PX]))
    return labels


def is_free(place: Rect, obstacles: Iterable[Rect]) -> bool:
    """Return True if a rectangle touches none of others, each x, y, width, height."""
    x, y, width, height = place
    return all(x + width < a or a + w < x or y + height < b or b + h < y for a, b, w, h in obstacles)


def candidates(anchor: FloatArray, size: Point) -> FloatArray:
    """Return (32, 4) boxes around a point: eight beside it, then eight at each distance with a leader line."""
    half = np.array(size) / 2
    away = half + np.outer([NEAR_PX, *FAR_PX], [1.0, 0.6])
    middles = anchor + (_DIRECTIONS * away[:, None]).reshape(-1, 2)
    return np.hstack([middles - half, middles + half])


def _cost(outward: FloatArray) -> FloatArray:
    """Return (32,) costs of the candidates: outward before inward, near before far, beside before above."""
    unit = outward / max(float(np.linalg.norm(outward)), 1e-9)
    towards = _DIRECTIONS / np.linalg.norm(_DIRECTIONS, axis=1, keepdims=True) @ unit
    rank = np.arange(len(_DIRECTIONS)) * 0.02 - towards
    return np.concatenate([0.8 * ring + rank for ring in range(1 + len(FAR_PX))])


def _overlap(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return (n, m) True where boxes x0 y0 x1 y1 overlap."""
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum(a[:, None, 2:], b[None, :, 2:])
    return np.asarray((high > low).all(axis=2))


def pixel_of(p: FloatArray) -> Point:
    """Return the first two numbers of an array.

    Returns
    -------
    Point
        X and y.
    """
    return (float(p[0]), float(p[1]))
