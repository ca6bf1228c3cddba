"""Views of round craft: the occluding contour joins the wireframe, which says little of a cylinder's sides."""

from __future__ import annotations

from dataclasses import replace
from typing import Tuple

import numpy as np

from hil.board.svd.model.occluding_contours import Outlines
from hil.board.svd.model.target_model import BoardModel
from hil.board.svd.propose.templates import SHAPE_SAMPLES, TURNS, ViewTable

Array = np.ndarray

# Share of the outlines' points on surfaces curved more gently than a tenth of the craft, from which it counts as round.
ROUND, GENTLE = 0.08, 0.1

# Share of a view's template that is taken from the outline.
SHARE = 0.5


def is_round(model: BoardModel) -> bool:
    """Whether much of the craft's outline lies on curved surfaces, where no edge of the wireframe is."""
    if model.outlines is None:
        return False
    return float(np.mean(curved(model))) > ROUND


def curved(model: BoardModel) -> Array:
    """(V, N) which points of the outlines lie on gently curved surfaces."""
    assert model.outlines is not None  # noqa: S101 - the caller asked
    return np.asarray(model.outlines.radius_m > GENTLE * model.radius_m)


def with_outlines(table: ViewTable, outlines: Outlines, centre_m: Array) -> ViewTable:
    """The table with half of each view's template on the outline, and its boxes grown to hold it."""
    rng = np.random.default_rng(0)
    xy, angle, box = table.shape_xy.copy(), table.shape_angle.copy(), table.box.copy()
    turns = np.arange(TURNS) * 2 * np.pi / TURNS
    c, s = np.cos(turns), np.sin(turns)
    taken = int(SHARE * SHAPE_SAMPLES)
    for v, direction in enumerate(table.directions):
        C = centre_m + table.distance_m * direction
        p, a = _seen(outlines, table.R_camera_from_target[v], C, table.distance_m)
        px = p[:, :1] * c - p[:, 1:] * s
        py = p[:, :1] * s + p[:, 1:] * c
        low = np.stack([px.min(axis=0), py.min(axis=0)], axis=-1)
        high = np.stack([px.max(axis=0), py.max(axis=0)], axis=-1)
        box[v] = np.concatenate([np.minimum(box[v, :, :2], low), np.maximum(box[v, :, 2:], high)], axis=-1)
        # evenly along the outline, in place of every second sample of the wireframe
        stretch = len(p) / taken
        pick = np.floor((np.arange(taken) + rng.random(taken)) * stretch).astype(int) % len(p)
        at = np.linspace(0, SHAPE_SAMPLES - 1, taken).astype(int)
        xy[v, at], angle[v, at] = p[pick], a[pick]
    return replace(table, shape_xy=xy, shape_angle=angle, box=box)


def _seen(outlines: Outlines, R: Array, C_m: Array, distance_m: float) -> Tuple[Array, Array]:
    """The outline from ``C_m``: (N, 2) on the plane at unit distance times range [m], and its normals' angles."""
    points, normals = outlines.seen_from(int(outlines.nearest(C_m[None])[0]), C_m)
    P, n = (points - C_m) @ R.T, normals @ R.T
    p = P[:, :2] / np.maximum(P[:, 2:], 1e-6) * distance_m
    return p.astype(np.float32), np.mod(np.arctan2(n[:, 1], n[:, 0]), np.pi).astype(np.float32)
