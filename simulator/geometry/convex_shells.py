"""Occlusion culling: finds the bounding boxes that the large convex bodies of a craft hide from a viewpoint.

The box and the panels of a craft are convex shells. The region that a shell hides from a viewpoint is convex too. It is
bounded by the planes of the front faces, and by the planes through the viewpoint and the shell's silhouette. Geometry
in bounding boxes inside this region need not be drawn; the image does not change.
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
"""Margin by which boxes must be inside the hidden region, relative to the radius. Larger than vertex rounding."""

MIN_DISTANCE_M = 0.15
"""Distance from the camera below which a shell is not used [m], because the near plane (0.01 m) may clip it open."""

BOX_SIZE = 0.05
"""Size of the bounding boxes, as a share of the radius."""

_WELD_DISTANCE = 2e-6  # distance below which corners are merged, relative to the radius
_MAX_SHELLS = 4  # largest number of shells per craft, which bounds the time of the tests
_MIN_SHARE = 0.1  # smallest area of a shell, relative to the largest one's
_MIN_PROTRUSION = 0.05  # smallest protrusion of a shell from a larger one, relative to the radius
_MAX_TRIANGLES = 256  # limit on the triangles of a shell; round shells have many silhouette planes
_MAX_BODIES = 160  # largest number of bodies of a part that are examined
_MIN_BODY_AREA = 0.003  # smallest area of a body, relative to the largest one's
_PLANE_TOLERANCE = 1e-5  # distance of corners outside the planes of a convex shell, relative to the radius


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
        Rows of ``planes`` to the left and right of each edge.
    edge_normal_maps : (E, 3, 4) array
        Matrices from a homogeneous point to the normal of the plane through it and the edge: the cross product of the
        edge and the vector from its start to the point.
    area_m2 : float
        Surface area.
    """

    planes: FloatArray
    ends_m: FloatArray
    faces: IntArray
    edge_normal_maps: FloatArray
    area_m2: float

    def hidden_region(self, viewpoint: FloatArray) -> FloatArray | None:
        """Return the (P, 4) planes of the region hidden from a viewpoint; None if the viewpoint is too near or inside.

        Parameters
        ----------
        viewpoint : (4,) array
            Homogeneous viewpoint, target frame: a point (x, y, z, 1) [m] or, at infinity, a direction (x, y, z, 0).

        Returns
        -------
        (P, 4) array or None
            Planes (nx, ny, nz, d).
        """
        signed_distances = self.planes @ viewpoint
        if signed_distances.max() <= (MIN_DISTANCE_M if viewpoint[3] else 0.0):
            return None
        front = signed_distances > 0
        left, right = front.take(self.faces.T)
        edges = (left != right).nonzero()[0]
        normals = self.edge_normal_maps.take(edges, axis=0) @ viewpoint
        # seen from the viewpoint, the face on the left has the shell on the inner side of that plane
        lengths = np.sqrt(np.einsum("ij,ij->i", normals, normals))
        normals *= (np.where(left.take(edges), 1.0, -1.0) / np.maximum(lengths, 1e-12))[:, None]
        distances = np.einsum("ij,ij->i", normals, self.ends_m[:, 0].take(edges, axis=0))
        return np.concatenate([self.planes[front], np.concatenate([normals, -distances[:, None]], axis=1)])


@dataclass(frozen=True, eq=False)
class Boxes:
    """Axis-aligned bounding boxes of groups of triangles or edges, target frame.

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
        """Group items (K, N, 3) of N corners each into boxes by position; a longer item gets a box of its own.

        Parameters
        ----------
        corners_m : (K, N, 3) array
            Corners of the items [m].
        size_m : float
            Approximate size of a box.

        Returns
        -------
        Boxes
            Groups with their bounds [m].
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
        """Return True for the boxes that are inside all planes (P, 4), by more than a margin.

        Returns
        -------
        (B,) array of bool
            True where the whole box is on the negative side of every plane, in the order of the boxes.
        """
        weights = np.empty((len(planes), 7), np.float32)
        weights[:, :3] = planes[:, :3]
        np.abs(weights[:, :3], out=weights[:, 3:6])
        np.add(planes[:, 3], margin_m, out=weights[:, 6], casting="same_kind")
        return np.asarray(np.maximum.reduce(weights @ self.extents_m) < 0)


def hidden(shells: Sequence[ConvexShell], boxes: Boxes, viewpoint: FloatArray, radius_m: float) -> BoolArray:
    """Return True for the boxes that a convex shell hides; ``viewpoint`` is as in `ConvexShell.hidden_region`.

    Returns
    -------
    (B,) array of bool
        True where one shell hides the whole box; a box that only several shells together hide is False.
    """
    is_hidden = np.zeros(boxes.extents_m.shape[1], bool)
    for shell in shells:
        planes = shell.hidden_region(viewpoint)
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

    Returns
    -------
    list of ConvexShell
        Bodies in the parts' frame [m].
    """
    areas = [float(np.linalg.norm(face_vectors(c) / 2, axis=1).sum()) for c in corners]
    shells: list[ConvexShell] = []
    for k in sorted(range(len(areas)), key=lambda k: -areas[k]):
        min_area_m2 = _MIN_BODY_AREA * shells[0].area_m2 if shells else 0.0
        if areas[k] < min_area_m2:
            break
        for body in _connected_bodies(corners[k], _WELD_DISTANCE * radius_m, min_area_m2):
            shell = _as_convex_shell(body, radius_m)
            if shell is not None:
                shells.append(shell)
        shells.sort(key=lambda shell: -shell.area_m2)
    return shells


def largest_shells(bodies: Sequence[ConvexShell], radius_m: float) -> tuple[ConvexShell, ...]:
    """Return the largest of a craft's `convex_bodies`, omitting those nearly inside another.

    Parameters
    ----------
    bodies : sequence of ConvexShell
        Convex bodies.
    radius_m : float
        Radius of the craft's bounding sphere.

    Returns
    -------
    tuple of ConvexShell
        Bodies in the target frame [m].
    """
    shells: list[ConvexShell] = []
    for shell in bodies:
        is_small = shell.area_m2 < _MIN_SHARE * bodies[0].area_m2
        if (
            len(shells) < _MAX_SHELLS
            and not is_small
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
    vertex_indices: IntArray


def _connected_bodies(corners_m: FloatArray, step_m: float, least_m2: float) -> list[_Body]:
    """Return the largest bodies with few triangles among a part's (T, 3, 3); corners within a step are merged.

    Parameters
    ----------
    corners_m : (T, 3, 3) array
        Triangles of the part [m].
    step_m : float
        Distance within which corners merge [m].
    least_m2 : float
        Minimum area of a body.
    """
    cell = np.rint(corners_m.reshape(-1, 3) / step_m).astype(np.int64)
    cell -= cell.min(axis=0, initial=0)
    span = cell.max(axis=0, initial=0) + 1
    _, vertex_indices = np.unique(
        (cell[:, 0] * span[1] + cell[:, 1]) * span[2] + cell[:, 2], return_inverse=True
    )
    vertex_indices = vertex_indices.reshape(-1, 3)
    n = int(vertex_indices.max(initial=0)) + 1
    body = components(np.stack([vertex_indices[:, :2].ravel(), vertex_indices[:, 1:].ravel()], axis=1), n)[1][
        vertex_indices[:, 0]
    ]
    area = np.bincount(body, np.linalg.norm(face_vectors(corners_m), axis=1)) / 2
    area[np.bincount(body) > _MAX_TRIANGLES] = 0
    largest = np.argsort(-area, kind="stable")[:_MAX_BODIES]
    members = [np.flatnonzero(body == k) for k in largest if area[k] > least_m2]
    return [_Body(corners_m[triangles], vertex_indices[triangles]) for triangles in members]


def _as_convex_shell(body: _Body, radius_m: float) -> ConvexShell | None:
    """Return a body as a convex shell, or None if it is not closed and convex."""
    corners, vertex_indices = body.corners_m, body.vertex_indices
    planes = face_planes(corners)
    normals = planes[:, :3]
    points = corners.reshape(-1, 3)
    if (points @ normals.T + planes[:, 3]).max() > _PLANE_TOLERANCE * radius_m:
        return None
    # in a closed shell each half-edge has a twin in the opposite direction
    n = int(vertex_indices.max()) + 1
    start, end = vertex_indices.ravel(), np.roll(vertex_indices, -1, axis=1).ravel()
    half_edges, twins = start * n + end, end * n + start
    first, second = np.argsort(half_edges), np.argsort(twins)
    if not np.array_equal(half_edges[first], twins[second]) or np.any(np.diff(half_edges[first]) == 0):
        return None
    # triangles of one flat face are merged into one plane
    rounded = planes / [1e-6, 1e-6, 1e-6, _PLANE_TOLERANCE * radius_m]
    _, row, flat = np.unique(np.rint(rounded), axis=0, return_index=True, return_inverse=True)
    faces = flat.ravel()[np.stack([first // 3, second // 3], axis=1)]
    is_edge = (start < end)[first] & (faces[:, 0] != faces[:, 1])
    ends = np.stack([points, np.roll(corners, -1, axis=1).reshape(-1, 3)], axis=1)[first][is_edge]
    edge_vectors = ends[:, 1] - ends[:, 0]
    edge_normal_maps = np.concatenate(
        [
            np.cross(edge_vectors[:, None], np.eye(3)).swapaxes(1, 2),
            -np.cross(edge_vectors, ends[:, 0])[..., None],
        ],
        axis=2,
    )
    area_m2 = float(np.linalg.norm(face_vectors(corners), axis=1).sum() / 2)
    return ConvexShell(planes[row], ends, faces[is_edge], edge_normal_maps, area_m2)
