"""Exact visibility of points on the mesh: which triangle comes first along a ray, by projection.

All rays of one query share a centre (the camera) or a direction (the Sun), so the mesh is projected once
and each point is compared with the few triangles whose projection covers it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from simulator.labels.projected_mesh import across, seen_from_camera, seen_from_direction
from simulator.runtime.arrays import BoolArray, FloatArray, IntArray, vec3
from simulator.runtime.memory import kept_with
from simulator.targets.geometry import is_closed
from simulator.world.frames.pose import Pose

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from simulator.targets.model import Target

# A keypoint lies on the surface to well below this, and no two parts of a craft are closer on purpose.
SURFACE_TOLERANCE_M = 2e-3


# Sine of the angle under which a triangle may look away and counts as facing: rounding must not lose one.
GRAZING = 1e-6


@dataclass(frozen=True, eq=False)
class Mesh:
    """All triangles of a target: positions (N, 3) [m] and indices (M, 3).

    Parameters
    ----------
    in_shell : (M,) whether a triangle is of a closed shell that faces outwards; None where nothing is known of it.
    """

    positions_m: FloatArray
    triangles: IntArray
    in_shell: BoolArray | None = None

    @staticmethod
    def of(target: Target) -> Mesh:
        """The parts of a target joined."""
        offsets = np.cumsum([0] + [len(p.positions_m) for p in target.parts[:-1]])
        return Mesh(
            np.concatenate([p.positions_m for p in target.parts]).astype(np.float64),
            np.concatenate([p.triangles + o for p, o in zip(target.parts, offsets, strict=True)]).astype(
                np.int64
            ),
            np.repeat([is_closed(p) for p in target.parts], [len(p.triangles) for p in target.parts]),
        )

    @cached_property
    def corners_m(self) -> FloatArray:
        """(3, 3, M) x, y, z of each triangle's three corners, each in a row of its own."""
        return np.ascontiguousarray(self.positions_m[self.triangles].transpose(2, 1, 0))

    @cached_property
    def box_m(self) -> FloatArray:
        """(3, 8) corners of the box about the mesh; corner k is high in x, y, z by bits 4, 2, 1."""
        return box_corners_m([self.positions_m]).T

    @cached_property
    def hull_m(self) -> FloatArray:
        """(K, 3) corners of the convex hull; all positions of a mesh that is flat."""
        try:
            return np.asarray(self.positions_m[ConvexHull(self.positions_m).vertices])
        except QhullError:
            return self.positions_m

    @cached_property
    def _planes(self) -> FloatArray:
        """(4, M) unit normal and distance from the origin, sign turned; zeros for what counts as facing everything."""
        a, b, c = self.corners_m.transpose(1, 0, 2)
        normal = np.cross(b - a, c - a, axis=0)
        length = np.linalg.norm(normal, axis=0)
        normal /= np.maximum(length, 1e-30)
        planes = np.concatenate([normal, -(normal * a).sum(axis=0)[None]])
        planes[:, length < 1e-12] = 0
        if self.in_shell is None:
            return np.zeros_like(planes)
        return planes * self.in_shell

    def facing(self, place: FloatArray) -> IntArray:
        """Numbers of the triangles that may be the first on a ray from a place: of closed shells those that face it.

        Parameters
        ----------
        place : (4,) homogeneous: a point outside all shells (x, y, z, 1) [m], or the direction (x, y, z, 0) of one far
            away.
        """
        unit = place / np.linalg.norm(place[:3])
        return np.flatnonzero(unit @ self._planes >= -GRAZING)


def box_corners_m(positions_m: Sequence[NDArray[np.floating]]) -> FloatArray:
    """(8, 3) corners of the box about sets of points (N, 3); corner k is high in x, y, z by bits 4, 2, 1."""
    low = np.min([points.min(axis=0) for points in positions_m], axis=0).astype(float)
    high = np.max([points.max(axis=0) for points in positions_m], axis=0).astype(float)
    bits = np.array([[k >> 2 & 1, k >> 1 & 1, k & 1] for k in range(8)])
    return np.asarray(low + bits * (high - low))


@kept_with
def mesh_of(target: Target) -> Mesh:
    """``Mesh.of``, kept for the targets in use."""
    return Mesh.of(target)


def occluded_from_camera(mesh: Mesh, points_m: ArrayLike, camera_from_target: Pose) -> BoolArray:
    """Whether the mesh hides each point from a pinhole at the camera's origin.

    Parameters
    ----------
    points_m : (K, 3) points on the surface, before the camera, target frame [m].
    """
    points = camera_from_target.apply(points_m)
    distance = np.linalg.norm(points, axis=1)
    # a hider lies nearer along the ray by the tolerance
    shrink = 1 - SURFACE_TOLERANCE_M / np.maximum(distance, 1e-9)
    screen = seen_from_camera(mesh, camera_from_target)
    return screen.hides(points[:, :2] / points[:, 2:], 1 / (points[:, 2] * shrink))


def hidden_from_direction(mesh: Mesh, points_m: ArrayLike, direction: ArrayLike) -> BoolArray:
    """Whether the mesh stands between each point and a source at infinity (the Sun).

    Parameters
    ----------
    points_m : (K, 3) points on the surface, target frame [m].
    direction : (3,) unit vector towards the source, target frame.
    """
    towards = vec3(np.asarray(direction, float))
    points = np.asarray(points_m, float) @ across(towards).T
    return seen_from_direction(mesh, towards).hides(points[:, :2], points[:, 2] + SURFACE_TOLERANCE_M)
