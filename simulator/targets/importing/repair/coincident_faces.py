"""Coplanar faces that overlap (z-fighting).

Planes are grouped, boxes compared within a group, and remaining pairs tested exactly: two coplanar triangles overlap
unless one of their six edges separates them (separating axis theorem).

References
----------
Ericson (2005), Real-Time Collision Detection, 5.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from flyaround.simulator.geometry.plane_grid import PlaneGrid
from flyaround.simulator.geometry.topology import components, edge_table, face_bodies
from flyaround.simulator.geometry.triangles import face_vectors

if TYPE_CHECKING:
    from collections.abc import Iterator

    from flyaround.simulator.geometry.topology import MeshBody
    from flyaround.simulator.runtime.arrays import BoolArray, FloatArray, IntArray

MIN_SEPARATION = 1e-5
"""Distance between surfaces, relative to the craft's size, below which a depth buffer cannot resolve them."""
MAX_ANGLE_RAD = 2e-3
"""Angle within which faces count as parallel. A smaller one misses pairs whose corners are rounded in the file."""
MAX_ALL_PAIRS = 24
"""Number of faces in a plane up to which all pairs are compared."""
MAX_PAIRS = 20_000_000
"""Number of compared pairs above which the search ends without result; it bounds time and memory."""
CHUNK = 200_000  # pairs that are compared together


class TooManyFacesError(Exception):
    """Too many faces lie in one plane to be compared."""


@dataclass(frozen=True, eq=False)
class FaceTable:
    """Triangles of all bodies, with data that decide if two coincident ones can both be visible.

    Parameters
    ----------
    corners_m : (F, 3, 3) array
        Corners of the triangles.
    outward : (F, 3) array
        Unit normals, outwards on closed pieces.
    closed : (F,) array
        True on a closed piece.
    body : (F,) array
        Index of the body of each face.
    piece : (F,) array
        Index of the connected piece of each face.
    material : (F,) array
        Index of the material of each face.
    """

    corners_m: FloatArray
    outward: FloatArray
    closed: BoolArray
    body: IntArray
    piece: IntArray
    material: IntArray

    @staticmethod
    def from_bodies(bodies: list[MeshBody]) -> FaceTable:
        """Collect the faces of all non-empty bodies."""
        corners, closed, body, piece, outward = [], [], [], [], []
        count = 0
        for k, mesh in enumerate(bodies):
            table = edge_table(mesh.triangles)
            n_pieces, piece_of_face = face_bodies(mesh.triangles, table)
            is_open = np.zeros(n_pieces, bool)
            is_open[piece_of_face[table.first[table.open] // 3]] = True
            triangles = mesh.positions_m[mesh.triangles]
            volume = np.bincount(piece_of_face, six_volumes(triangles - triangles[0, 0]), n_pieces)
            normal = mesh.face_vectors / np.maximum(
                np.linalg.norm(mesh.face_vectors, axis=1, keepdims=True), 1e-30
            )
            corners.append(triangles)
            closed.append(~is_open[piece_of_face])
            outward.append(
                np.where(is_open[piece_of_face] | (volume[piece_of_face] >= 0), 1.0, -1.0)[:, None] * normal
            )
            body.append(np.full(len(triangles), k))
            piece.append(piece_of_face + count)
            count += n_pieces
        return FaceTable(
            corners_m=np.concatenate(corners),
            outward=np.concatenate(outward),
            closed=np.concatenate(closed),
            body=np.concatenate(body),
            piece=np.concatenate(piece),
            material=np.concatenate([mesh.face_material for mesh in bodies]),
        )

    def visible_conflicts(self, pairs: IntArray) -> IntArray:
        """Return the pairs of coincident faces that can be visible at the same time.

        Where two closed bodies touch, the faces are opposite and neither is visible. A sheet is visible from both
        sides. Faces of the same material and body are omitted, because they look alike.
        """
        a, b = pairs.T
        is_parallel = np.einsum("ij,ij->i", self.outward[a], self.outward[b]) > 0
        looks_alike = (self.body[a] == self.body[b]) & (self.material[a] == self.material[b])
        return pairs[(is_parallel | ~(self.closed[a] & self.closed[b])) & ~looks_alike]


def six_volumes(corners: FloatArray) -> FloatArray:
    """Return six times the signed volume (F,) of the tetrahedra between triangles (F, 3, 3) and the origin."""
    return np.asarray(np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])))


def coincident_pairs(
    corners_m: FloatArray,
    extent_m: float,
    within_m: FloatArray | None = None,
    required: BoolArray | None = None,
) -> IntArray | None:
    """Find pairs (K, 2) of coplanar faces that overlap; None if there are too many faces in a plane to compare.

    Parameters
    ----------
    corners_m : (F, 3, 3) array
        Corners of the triangles.
    extent_m : float
        Size of the craft.
    within_m : (F,) array, optional
        Largest distance of a face from its partner, by default `MIN_SEPARATION` of the craft; the larger of both
        counts.
    required : (F,) array, optional
        Faces, of which a pair must contain one.
    """
    nearest = MIN_SEPARATION * extent_m
    tolerance_m = np.full(len(corners_m), nearest) if within_m is None else within_m
    normal = face_vectors(corners_m)
    twice_area = np.linalg.norm(normal, axis=1)
    unit = normal / np.maximum(twice_area, 1e-30)[:, None]
    group = _plane_groups(corners_m, unit, float(tolerance_m.max(initial=nearest)))
    overlapping = [np.zeros((0, 2), np.int64)]
    total = 0
    try:
        for pairs in _candidates(corners_m, unit, group, float(tolerance_m.max(initial=nearest)), required):
            selected = pairs if required is None else pairs[required[pairs].any(axis=1)]
            total += len(selected)
            if total > MAX_PAIRS:
                return None
            for start in range(0, len(selected), CHUNK):
                batch = selected[start : start + CHUNK]
                batch = np.where(
                    (twice_area[batch[:, 0]] < twice_area[batch[:, 1]])[:, None],
                    batch[:, ::-1],
                    batch,
                )
                limit_m = tolerance_m[batch].max(axis=1)
                overlapping.append(batch[_overlap(corners_m, unit, batch, limit_m, 2 * nearest)])
    except TooManyFacesError:
        return None
    return np.unique(np.sort(np.concatenate(overlapping), axis=1), axis=0)


def _plane_groups(corners: FloatArray, unit: FloatArray, within_m: float) -> IntArray:
    """Return the group (F,) of nearly identical planes to which each face belongs, regardless of orientation."""
    middle = (corners.min(axis=(0, 1)) + corners.max(axis=(0, 1))) / 2
    # scaled so that one radius limits angle and distance
    distance = ((corners.mean(axis=1) - middle) * unit).sum(axis=1) * (MAX_ANGLE_RAD / within_m)
    planes = np.column_stack([unit, distance])
    rounded = np.round(planes / (MAX_ANGLE_RAD / 8)).astype(np.int64)
    key = rounded @ np.array([1, 1_000_003, 7_368_787, 2_147_483_647], np.int64)
    _, first, plane_of_face = np.unique(key, return_index=True, return_inverse=True)
    distinct = planes[first]
    tree = cKDTree(np.concatenate([distinct, -distinct]))
    links = tree.query_pairs(1.5 * MAX_ANGLE_RAD, output_type="ndarray") % len(distinct)
    _, label = components(links.reshape(-1, 2), len(distinct))
    return label[plane_of_face.ravel()]


def _candidates(
    corners: FloatArray, unit: FloatArray, group: IntArray, within_m: float, required: BoolArray | None
) -> Iterator[IntArray]:
    """Yield pairs (K, 2) of faces of one group whose boxes overlap, in batches."""
    order = np.argsort(group, kind="stable")
    begin = np.flatnonzero(np.diff(group[order], prepend=-1))
    size = np.diff(np.append(begin, len(order)))
    if required is not None:
        has_required = np.add.reduceat(required[order].astype(np.int64), begin) > 0
        begin, size = begin[has_required], size[has_required]
    low, high = corners.min(axis=1) - within_m, corners.max(axis=1) + within_m
    small_groups = (size > 1) & (size <= MAX_ALL_PAIRS)
    n = size[small_groups]
    # positions of all faces of small groups, and the number of later faces in the group
    ends = np.cumsum(n)
    position = np.arange(n.sum()) + np.repeat(begin[small_groups] - ends + n, n)
    n_later = np.repeat(begin[small_groups] + n, n) - position - 1
    a = np.repeat(position, n_later)
    b = a + 1 + np.arange(len(a)) - np.repeat(np.cumsum(n_later) - n_later, n_later)
    yield _overlapping_boxes(np.stack([order[a], order[b]], axis=1), low, high)
    for start, count in zip(begin[size > MAX_ALL_PAIRS], size[size > MAX_ALL_PAIRS], strict=True):
        faces = order[start : start + count]
        plane_axes = [k for k in range(3) if k != int(np.argmax(np.abs(unit[faces[0]])))]
        grid = PlaneGrid.over(np.concatenate([low[faces][:, plane_axes].T, high[faces][:, plane_axes].T]))
        n_listed = np.diff(grid.first)
        if float((n_listed.astype(float) ** 2).sum()) > 2 * MAX_PAIRS:
            raise TooManyFacesError
        for f, m in zip(grid.first[:-1][n_listed > 1], n_listed[n_listed > 1], strict=True):
            members = faces[grid.listed[f : f + m]]
            i, j = np.triu_indices(m, 1)
            yield _overlapping_boxes(np.stack([members[i], members[j]], axis=1), low, high)


def _overlapping_boxes(pairs: IntArray, low: FloatArray, high: FloatArray) -> IntArray:
    a, b = pairs.T
    return pairs[((low[a] <= high[b]) & (low[b] <= high[a])).all(axis=1)]


def _overlap(
    corners: FloatArray, unit: FloatArray, pairs: IntArray, within_m: FloatArray, min_overlap_m: float
) -> BoolArray:
    """Return (K,) True where the faces of a pair are coplanar and overlap by more than ``min_overlap_m``."""
    a, b = pairs.T
    normal = unit[a]
    parallel = np.abs(np.einsum("ij,ij->i", normal, unit[b])) > 1 - MAX_ANGLE_RAD**2 / 2
    A, B = corners[a], corners[b]
    distance = np.abs(np.einsum("kij,kj->ki", B - A[:, :1], normal)).max(axis=1, initial=0.0)
    overlap = parallel & (distance <= within_m)
    for first in (A, B):
        for k in range(3):
            axis = np.cross(normal, first[:, (k + 1) % 3] - first[:, k])
            axis /= np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-30)
            interval_a, interval_b = (np.einsum("kij,kj->ki", T - A[:, :1], axis) for T in (A, B))
            depth = np.minimum(interval_a.max(axis=1), interval_b.max(axis=1)) - np.maximum(
                interval_a.min(axis=1), interval_b.min(axis=1)
            )
            overlap &= depth > min_overlap_m
    return np.asarray(overlap)


def coincidence_lines(bodies: list[MeshBody], extent_m: float) -> list[str]:
    """Return a line for the user on faces that will flicker; empty if there are none."""
    faces = FaceTable.from_bodies(bodies)
    pairs = coincident_pairs(faces.corners_m, extent_m)
    if pairs is None:
        return ["too many faces are coplanar to search for coincident ones: check the contact sheet"]
    pairs = faces.visible_conflicts(pairs)
    if not len(pairs):
        return []
    first = pairs[0]
    names = sorted({bodies[int(faces.body[k])].name for k in first})
    where = f"parts {names[0]!r} and {names[1]!r}" if len(names) > 1 else f"part {names[0]!r}"
    x, y, z = faces.corners_m[min(first, key=lambda k: float(np.ptp(faces.corners_m[k])))].mean(axis=0)
    line = (
        f"{len(pairs):,} pairs of faces lie in one plane and overlap (the first of {where} at "
        f"({x:.3f}, {y:.3f}, {z:.3f}) m): pictures and labels show now one, now the other; move one of the two in "
        "the modelling tool, or leave it out"
    )
    return [line]
