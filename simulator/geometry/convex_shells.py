"""Occlusion culling: the boxes that large convex bodies of a craft hide, before anything is drawn.

A craft's box or panel is a convex shell. The region that it hides from a viewpoint is convex too: inside its faces that
look at the viewpoint, and inside the planes through the viewpoint and its silhouette. Bounding boxes that lie wholly in
the region need not be drawn; the image is unchanged.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.geometry.topology import components
from flyaround.simulator.geometry.triangles import face_planes, face_vectors

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.runtime.arrays import BoolArray, Float32Array, FloatArray, IntArray

MARGIN = 2e-4
"""Margin inside the hidden region, as a share of the radius: larger than a rasteriser's rounding of vertices."""
CLOSEST_M = 0.15
"""Distance from the camera below which a shell hides nothing: the near plane (0.01 m) may cut it open."""
BOX = 0.05
"""Size of the bounding boxes, as a share of the radius."""
_WELD_DISTANCE = 2e-6  # share of the radius: closer corners are one
_MOST = 4  # shells per craft: each costs time, and the largest hide most
_MIN_SHARE = 0.1  # share of the largest shell's area
_MIN_PROTRUSION = 0.05  # share of the radius: a shell that protrudes less from a larger one hides little more
_MAX_TRIANGLES = 256  # a round shell has a plane for each face of its silhouette
_MAX_BODIES = 160  # bodies of a part that are examined
_MIN_BODY = 0.003  # share of the largest body's area
_PLANE_TOLERANCE = 1e-5  # share of the radius by which corners may be outside a convex shell's planes


@dataclass(frozen=True, eq=False)
class ConvexShell:
    """A closed convex surface, target frame.

    Parameters
    ----------
    planes : (F, 4) array
        Unit outward normal of each flat face, and its negated distance from the origin [m].
    ends_m : (E, 2, 3) array
        End points of the edges between faces.
    faces : (E, 2) array
        Rows of ``planes`` left and right of each.
    turns : (E, 3, 4) array
        Matrices from a homogeneous point to the normal of the plane through it and the edge: the cross product of the
        edge and the vector from its start to the point.
    area_m2 : float
        Surface area.
    """

    planes: FloatArray
    ends_m: FloatArray
    faces: IntArray
    turns: FloatArray
    area_m2: float

    def hidden_region(self, place: FloatArray) -> FloatArray | None:
        """Return (P, 4) planes of the region hidden from a viewpoint; ``None`` if there is none, or if it is too near.

        Parameters
        ----------
        place : (4,) array
            Homogeneous viewpoint, target frame: a point (x, y, z, 1) [m] or, at infinity, a direction (x, y, z, 0).
        """
        beyond = self.planes @ place
        if beyond.max() <= (CLOSEST_M if place[3] else 0.0):
            return None
        front = beyond > 0
        left, right = front.take(self.faces.T)
        edges = (left != right).nonzero()[0]
        normals = self.turns.take(edges, axis=0) @ place
        # seen from the viewpoint, the face on the left has the shell on the inner side of that plane
        lengths = np.sqrt(np.einsum("ij,ij->i", normals, normals))
        normals *= (np.where(left.take(edges), 1.0, -1.0) / np.maximum(lengths, 1e-12))[:, None]
        distances = np.einsum("ij,ij->i", normals, self.ends_m[:, 0].take(edges, axis=0))
        return np.concatenate([self.planes[front], np.concatenate([normals, -distances[:, None]], axis=1)])


@dataclass(frozen=True, eq=False)
class Boxes:
    """Axis-aligned boxes, target frame, each about some triangles or edges.

    Parameters
    ----------
    extents_m : (7, B) float32 array
        Centre, half sides, and 1.
    of : (K,) array
        Index of the box of each triangle or edge.
    """

    extents_m: Float32Array
    of: IntArray

    @staticmethod
    def about(corners_m: FloatArray, size_m: float) -> Boxes:
        """Group items (K, N, 3) of N corners each into boxes by position; an item longer than ``size_m`` has its own.

        Parameters
        ----------
        size_m : float
            Approximate size of a box.
        """
        low, high = corners_m.min(axis=1), corners_m.max(axis=1)
        cell = np.floor((low + high) / (2 * size_m)).astype(np.int64)
        cell -= cell.min(axis=0, initial=0)
        span = cell.max(axis=0, initial=0) + 1
        key = (cell[:, 0] * span[1] + cell[:, 1]) * span[2] + cell[:, 2]
        long = (high - low).max(axis=1) > size_m
        key[long] = -1 - np.arange(np.count_nonzero(long))
        _, box_of_triangle = np.unique(key, return_inverse=True)
        order = np.argsort(box_of_triangle, kind="stable")
        starts = np.flatnonzero(np.diff(box_of_triangle[order], prepend=-1))
        if len(starts):
            low = np.minimum.reduceat(low[order], starts)
            high = np.maximum.reduceat(high[order], starts)
        extents = np.concatenate([(low + high) / 2, (high - low) / 2, np.ones((len(low), 1))], axis=1)
        return Boxes(np.ascontiguousarray(extents.T, np.float32), box_of_triangle)

    def inside(self, planes: FloatArray, margin_m: float) -> BoolArray:
        """Return (B,) True where a box is inside all planes (P, 4), by more than a margin."""
        farthest = np.empty((len(planes), 7), np.float32)
        farthest[:, :3] = planes[:, :3]
        np.abs(farthest[:, :3], out=farthest[:, 3:6])
        np.add(planes[:, 3], margin_m, out=farthest[:, 6], casting="same_kind")
        return np.asarray(np.maximum.reduce(farthest @ self.extents_m) < 0)


def hidden(shells: Sequence[ConvexShell], boxes: Boxes, place: FloatArray, radius_m: float) -> BoolArray:
    """Return (B,) True where a convex shell hides a box; ``place`` is as in `ConvexShell.hidden_region`."""
    is_hidden = np.zeros(boxes.extents_m.shape[1], bool)
    for shell in shells:
        planes = shell.hidden_region(place)
        if planes is not None:
            is_hidden |= boxes.inside(planes, MARGIN * radius_m)
    return is_hidden


def convex_bodies(corners: Sequence[FloatArray], radius_m: float) -> list[ConvexShell]:
    """Return the closed convex bodies of parts, the largest first; small ones are omitted.

    Parameters
    ----------
    corners : sequence of (T, 3, 3) arrays
        Triangles of each part [m].
    radius_m : float
        Radius of the craft's bounding sphere.
    """
    areas = [float(np.linalg.norm(face_vectors(c) / 2, axis=1).sum()) for c in corners]
    shells: list[ConvexShell] = []
    for k in sorted(range(len(areas)), key=lambda k: -areas[k]):
        least = _MIN_BODY * shells[0].area_m2 if shells else 0.0
        if areas[k] < least:
            break
        for body in _connected_bodies(corners[k], _WELD_DISTANCE * radius_m, least):
            shell = _as_convex_shell(body, radius_m)
            if shell is not None:
                shells.append(shell)
        shells.sort(key=lambda shell: -shell.area_m2)
    return shells


def find_shells(bodies: Sequence[ConvexShell], radius_m: float) -> tuple[ConvexShell, ...]:
    """Return the largest of a craft's `convex_bodies`, omitting those nearly inside another.

    Parameters
    ----------
    radius_m : float
        Radius of the craft's bounding sphere.
    """
    shells: list[ConvexShell] = []
    for shell in bodies:
        small = shell.area_m2 < _MIN_SHARE * bodies[0].area_m2
        if (
            len(shells) < _MOST
            and not small
            and all(_protrusion(shell, other) > _MIN_PROTRUSION * radius_m for other in shells)
        ):
            shells.append(shell)
    return tuple(shells)


def _protrusion(shell: ConvexShell, other: ConvexShell) -> float:
    """Return how far a shell protrudes from the planes of another [m]."""
    corners = shell.ends_m.reshape(-1, 3)
    return float((corners @ other.planes[:, :3].T + other.planes[:, 3]).max())


@dataclass(frozen=True, eq=False)
class _Body:
    """A connected body: triangles (T, 3, 3), and their vertex indices (T, 3)."""

    corners_m: FloatArray
    places: IntArray


def _connected_bodies(corners_m: FloatArray, step_m: float, least_m2: float) -> list[_Body]:
    """Return the largest bodies with few triangles among a part's (T, 3, 3); corners within a step are merged.

    Parameters
    ----------
    least_m2 : float
        Least area of a body.
    """
    cell = np.rint(corners_m.reshape(-1, 3) / step_m).astype(np.int64)
    cell -= cell.min(axis=0, initial=0)
    span = cell.max(axis=0, initial=0) + 1
    _, places = np.unique((cell[:, 0] * span[1] + cell[:, 1]) * span[2] + cell[:, 2], return_inverse=True)
    places = places.reshape(-1, 3)
    n = int(places.max(initial=0)) + 1
    body = components(np.stack([places[:, :2].ravel(), places[:, 1:].ravel()], axis=1), n)[1][places[:, 0]]
    area = np.bincount(body, np.linalg.norm(face_vectors(corners_m), axis=1)) / 2
    area[np.bincount(body) > _MAX_TRIANGLES] = 0
    largest = np.argsort(-area, kind="stable")[:_MAX_BODIES]
    members = [np.flatnonzero(body == k) for k in largest if area[k] > least_m2]
    return [_Body(corners_m[triangles], places[triangles]) for triangles in members]


def _as_convex_shell(body: _Body, radius_m: float) -> ConvexShell | None:
    """Return a body as a convex shell, or None if it is not closed and convex."""
    corners, places = body.corners_m, body.places
    planes = face_planes(corners)
    normals = planes[:, :3]
    points = corners.reshape(-1, 3)
    if (points @ normals.T + planes[:, 3]).max() > _PLANE_TOLERANCE * radius_m:
        return None
    # each half-edge has a twin that runs the other way
    n = int(places.max()) + 1
    start, end = places.ravel(), np.roll(places, -1, axis=1).ravel()
    ours, theirs = start * n + end, end * n + start
    first, second = np.argsort(ours), np.argsort(theirs)
    if not np.array_equal(ours[first], theirs[second]) or np.any(np.diff(ours[first]) == 0):
        return None
    # triangles of one flat face are merged into one plane
    steps = planes / [1e-6, 1e-6, 1e-6, _PLANE_TOLERANCE * radius_m]
    _, row, flat = np.unique(np.rint(steps), axis=0, return_index=True, return_inverse=True)
    faces = flat.ravel()[np.stack([first // 3, second // 3], axis=1)]
    real = (start < end)[first] & (faces[:, 0] != faces[:, 1])
    ends = np.stack([points, np.roll(corners, -1, axis=1).reshape(-1, 3)], axis=1)[first][real]
    along = ends[:, 1] - ends[:, 0]
    turns = np.concatenate(
        [np.cross(along[:, None], np.eye(3)).swapaxes(1, 2), -np.cross(along, ends[:, 0])[..., None]], axis=2
    )
    area_m2 = float(np.linalg.norm(face_vectors(corners), axis=1).sum() / 2)
    return ConvexShell(planes[row], ends, faces[real], turns, area_m2)
