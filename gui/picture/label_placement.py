"""Names beside points of a picture: none over another one, with a line to its point where it had to move away."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.runtime.arrays import FloatArray

Point = tuple[float, float]
NEAR = 8.0
"""Distance of a name from its point where nothing is in the way."""
LED = (26.0, 46.0, 70.0)
"""Distances at which a name is led to its point by a line."""
MARK = 5.0
"""Half the side of a point's mark: names stay clear of all of them."""
GAP = 2.0
"""Between two names."""
_DIRECTIONS = np.array([(1, 0), (1, -1), (1, 1), (-1, 0), (-1, -1), (-1, 1), (0, -1), (0, 1)], float)


@dataclass(frozen=True)
class PlacedLabel:
    """The place of a name.

    Parameters
    ----------
    corner : its upper left corner. lead : where a line from the point ends; None where the name is right beside it.
    choice : which of the candidates it is, for the next picture.
    """

    corner: Point
    lead: Point | None
    choice: int


def place_labels(
    points: Sequence[Point],
    sizes: Sequence[Point],
    place: tuple[float, float, float, float],
    *,
    kept: Sequence[int | None] = (),
    taken: Sequence[tuple[float, float, float, float]] = (),
) -> list[PlacedLabel | None]:
    """Return a place for each name, or None where there is none left.

    Parameters
    ----------
    points : of the names. sizes : width and height of each.
    place : x, y, width, height that names stay inside. taken : rectangles of the same form that they stay clear of.
    kept : candidate of each name in the last picture, tried first, so that names do not jump about.
    """
    n = len(points)
    if n == 0:
        return []
    anchors = np.asarray(points, float)
    marks = np.hstack([anchors - MARK, anchors + MARK])
    x, y, w, h = place
    blocked = [np.array([a, b, a + c, b + d]) for a, b, c, d in taken]
    found: list[PlacedLabel | None] = [None] * n
    middle = anchors.mean(axis=0)
    # the outermost first: there is room beyond them, and the others do not take it
    away = np.linalg.norm(anchors - middle, axis=1)
    for k in sorted(range(n), key=lambda i: (-away[i], i)):
        boxes = candidates(anchors[k], sizes[k])
        inside = (boxes[:, 0] >= x) & (boxes[:, 1] >= y) & (boxes[:, 2] <= x + w) & (boxes[:, 3] <= y + h)
        others = np.vstack([np.delete(marks, k, axis=0), *(b[None] for b in blocked)])
        free = inside & ~_overlap(boxes, others).any(axis=1)
        if not free.any():
            continue
        last = kept[k] if k < len(kept) else None
        best = int(np.argmin(np.where(free, _cost(anchors[k] - middle), np.inf)))
        choice = last if last is not None and free[last] else best
        box = boxes[choice]
        lead = None
        if choice >= len(_DIRECTIONS):
            end = np.clip(anchors[k], box[:2], box[2:])
            lead = (float(end[0]), float(end[1]))
        found[k] = PlacedLabel((float(box[0]), float(box[1])), lead, choice)
        blocked.append(box + np.array([-GAP, -GAP, GAP, GAP]))
    return found


def candidates(point: FloatArray, size: Point) -> FloatArray:
    """Return (32, 4) boxes about a point: eight beside it, then eight at each distance with a leader line."""
    half = np.array(size) / 2
    boxes = []
    for distance in (NEAR, *LED):
        middle = point + _DIRECTIONS * (half + distance * np.array([1.0, 0.6]))
        boxes.append(np.hstack([middle - half, middle + half]))
    return np.vstack(boxes)


def _cost(outward: FloatArray) -> FloatArray:
    """Return (32,) of the candidates: outward before inward, near before far, beside before above."""
    unit = outward / max(float(np.linalg.norm(outward)), 1e-9)
    towards = _DIRECTIONS / np.linalg.norm(_DIRECTIONS, axis=1, keepdims=True) @ unit
    rank = np.arange(len(_DIRECTIONS)) * 0.02 - towards
    return np.concatenate([0.8 * ring + rank for ring in range(1 + len(LED))])


def _overlap(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return (n, m) whether boxes x0 y0 x1 y1 overlap."""
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum(a[:, None, 2:], b[None, :, 2:])
    return np.asarray((high > low).all(axis=2))
