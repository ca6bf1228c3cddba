"""Back-to-front order of faces from any viewpoint: a binary space partition by the planes of large faces.

A board without a depth buffer draws far faces first. The tree orders the large faces exactly from any viewpoint; small
faces are stored whole in its cells and sorted by distance there.

References
----------
Fuchs, Kedem & Naylor (1980), On visible surface generation by a priori tree structures, SIGGRAPH 14.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from flyaround.simulator.runtime.arrays import BoolArray, FloatArray, IntArray

# Distance within which a corner lies in a plane [m], and limit for a small face on a large one to be in front of it
# [m].
PLANE_TOLERANCE_M, FRONT_TOLERANCE_M = 2e-5, -2e-4

# Cost of a plane per large face cut, per small face cut, per face by which one side has more, and gain per face that
# lies in it. A cut adds a face for good, a small face only moves; chosen by hand for few faces of the built-in craft.
CUT_COST, SMALL_CUT_COST, IMBALANCE_COST, COPLANAR_GAIN = 4.0, 0.6, 0.3, 2.0

# Distance beyond which a small face counts as cut when planes are compared [m]; it is not cut.
SMALL_TOLERANCE_M = 1e-3

# Least length of the diagonals' cross product of a face, twice its area: smaller pieces of a cut are slivers [m2].
MIN_TWICE_AREA_M2 = 1e-9

# Largest number of planes tried at a node, and depth of the tree; remaining faces count as small ones.
MAX_PLANES, MAX_DEPTH = 200, 250


@dataclass
class FaceTree:
    """Faces in the order of the tree, with its nodes.

    Parameters
    ----------
    corners_m : list of (4, 3) array, optional
        Corners of each face [m].
    source : list of int, optional
        Index of the polygon that a face was cut from.
    plane : list of tuple of float, optional
        Splitting plane (nx, ny, nz, d) of each node, zero at leaves.
    children : list of tuple of int, optional
        Child nodes in front of and behind the plane; -1 for none.
    members : list of list of int, optional
        Indices of the faces of each node.
    """

    corners_m: list[FloatArray] = field(default_factory=list)
    source: list[int] = field(default_factory=list)
    plane: list[tuple[float, float, float, float]] = field(default_factory=list)
    children: list[tuple[int, int]] = field(default_factory=list)
    members: list[list[int]] = field(default_factory=list)


def build_tree(faces_m: FloatArray, large: BoolArray) -> FaceTree:
    """Build the tree of faces (F, 4, 3); the root is node 0.

    Parameters
    ----------
    faces_m : (F, 4, 3) array
        Corners of the faces, target frame [m].
    large : BoolArray
        Faces (F,) whose planes may split space.
    """
    tree = FaceTree()
    index = np.arange(len(faces_m))
    _grow(tree, faces_m[large], index[large], faces_m[~large], index[~large])
    return tree


def _grow(
    tree: FaceTree,
    large: FloatArray,
    large_index: IntArray,
    small: FloatArray,
    small_index: IntArray,
    depth: int = 0,
) -> int:
    """Add a node for some faces, recursively; return its index, or -1 without faces."""
    if not len(large) and not len(small):
        return -1
    node = len(tree.plane)
    tree.plane.append((0.0, 0.0, 0.0, 0.0))
    tree.children.append((-1, -1))
    tree.members.append([])
    if not len(large) or depth >= MAX_DEPTH:
        tree.members[node] = _add_faces(
            tree, np.concatenate([large, small]), np.concatenate([large_index, small_index])
        )
        return node
    plane, n, d = _best_plane(large, small)
    s = large @ n - d
    # a quadrilateral is not exactly planar: treat it as lying in its own plane, or it would be cut for ever
    s[plane] = 0.0
    front, behind = (s > PLANE_TOLERANCE_M).any(axis=1), (s < -PLANE_TOLERANCE_M).any(axis=1)
    on = ~front & ~behind
    tree.plane[node] = (float(n[0]), float(n[1]), float(n[2]), d)
    tree.members[node] = _add_faces(tree, large[on], large_index[on])
    cut = np.flatnonzero(front & behind)
    sides = []
    for sign, on_one_side in ((1.0, front & ~behind), (-1.0, behind & ~front)):
        pieces = [(piece, int(large_index[k])) for k in cut for piece in _clip(large[k], sign * s[k])]
        corners = np.concatenate([large[on_one_side], np.array([p for p, _ in pieces]).reshape(-1, 4, 3)])
        sides.append(
            (corners, np.concatenate([large_index[on_one_side], np.array([k for _, k in pieces], int)]))
        )
    in_front = small.mean(axis=1) @ n - d >= FRONT_TOLERANCE_M
    first = _grow(tree, *sides[0], small[in_front], small_index[in_front], depth + 1)
    second = _grow(tree, *sides[1], small[~in_front], small_index[~in_front], depth + 1)
    tree.children[node] = (first, second)
    return node


def _add_faces(tree: FaceTree, corners: FloatArray, source: IntArray) -> list[int]:
    start = len(tree.corners_m)
    tree.corners_m += list(corners)
    tree.source += source.tolist()
    return list(range(start, len(tree.corners_m)))


def _best_plane(large: FloatArray, small: FloatArray) -> tuple[int, FloatArray, float]:
    """Return the index and plane of the face that cuts the fewest others and divides them most evenly."""
    best: tuple[float, int, FloatArray, float] | None = None
    for k in range(0, len(large), -(-len(large) // MAX_PLANES)):
        face = large[k]
        n = np.cross(face[2] - face[0], face[3] - face[1])
        n = n / np.linalg.norm(n)
        d = float(n @ face[0])
        s = large @ n - d
        front, behind = (s > PLANE_TOLERANCE_M).any(axis=1), (s < -PLANE_TOLERANCE_M).any(axis=1)
        small_distance = small @ n - d
        small_front = (small_distance > SMALL_TOLERANCE_M).any(axis=1)
        small_cut = (small_front & (small_distance < -SMALL_TOLERANCE_M).any(axis=1)).sum()
        cost = (
            CUT_COST * (front & behind).sum()
            + SMALL_CUT_COST * small_cut
            + IMBALANCE_COST * abs(int(front.sum()) - int(behind.sum()))
            - COPLANAR_GAIN * (~front & ~behind).sum()
        )
        if best is None or cost < best[0]:
            best = (float(cost), k, n, d)
    assert best is not None  # noqa: S101 - there is at least one large face
    return best[1], best[2], best[3]


def _clip(face: FloatArray, s: FloatArray) -> list[FloatArray]:
    """Return the part of a convex face where ``s`` is positive, as quadrilaterals."""
    count = 3 if np.allclose(face[2], face[3]) else 4
    inside = []
    for i in range(count):
        j = (i + 1) % count
        if s[i] >= -PLANE_TOLERANCE_M:
            inside.append(face[i])
        if (s[i] > PLANE_TOLERANCE_M and s[j] < -PLANE_TOLERANCE_M) or (
            s[i] < -PLANE_TOLERANCE_M and s[j] > PLANE_TOLERANCE_M
        ):
            inside.append(face[i] + (face[j] - face[i]) * s[i] / (s[i] - s[j]))
    pieces = [inside] if len(inside) <= 4 else [inside[:4], [inside[0], *inside[3:]]]
    out = []
    for piece in pieces:
        if len(piece) < 3:
            continue
        corners = np.array(piece if len(piece) == 4 else [*piece, piece[-1]])
        if np.linalg.norm(np.cross(corners[2] - corners[0], corners[3] - corners[1])) > MIN_TWICE_AREA_M2:
            out.append(corners)
    return out
