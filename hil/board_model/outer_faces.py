"""Outer faces of a target, few enough for a board to render."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from flyaround.simulator.geometry.directions import sphere_directions
from flyaround.simulator.geometry.triangles import face_vectors
from flyaround.simulator.runtime.arrays import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.targets.model import Part

# Least visible area of a triangle, and of a part that a coarser level of detail omits [m2].
MIN_TRIANGLE_M2, MIN_PART_M2 = 2e-6, 2.5e-3

# Increments of the additive recurrence by the plastic number, 1 / g and 1 / g^2: M. Roberts (2018), The unreasonable
# effectiveness of quasirandom sequences.
RECURRENCE = (0.7548776662466927, 0.5698402909980532)

# Cosine of 88.9 degrees: faces seen under a larger angle are edge-on and have no area to be seen.
MIN_FACING_COSINE = 0.02

# Side of a depth cell and tolerance of its depth [sample spacings]: a cell holds three points of a face seen head-on,
# so that none is empty; the tolerance admits the rise of a slanted face over part of a cell.
CELL_PITCHES, DEPTH_PITCHES = 1.8, 0.4

# Distance beyond which a triangle is a part of its own [MIN_DISTANCE_SHARE]; nearer, it may be another surface of the
# same part. Chosen by eye.
PROTRUDING = 3.0

# Rounding of corners by which triangles are neighbours [m], the plane tolerance of the tree.
CORNER_ROUNDING_M = 2e-5

# Number of view directions, and spacing of the surface sample points [share of the target's size]. More directions find
# faces in narrow gaps.
DIRECTIONS, SAMPLE_SPACING = 32, 0.0022

# Largest share of a hidden face's points that appear visible through gaps between the sample points in front. A larger
# one drops faces seen through real gaps.
MAX_LEAK_SHARE = 0.015

# Largest number of triangles that a board renders in time.
MAX_TRIANGLES = 9000

# Largest number of visible triangles; parts with the largest visible area per triangle come first. Triangles within
# MIN_DISTANCE_SHARE of the coarse model's surface and of the same material add no information [share of the target's
# size]. Least visible area of a triangle and of a part [share of the size, squared].
MAX_VISIBLE, MIN_DISTANCE_SHARE, MIN_TRIANGLE, MIN_PART = 4200, 0.006, 1e-7, 1e-4

# Cosine of 0.26 degrees, within which triangles are halves of one quadrilateral.
COPLANAR_COSINE = 1 - 1e-5

# Weight of the area of parts that stand off the body, because they shape the outline and cast shadows.
PROTRUSION_WEIGHT = 3.0


def triangles_of(parts: Sequence[Part]) -> tuple[FloatArray, IntArray]:
    """Return the corners (T, 3, 3) [m] of every triangle, and the part (T,) that it belongs to."""
    corners = [p.positions_m.astype(float)[p.triangles] for p in parts]
    owner = [np.full(len(p.triangles), k) for k, p in enumerate(parts)]
    if not corners:
        return np.zeros((0, 3, 3)), np.zeros(0, np.int64)
    return np.concatenate(corners), np.concatenate(owner)


def visible_area(triangles_m: FloatArray) -> FloatArray:
    """Return the area (T,) of each triangle times the share of directions from which it is visible [m2].

    Points spread over the surface are sorted by depth along each direction; the nearest one in each cell of a grid is
    visible.
    """
    normal = face_vectors(triangles_m)
    double_area = np.linalg.norm(normal, axis=1)
    normal /= np.maximum(double_area, 1e-30)[:, None]
    pitch = SAMPLE_SPACING * float(np.ptp(triangles_m.reshape(-1, 3), axis=0).max())
    count = np.maximum(3, np.ceil(0.5 * double_area / pitch**2)).astype(int)
    owner = np.repeat(np.arange(len(triangles_m)), count)
    k = np.arange(len(owner))
    u, v = ((k * step) % 1 for step in RECURRENCE)
    fold = u + v > 1
    u[fold], v[fold] = 1 - u[fold], 1 - v[fold]
    a, b, c = (triangles_m[owner, i] for i in range(3))
    points = (a + u[:, None] * (b - a) + v[:, None] * (c - a)).astype(np.float32)
    n_visible, n_views = np.zeros(len(triangles_m)), np.zeros(len(triangles_m))
    for d in sphere_directions(DIRECTIONS):
        # any axis that is not nearly parallel
        x = np.cross([0.0, 0.0, 1.0] if abs(d[2]) < 0.8 else [1.0, 0.0, 0.0], d)
        x /= np.linalg.norm(x)
        front = np.flatnonzero((normal @ d > MIN_FACING_COSINE)[owner])
        p = points[front] @ np.stack([x, np.cross(d, x), -d]).T.astype(np.float32)
        cell = ((p[:, :2] - p[:, :2].min(axis=0)) / (CELL_PITCHES * pitch)).astype(int)
        flat = cell[:, 1] * (int(cell[:, 0].max()) + 1) + cell[:, 0]
        depth = np.full(int(flat.max()) + 1, np.inf, np.float32)
        far_first = np.argsort(-p[:, 2])
        depth[flat[far_first]] = p[far_first, 2]
        visible = owner[front[p[:, 2] <= depth[flat] + DEPTH_PITCHES * pitch]]
        n_visible += np.bincount(visible, minlength=len(triangles_m))
        n_views += np.bincount(owner[front], minlength=len(triangles_m))
    # an occasional empty cell makes inner faces appear visible
    n_visible[n_visible < MAX_LEAK_SHARE * n_views] = 0.0
    return np.asarray(0.5 * double_area * n_visible / (count * DIRECTIONS))


def outer_triangles(levels: Sequence[Sequence[Part]]) -> tuple[FloatArray, list[str]]:
    """Return the visible triangles (T, 3, 3) and the material of each.

    Parameters
    ----------
    levels : sequence of sequence of Part
        Parts of the target's levels of detail, coarsest first. Of the finer levels, only parts are used that the
        coarser ones omit and that are sufficiently visible.
    """
    parts = list(levels[0])
    have = {p.name for p in parts}
    for level in levels[1:]:
        added = [p for p in level if p.name not in have]
        have |= {p.name for p in added}
        parts += added
    triangles, owner = triangles_of(parts)
    if len(triangles) > MAX_TRIANGLES:
        return _most_informative_parts(parts, len(levels[0]))
    if not len(triangles):
        return np.zeros((0, 3, 3)), []
    area = visible_area(triangles)
    of_part = np.bincount(owner, area, len(parts))
    coarse = np.arange(len(parts)) < len(levels[0])
    keep = (area > MIN_TRIANGLE_M2) & (coarse | (of_part > MIN_PART_M2))[owner]
    return triangles[keep], [parts[k].material for k in owner[keep]]


def _most_informative_parts(parts: Sequence[Part], coarse: int) -> tuple[FloatArray, list[str]]:
    """Reduce a surplus of triangles to the ``coarse`` first parts and the parts most informative on attitude.

    On a round body, only a dish on a boom, horns and sensors break the symmetry.
    """
    nothing: tuple[FloatArray, list[str]] = np.zeros((0, 3, 3)), []
    if sum(len(p.triangles) for p in parts[:coarse]) > MAX_TRIANGLES:
        return nothing
    triangles, owner = triangles_of(parts)
    size = float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
    least = MIN_TRIANGLE * size**2
    first = owner < coarse
    surface, is_visible = first.copy(), visible_area(triangles) > least
    surface[first] = visible_area(triangles[first]) > least
    hidden = np.flatnonzero(is_visible & ~first)
    new = np.zeros(len(triangles))
    new[hidden] = _distinctiveness(parts, triangles, owner, surface, hidden, MIN_DISTANCE_SHARE * size)
    side = face_vectors(triangles)
    new_area = np.bincount(owner, 0.5 * np.linalg.norm(side, axis=1) * new, len(parts))
    number = np.bincount(owner, is_visible, len(parts)).astype(int)
    chosen_parts, count = np.arange(len(parts)) < coarse, int(surface.sum())
    for k in np.argsort(-new_area / np.maximum(number, 1)):
        if not chosen_parts[k] and new_area[k] > MIN_PART * size**2 and count + number[k] <= MAX_VISIBLE:
            chosen_parts[k] = True
            count += number[k]
    # faces hidden only by omitted parts become visible
    face_indices = np.flatnonzero(chosen_parts[owner])
    face_indices = face_indices[visible_area(triangles[face_indices]) > least]
    return triangles[face_indices], [parts[k].material for k in owner[face_indices]]


def _distinctiveness(
    parts: Sequence[Part],
    triangles_m: FloatArray,
    owner: IntArray,
    surface: BoolArray,
    candidates: IntArray,
    within_m: float,
) -> FloatArray:
    """Return weights of triangles near a surface: 1 for another material, `PROTRUSION_WEIGHT` if well off it, else 0.

    Parameters
    ----------
    parts : sequence of Part
        Parts of the target.
    triangles_m : (T, 3, 3) array
        Triangles, target frame [m].
    owner : IntArray
        Part of each triangle.
    surface : BoolArray
        Mask (T,) of the triangles that form the surface.
    candidates : IntArray
        Indices of the triangles to weight.
    within_m : float
        Distance within which a triangle of the same material adds no information.
    """
    names = sorted({p.material for p in parts})
    material = np.array([names.index(p.material) for p in parts])[owner]
    # sample points all over the surface, no farther apart than half of ``within_m``
    points, owners = [], []
    for k in np.flatnonzero(surface):
        a, b, c = triangles_m[k]
        n = 1 + int(2.0 * max(np.linalg.norm(b - a), np.linalg.norm(c - a)) / within_m)
        u, v = (x.ravel() / n for x in np.mgrid[0 : n + 1, 0 : n + 1])
        inside = u + v <= 1.0
        points.append(a + u[inside, None] * (b - a) + v[inside, None] * (c - a))
        owners.append(np.full(int(inside.sum()), material[k]))
    if not points:
        return np.ones(len(candidates))
    distance, nearest = cKDTree(np.concatenate(points)).query(triangles_m[candidates].mean(axis=1))
    is_other = (distance > within_m) | (np.concatenate(owners)[nearest] != material[candidates])
    return np.where(distance > PROTRUDING * within_m, PROTRUSION_WEIGHT, is_other.astype(float))


def merge_triangle_pairs(triangles_m: FloatArray, material: Sequence[str]) -> tuple[FloatArray, list[str]]:
    """Join coplanar triangles of one material in pairs if the result is convex: faces (F, 4, 3).

    Rendering two halves would leave a seam. The last corner of a single triangle is repeated.
    """
    normal = face_vectors(triangles_m)
    twice_area = np.linalg.norm(normal, axis=1)
    normal = normal / np.maximum(twice_area, 1e-30)[:, None]
    key = np.round(triangles_m / CORNER_ROUNDING_M).astype(np.int64)
    faces_by_edge: dict[tuple[bytes, bytes], list[tuple[int, int]]] = {}
    for i in range(len(triangles_m)):
        for a in range(3):
            faces_by_edge.setdefault((key[i, a].tobytes(), key[i, (a + 1) % 3].tobytes()), []).append((i, a))
    used = np.zeros(len(triangles_m), bool)
    faces, of = [], []
    for i in np.argsort(-twice_area):
        if used[i]:
            continue
        used[i] = True
        best, partner = 0.0, -1
        face = triangles_m[i, [0, 1, 2, 2]]
        for a in range(3):
            for j, b in faces_by_edge.get((key[i, (a + 1) % 3].tobytes(), key[i, a].tobytes()), []):
                if used[j] or material[j] != material[i] or normal[i] @ normal[j] < COPLANAR_COSINE:
                    continue
                joined = np.array(
                    [
                        triangles_m[i, a],
                        triangles_m[j, (b + 2) % 3],
                        triangles_m[i, (a + 1) % 3],
                        triangles_m[i, (a + 2) % 3],
                    ]
                )
                side = np.roll(joined, -1, axis=0) - joined
                turns = np.cross(side, np.roll(side, -1, axis=0)) @ normal[i]
                if turns.min() > 1e-12 and twice_area[j] > best:
                    best, partner, face = float(twice_area[j]), j, joined
        if partner >= 0:
            used[partner] = True
        faces.append(face)
        of.append(material[i])
    return np.array(faces).reshape(-1, 4, 3), of
