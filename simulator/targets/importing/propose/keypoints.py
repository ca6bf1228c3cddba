"""Keypoints proposed from the shape: corners and extremities, spread by farthest-point sampling."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.spatial import ConvexHull, QhullError, cKDTree

from flyaround.simulator.geometry.decimation import decimate
from flyaround.simulator.geometry.topology import (
    MeshBody,
    edge_table,
    used_vertices,
    with_separate_components,
)
from flyaround.simulator.runtime.arrays import FloatArray, IntArray, vec3
from flyaround.simulator.targets.importing.propose.surface_points import surface_points
from flyaround.simulator.targets.importing.propose.wireframe import crease_edges
from flyaround.simulator.targets.model import Keypoint

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

N_KEYPOINTS = 16  # number of keypoints proposed
MAX_CANDIDATES = 4000  # vertices considered
MIN_VIEWS = 3  # least number of `DIRECTIONS` from which a keypoint is visible
MIN_DISTANCE = 0.02
"""Least distance between keypoints, as a share of the craft, for an estimator to separate them."""
SAMPLES, NEIGHBOURHOOD = 6000, 0.12
"""Number of surface points, and the radius around a keypoint as a share of the craft, for detecting booms."""
BOOM_AXIS_RATIO, BOOM_WEIGHT = 0.4, 0.3
"""Ratio of principal axes below which a surface is a boom, and the weight of a point on a boom."""
CORNER_WEIGHT, HULL_WEIGHT = 1.25, 1.4
"""Weights of corners and hull vertices against other vertices, chosen by eye on the built-in craft."""
UNSEEN_WEIGHT, VIEWS_POWER = 0.3, 1.5
"""Weight (0.3 + share of directions)^1.5: a point visible from everywhere counts nine times a hidden one."""
TURN_COS = float(np.cos(np.deg2rad(25.0)))  # cosine of the least angle by which a crease turns at a corner


def propose_keypoints(bodies: list[MeshBody], extent: float) -> tuple[Keypoint, ...]:
    """Propose up to sixteen vertices of the mesh: corners where creases meet or end, and the tips of its hull.

    The first keypoint is the vertex farthest from the centre. Each further one is the vertex farthest from the
    keypoints selected before (farthest-point sampling). Distances are weighted: corners, hull vertices and vertices
    visible from many directions are preferred, points along booms are not. The result is deterministic.
    """
    points, is_corner = _candidates(bodies)
    if not len(points):
        return ()
    # round, then sort, so that ties are decided by position and not by the file's order
    order = np.lexsort(np.round(points / (1e-6 * extent)).T)
    points, is_corner = points[order], is_corner[order]
    n_directions = visible_directions_count(bodies, points)
    visible = n_directions >= MIN_VIEWS
    if visible.sum() >= N_KEYPOINTS:
        points, is_corner, n_directions = points[visible], is_corner[visible], n_directions[visible]
    is_on_hull = _hull_mask(points)
    weight = (
        np.where(is_corner, CORNER_WEIGHT, 1.0)
        * np.where(is_on_hull, HULL_WEIGHT, 1.0)
        * np.where(
            is_on_hull,
            1.0,
            BOOM_WEIGHT
            + (1 - BOOM_WEIGHT) * np.clip(_breadth(bodies, points, extent) / BOOM_AXIS_RATIO, 0, 1),
        )
        * (UNSEEN_WEIGHT + n_directions / len(DIRECTIONS)) ** VIEWS_POWER
    )
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    distance = np.linalg.norm(points - centre, axis=1)
    selected: list[int] = []
    while len(selected) < min(N_KEYPOINTS, len(points)):
        k = int(np.argmax(np.round(distance * weight / extent, 6)))
        if selected and distance[k] < MIN_DISTANCE * extent:
            break
        gap = np.linalg.norm(points - points[k], axis=1)
        distance = gap if not selected else np.minimum(distance, gap)
        selected.append(k)
    return tuple(
        Keypoint(name=f"{'corner' if is_corner[k] else 'tip'}_{number + 1:02d}", position_m=vec3(points[k]))
        for number, k in enumerate(selected)
    )


def _breadth(bodies: list[MeshBody], points: FloatArray, extent_m: float) -> FloatArray:
    """Return the (K,) ratio of second to first principal axis of the surface around each point: small along a boom."""
    samples = surface_points(bodies, SAMPLES, vertices=False).points_m
    tree = cKDTree(samples)
    out = np.ones(len(points))
    for k, point in enumerate(points):
        near = np.asarray(tree.query_ball_point(point, NEIGHBOURHOOD * extent_m), np.int64)
        if len(near) > 3:
            axes = np.linalg.eigvalsh(np.cov(samples[near].T))
            out[k] = np.sqrt(max(axes[1], 0.0) / max(axes[2], 1e-300))
    return out


def _candidates(bodies: list[MeshBody]) -> tuple[FloatArray, np.ndarray]:
    pieces = [with_separate_components(b) for b in bodies]
    corners = [b.positions_m[_corner_vertices(b)] for b in pieces]
    points_in_use = [b.positions_m[used_vertices(b.triangles, len(b.positions_m))] for b in bodies]
    hulls = [_tips(points) for points in points_in_use]
    craft_tips = _tips(np.concatenate(points_in_use))
    corner_points, tip_points = np.concatenate(corners), np.concatenate([*hulls, craft_tips])
    points = np.concatenate([corner_points, tip_points])
    is_corner = np.arange(len(points)) < len(corner_points)
    _, first = np.unique(points, axis=0, return_index=True)
    first = np.sort(first)
    if len(first) > MAX_CANDIDATES:
        first = first[:: len(first) // MAX_CANDIDATES + 1]
    return points[first], is_corner[first]


def _corner_vertices(body: MeshBody) -> np.ndarray:
    """Return the vertices where three or more creases meet, where a crease bends sharply, or where one ends."""
    ends, _, _ = crease_edges(body, edge_table(body.triangles))
    if not len(ends):
        return np.zeros(0, np.int64)
    degree = np.bincount(ends.ravel(), minlength=len(body.positions_m))
    direction = body.positions_m[ends[:, 1]] - body.positions_m[ends[:, 0]]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    total = np.zeros_like(body.positions_m)
    np.add.at(total, ends[:, 0], direction)
    np.add.at(total, ends[:, 1], -direction)
    # the sum of two unit vectors at an angle has length 2 cos(angle / 2)
    is_bent = np.linalg.norm(total, axis=1) > np.sqrt(2 * (1 - TURN_COS))
    return np.flatnonzero((degree >= 3) | (degree == 1) | ((degree == 2) & is_bent))


def _tips(points: FloatArray) -> FloatArray:
    """Return the vertices of the convex hull, or all points of a flat shape's bounding box."""
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except (QhullError, ValueError):
        far = [int(f(points[:, k])) for k in range(3) for f in (np.argmin, np.argmax)]
        return points[np.unique(far)]


def _hull_mask(points: FloatArray) -> np.ndarray:
    """Return a mask (K,) of points that are vertices of the convex hull."""
    out = np.zeros(len(points), bool)
    try:
        out[ConvexHull(points).vertices] = True
    except (QhullError, ValueError):
        out[:] = True
    return out


SIZE_PX = 384  # side of a view's depth image; a pixel is a quarter of a percent of the craft
MAX_TRIANGLES = 15_000  # larger meshes are reduced for the visibility test
TOLERANCE = 0.012
"""Tolerance for a coarse mesh and image, as a share of the craft."""
# towards the faces, edges and corners of a cube
DIRECTIONS = np.array([d for d in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(d)])


def visible_directions_count(bodies: list[MeshBody], points_m: FloatArray) -> IntArray:
    """Return the number (K,) of `DIRECTIONS` from which each point (K, 3) [m] is visible."""
    if sum(len(b.triangles) for b in bodies) > MAX_TRIANGLES:
        bodies = decimate(bodies, MAX_TRIANGLES)
    corners = np.concatenate([b.positions_m[b.triangles] for b in bodies])
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    radius = float(np.linalg.norm(high - low)) / 2
    centre = (low + high) / 2
    count = np.zeros(len(points_m), np.int64)
    for direction in DIRECTIONS:
        u, v, w = view_axes(direction)
        basis = np.stack([u, v, -w])  # third: distance from a camera at infinity, up to a constant
        depth_picture = _depth_picture((corners - centre) @ basis.T, radius)
        projected = (points_m - centre) @ basis.T
        column, row = np.clip(_pixels(projected[:, :2], radius), 0, SIZE_PX - 1).T
        count += projected[:, 2] <= depth_picture[row, column] + TOLERANCE * 2 * radius
    return count


def view_axes(axis: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Choose right-handed orthonormal axes ``(u, v, w)`` with ``w`` along ``axis``.

    Returns
    -------
    tuple of array
        Three unit vectors (3,), with ``u`` normal to the coordinate axis that is farthest from ``axis``.
    """
    w = _unit(np.asarray(axis, float))
    u = _unit(np.cross(np.eye(3)[int(np.argmin(np.abs(w)))], w))
    return u, np.cross(w, u), w


def _unit(v: FloatArray) -> FloatArray:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def _pixels(xy: FloatArray, radius: float) -> IntArray:
    return np.rint((xy / radius * 0.98 + 1) * (SIZE_PX - 1) / 2).astype(np.int64)


def _depth_picture(corners: FloatArray, radius: float) -> FloatArray:
    """Return the depth of the nearest face at each pixel, maximum over 3 x 3 neighbours; background is infinite."""
    depth = corners[..., 2].mean(axis=1)
    flat = _pixels(corners[..., :2].reshape(-1, 2), radius).reshape(-1, 3, 2).astype(np.int32)
    picture = np.full((SIZE_PX, SIZE_PX), 1e9, np.float32)
    # painter's order: nearest last
    for k in np.argsort(-depth, kind="stable"):
        cv2.fillConvexPoly(picture, flat[k], float(depth[k]))
    # an edge lies between its own face and the background
    return np.asarray(cv2.dilate(picture, np.ones((3, 3), np.uint8)), float)
