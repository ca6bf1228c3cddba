"""Correspondences between line figures of the image and of the wireframe, and the poses of each pair."""

from __future__ import annotations

from typing import Tuple

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.camera import CameraIntrinsics, undistorted_rays
from flyaround.hil.board.hybrid.image.edge_field import EdgeField
from flyaround.hil.board.hybrid.propose.plane_poses import plane_poses
from flyaround.hil.board.svd.perceptual_groups import Chains
from flyaround.hil.board.svd.region_of_interest import Region

Array = np.ndarray

# Factor on the arms of an open triad, which shadow or occlusion may have shortened.
ARM_FACTOR = 1.4


def stretch_arms(chains: Chains) -> Array:
    """Return the figures (T', 4, 2), and the open ones with their arms lengthened."""
    p = chains.points[~chains.closed]
    stretched = p.copy()
    stretched[:, 0] = p[:, 1] + ARM_FACTOR * (p[:, 0] - p[:, 1])
    stretched[:, 3] = p[:, 2] + ARM_FACTOR * (p[:, 3] - p[:, 2])
    return np.concatenate([chains.points, stretched])


def pose_hypotheses(
    figures_px: Array,
    model_point_groups: Array,
    camera: CameraIntrinsics,
    region: Region,
    centre_m: Array,
    radius_m: float,
    field: EdgeField,
) -> Tuple[Array, Array]:
    """Return poses q (N, 4), t (N, 3) for every image figure matched with every model figure.

    Only poses in front of the camera, at a range that fits the region's size and centred near it, are kept.

    Parameters
    ----------
    figures_px : (T, 4, 2) array
        Figures of the image [field px].
    model_point_groups : (M, 4, 3) array
        Figures of the model [m].
    camera : CameraIntrinsics
        Intrinsics of the camera.
    region : Region
        Image region.
    centre_m : (3,) array
        Centre of the target, target frame [m].
    radius_m : float
        Radius of the target [m].
    field : EdgeField
        Edges of the region.
    """
    none = (np.zeros((0, 4)), np.zeros((0, 3)))
    if not len(figures_px) or not len(model_point_groups):
        return none
    full = (figures_px + 0.5) * field.factor - 0.5 + (field.x0, field.y0)
    rays = undistorted_rays(camera, full.reshape(-1, 2)).reshape(-1, 4, 2)
    T, M = len(rays), len(model_point_groups)
    obj = np.broadcast_to(model_point_groups[None], (T, M, 4, 3)).reshape(-1, 4, 3)
    img = np.broadcast_to(rays[:, None], (T, M, 4, 2)).reshape(-1, 4, 2)
    # an image figure and its model have the same orientation if the face looks at the camera; the batch holds each
    # model figure in both orientations, so half of the pairs are geometrically invalid
    q, t, valid = plane_poses(obj, img)
    q, t = q[valid].reshape(-1, 4), t[valid].reshape(-1, 3)
    f = 0.5 * (camera.fx_px + camera.fy_px)
    centre = np.einsum("nij,j->ni", quat.matrix(q), centre_m) + t
    z = centre[:, 2]
    # bounds chosen by eye: the camera is outside the craft, which fits the region in size and place
    ok = np.isfinite(z) & (z > 1.3 * radius_m)
    q, t, centre, z = q[ok], t[ok], centre[ok], z[ok]
    size = 2 * f * radius_m / z
    u = camera.fx_px * centre[:, 0] / z + camera.cx_px
    v = camera.fy_px * centre[:, 1] / z + camera.cy_px
    ok = (size > 0.6 * region.diagonal_px) & (size < 3.5 * region.diagonal_px)
    reach = 0.75 * region.diagonal_px
    ok &= np.abs(u - 0.5 * (region.x0 + region.x1)) < reach
    ok &= np.abs(v - 0.5 * (region.y0 + region.y1)) < reach
    return q[ok], t[ok]
