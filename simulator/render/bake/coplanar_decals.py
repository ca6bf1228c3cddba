"""Coplanar decals: thin bodies that lie flat on a face of another, as solar cells, foils and labels do.

Coarse shadow maps may leave them out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

if TYPE_CHECKING:
    from simulator.runtime.arrays import BoolArray, Float32Array, FloatArray, IntArray

HIGHEST = 1.5e-3
"""Of the mesh's radius: a thicker body is no decal."""
_PLACE = 2e-6  # of the radius: corners nearer than this are one
_MOST_TRIANGLES = 128  # of a body that is looked at
_TURN = 1e-3  # by which a body's top may be turned from the face that it lies on
_INWARDS = 0.02  # by which a body's corners are drawn to its middle: edges may end together
_MOST = 200_000  # triangles of a mesh: nothing is looked for on a finer one
_MOST_PAIRS = 2_000_000  # of corners, and triangles that may be below them


def decal_heights(positions_m: FloatArray, triangles: IntArray, radius_m: float) -> Float32Array:
    """(T,) height of each triangle's decal above the face that it lies on [m]; infinite where it belongs to none.

    A body thicker than `HIGHEST` of the radius is no decal.

    Parameters
    ----------
    positions_m : (K, 3). triangles : (T, 3). radius_m : of the mesh's bounding sphere.
    """
    heights = np.full(len(triangles), np.inf, np.float32)
    if len(triangles) > _MOST:
        return heights
    highest = HIGHEST * radius_m
    corners = positions_m[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double_area = np.linalg.norm(normals, axis=1)
    normals /= np.maximum(double_area, 1e-30)[:, None]
    order, starts = _connected_bodies(positions_m, triangles, _PLACE * radius_m)
    counts = np.diff(starts, append=len(order))
    body = np.empty(len(order), int)
    body[order] = np.repeat(np.arange(len(starts)), counts)
    # a flat body's top is among its largest faces
    top = np.lexsort((-double_area, body))[starts]
    above = np.einsum("ijk,ik->ij", corners, normals[top[body]])
    low = np.minimum.reduceat(above.min(axis=1)[order], starts)
    high = np.maximum.reduceat(above.max(axis=1)[order], starts)
    is_flat = (counts <= _MOST_TRIANGLES) & (high - low < highest)
    floors = np.flatnonzero(~is_flat[body])
    turns = np.unique(np.round(normals[top[is_flat]] / _TURN).astype(int), axis=0) * _TURN
    for turn in turns:
        turned = is_flat & (np.abs(normals[top] - turn).max(axis=1) < _TURN)
        exact = normals[top[np.argmax(turned)]]
        members = np.flatnonzero(turned[body])
        # each place once: bodies share none
        vertex, first = np.unique(triangles[members], return_index=True)
        of = body[members[first // 3]]
        for n in (exact, -exact):
            floor = floors[normals[floors] @ n > 1 - _TURN**2]
            stands = _heights_above(positions_m[vertex], of, corners[floor], n, highest)
            heights[members] = np.minimum(heights[members], stands[body[members]])
    return heights


def _connected_bodies(
    positions_m: FloatArray, triangles: IntArray, step_m: float
) -> tuple[IntArray, IntArray]:
    """Triangles ordered by connected body, and the first of each body."""
    cell = np.rint(positions_m / step_m).astype(np.int64)
    cell -= cell.min(axis=0)
    span = cell.max(axis=0) + 1
    _, place = np.unique((cell[:, 0] * span[1] + cell[:, 1]) * span[2] + cell[:, 2], return_inverse=True)
    place = place[triangles]
    n = int(place.max()) + 1
    start, end = place[:, :2].ravel(), place[:, 1:].ravel()
    _, label = connected_components(coo_matrix((np.ones(len(start), bool), (start, end)), shape=(n, n)))
    of = label[place[:, 0]]
    order = np.argsort(of, kind="stable")
    return order, np.flatnonzero(np.diff(of[order], prepend=-1))


def _heights_above(
    places_m: FloatArray, body: IntArray, floor_m: FloatArray, n: FloatArray, highest_m: float
) -> Float32Array:
    """(B,) height of bodies above the faces below them; infinite where a body lies partly on none.

    Parameters
    ----------
    places_m : (K, 3) the bodies' corners. body : (K,) their numbers. floor_m : (F, 3, 3) of the faces.
    n : unit normal of those faces.
    """
    count = int(body.max()) + 1
    up, offset = places_m @ n, (floor_m @ n).mean(axis=1)
    high, low, lowest = np.full(count, -np.inf), np.full(count, np.inf), np.full(count, np.inf)
    np.maximum.at(high, body, up)
    np.minimum.at(low, body, up)
    near = (offset <= up.max()) & (offset >= up.min() - highest_m)
    if not near.any():
        return lowest.astype(np.float32)
    offset = offset[near]
    x = np.cross(n, [0.0, 0.0, 1.0] if abs(n[2]) < 0.9 else [1.0, 0.0, 0.0])
    x /= np.linalg.norm(x)
    plane = np.stack([x, np.cross(n, x)], axis=1)
    floor, flat = floor_m[near] @ plane, places_m @ plane
    members = np.maximum(np.bincount(body, minlength=count), 1)
    middle = np.stack([np.bincount(body, column, count) for column in flat.T], axis=1) / members[:, None]
    points = flat + _INWARDS * (middle[body] - flat)
    below = np.full(len(points), -np.inf)
    step = max(_MOST_PAIRS // len(floor), 1)
    for first in range(0, len(points), step):
        part = slice(first, first + step)
        fits = (offset <= high[body[part], None]) & (offset >= low[body[part], None] - highest_m)
        below[part] = np.where(fits & _points_in_triangles(points[part], floor), offset, -np.inf).max(axis=1)
    np.minimum.at(lowest, body, below)
    stands = high - lowest
    return np.where(stands < highest_m, stands, np.inf).astype(np.float32)


def _points_in_triangles(points: FloatArray, triangles: FloatArray) -> BoolArray:
    """(K, F) which points (K, 2) lie in which triangles (F, 3, 2), counter-clockwise."""
    found = np.ones((len(points), len(triangles)), bool)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        along = triangles[:, b] - triangles[:, a]
        constant = along[:, 1] * triangles[:, a, 0] - along[:, 0] * triangles[:, a, 1]
        found &= points @ np.stack([-along[:, 1], along[:, 0]]) + constant >= -1e-12
    return found
