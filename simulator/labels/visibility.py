"""Exact visibility of points on the mesh, by projection of the triangles.

All rays of one query share a centre (the camera) or a direction (the Sun), so the mesh is projected once
and each point is compared with the few triangles whose projection covers it.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.geometry.directions import view_basis
from flyaround.simulator.geometry.projected_mesh import ProjectedMesh, project_along, project_to_pinhole
from flyaround.simulator.runtime.arrays import BoolArray, vec3

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flyaround.simulator.geometry.mesh import TriangleMesh
    from flyaround.simulator.world.frames.pose import Pose

# Distance below which a surface does not hide a point [m]: keypoints lie on the surface within less than this.
SURFACE_TOLERANCE_M = 2e-3


@lru_cache(maxsize=2)
def project_for_camera(mesh: TriangleMesh, camera_from_target: Pose) -> ProjectedMesh:
    """Return a mesh projected by a pinhole camera, cached for the keypoints and wireframe of a frame."""
    return project_to_pinhole(mesh, camera_from_target.R, np.asarray(camera_from_target.t_m))


_project_along = lru_cache(maxsize=2)(project_along)


def occluded_from_camera(mesh: TriangleMesh, points_m: ArrayLike, camera_from_target: Pose) -> BoolArray:
    """Return (K,) True where the mesh hides a point from a pinhole at the camera's origin.

    Parameters
    ----------
    mesh : TriangleMesh
        Mesh of the target.
    points_m : array_like
        (K, 3) points on the surface, in front of the camera, target frame [m].
    camera_from_target : Pose
        Pose of the target in the camera frame.

    Returns
    -------
    (K,) array of bool
        True where the point is hidden.
    """
    points = camera_from_target.apply(points_m)
    distance = np.linalg.norm(points, axis=1)
    # an occluder must be closer than the point by more than the tolerance, along the ray
    scale = 1 - SURFACE_TOLERANCE_M / np.maximum(distance, 1e-9)
    projected = project_for_camera(mesh, camera_from_target)
    return projected.hides(points[:, :2] / points[:, 2:], 1 / (points[:, 2] * scale))


def hidden_from_direction(mesh: TriangleMesh, points_m: ArrayLike, direction: ArrayLike) -> BoolArray:
    """Return (K,) True where the mesh hides a point from a source at infinity (the Sun).

    Parameters
    ----------
    mesh : TriangleMesh
        Mesh of the target.
    points_m : array_like
        (K, 3) points on the surface, target frame [m].
    direction : array_like
        (3,) unit vector towards the source, target frame.

    Returns
    -------
    (K,) array of bool
        True where the point is hidden.
    """
    to_source = vec3(np.asarray(direction, float))
    points = np.asarray(points_m, float) @ view_basis(to_source).T
    return _project_along(mesh, to_source).hides(points[:, :2], points[:, 2] + SURFACE_TOLERANCE_M)
