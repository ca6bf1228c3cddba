"""Segmentation of a mesh into charts: coplanar faces, and small patches of finely meshed round faces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.geometry.topology import components
from flyaround.simulator.geometry.triangles import face_vectors

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import BoolArray, FloatArray, IntArray

_COPLANAR_COSINE = 0.9998  # cosine between neighbours in one plane
_SAME_PLANE_COSINE = 1 - 1e-6  # the same of a quad's halves on a finely meshed round face
# cosine with a set's mean normal below which its coplanar neighbours form a curved surface
_CURVED_COSINE = 0.9995
_PATCH_TEXELS = 3  # texels per side of a patch on a round face
# bins per unit of a normal's component: normals of a patch differ by about 10 degrees, or 20 if it may be in pieces
_NORMAL_BINS, _COARSE_NORMAL_BINS = 6, 3


def cut_charts(
    positions_m: FloatArray,
    groups: FloatArray,
    triangles: IntArray,
    normal: FloatArray,
    texel_m: float,
    *,
    touching: bool = True,
) -> tuple[IntArray, BoolArray]:
    """Return the (T,) chart of each triangle, and (T, 3) True where an edge is on its chart's border.

    Parameters
    ----------
    positions_m : (V, 3) array
        Vertices.
    groups : (V,) array
        Group numbers, never mixed in one chart.
    triangles : (T, 3) array
        Vertex indices.
    normal : (T, 3) array
        Of the triangles.
    texel_m : float
        Sets of triangles smaller than this may be merged with others of nearly the same normal.
    touching : bool, optional
        True if a chart must be connected by edges; otherwise a mesh in many pieces has fewer charts.
    """
    corners = positions_m[triangles]
    twice_area = np.linalg.norm(face_vectors(corners), axis=1)
    edge, other = _shared_edges(positions_m, groups, triangles)
    pairs = np.stack([edge, other], axis=1) // 3
    i, j = pairs.T
    cosine = np.einsum("kc,kc->k", normal[i], normal[j])
    plain = cosine > _COPLANAR_COSINE
    plane = components(pairs[plain], len(triangles))[1]
    is_bent = _bends(plane, normal, twice_area)[plane]
    if is_bent.any():
        plain &= ~is_bent[i] | (cosine > _SAME_PLANE_COSINE)
        plane = components(pairs[plain], len(triangles))[1]
    key, small = _patch_keys(
        corners,
        normal,
        twice_area,
        groups[triangles[:, 0]],
        plane,
        is_bent,
        texel_m,
        _NORMAL_BINS if touching else _COARSE_NORMAL_BINS,
    )
    patch = small[i] & small[j] & (key[i] == key[j])
    merged = np.where(small[i] | small[j], patch, plain)
    if touching:
        chart = components(pairs[merged], len(triangles))[1]
    else:
        large = plain & ~small[i] & ~small[j]
        whole = components(pairs[large], len(triangles))[1]
        _, chart = np.unique(np.where(small, -1 - key, whole), return_inverse=True)
    border = np.ones(3 * len(triangles), bool)
    border[edge[merged]] = border[other[merged]] = False
    return np.asarray(chart), border.reshape(-1, 3)


def _shared_edges(
    positions_m: FloatArray, groups: FloatArray, triangles: IntArray
) -> tuple[IntArray, IntArray]:
    """Return pairs (K,) of coincident edges, numbered 3 t, 3 t + 1, 3 t + 2 of triangle t."""
    keys = np.column_stack([np.rint(positions_m * 1e6), groups])
    order = np.lexsort(keys.T)
    new = np.any(keys[order[1:]] != keys[order[:-1]], axis=1)
    place = np.empty(len(order), np.int64)
    place[order] = np.concatenate([[0], np.cumsum(new)])
    corners = place[triangles]
    ends = np.stack([corners, np.roll(corners, -1, axis=1)])
    key = (ends.min(axis=0) * len(positions_m) + ends.max(axis=0)).ravel()
    order = np.argsort(key, kind="stable")
    same = key[order[1:]] == key[order[:-1]]
    return order[:-1][same], order[1:][same]


def _means(sets: IntArray, values: FloatArray, weight: FloatArray) -> FloatArray:
    """Return (S, 3) weighted means of values (T, 3) over sets (T,)."""
    total = np.bincount(sets, weight)
    return np.stack([np.bincount(sets, weight * v) for v in values.T], axis=1) / total[:, None]


def _bends(sets: IntArray, normal: FloatArray, twice_area: FloatArray) -> BoolArray:
    """Return (S,) True where the normal of some triangle in a set deviates from the mean."""
    mean = _means(sets, normal, np.maximum(twice_area, 1e-30))
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-30)
    # normals of slivers are undefined and are ignored
    is_curved = (np.einsum("tc,tc->t", normal, mean[sets]) < _CURVED_COSINE) & (twice_area > 1e-14)
    return np.bincount(sets, is_curved) > 0


def _patch_keys(
    corners_m: FloatArray,
    normal: FloatArray,
    twice_area: FloatArray,
    group: FloatArray,
    plane: IntArray,
    is_round: BoolArray,
    texel_m: float,
    normal_bins: int,
) -> tuple[IntArray, BoolArray]:
    """Return (T,) keys, equal for triangles of one group, position and normal, and (T,) True where triangles may merge.

    Parameters
    ----------
    corners_m : (T, 3, 3) array
        Corners of the triangles [m].
    normal : (T, 3) array
        Unit normals.
    twice_area : (T,) array
        Twice the areas [m2].
    group : (T,) array
        Group of each triangle; only triangles of one group merge.
    plane : (T,) array
        Sets of neighbours of nearly the same normal; a flat one gets one key, so that it stays whole.
    is_round : (T,) array
        True on a round face, whatever its size.
    texel_m : float
        Size of a texel [m].
    normal_bins : int
        Number of bins per component of a normal.
    """
    weight = np.maximum(twice_area, 1e-30)
    alone = _bends(plane, normal, twice_area)[plane]
    middle = corners_m.mean(axis=1)
    centre = np.where(alone[:, None], middle, _means(plane, middle, weight)[plane])
    facing = np.where(alone[:, None], normal, _means(plane, normal, weight)[plane])
    facing /= np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-30)
    order = np.argsort(plane, kind="stable")
    first = np.searchsorted(plane[order], np.arange(int(plane.max()) + 1))
    low = np.minimum.reduceat(corners_m.min(axis=1)[order], first)
    high = np.maximum.reduceat(corners_m.max(axis=1)[order], first)
    small = is_round | (np.linalg.norm(high - low, axis=1) < texel_m)[plane]
    columns = [*np.floor(centre / (_PATCH_TEXELS * texel_m)).T, *np.rint(facing * normal_bins).T]
    key = np.unique(group, return_inverse=True)[1].astype(np.int64)
    for column in columns:
        values = column.astype(np.int64)
        values -= values.min()
        key = key * (int(values.max()) + 1) + values
    return key, small
