"""Ranking of poses by reprojection error, and their refinement by Newton-Raphson.

Sharma, Ventura & D'Amico (2018), pose determination: poses are ranked by the mean distance between image corners and
reprojected ones, ``E = mean |p - pi(R x + t)|``, and the best five minimise ``sum |p - pi(R x + t)|^2`` over six
parameters. Second derivatives of ``pi`` are neglected (Gauss-Newton).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import List, Tuple

import cv2
import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.svd.region_of_interest import Region

Array = np.ndarray


# Minimum length of an edge whose ends count as corners [share of the model's radius]. Ends of shorter edges are too
# close together to be separated in an image.
MIN_LENGTH = 0.25

# Range below which the camera is all but inside the craft [radii]: the perspective of its front has no limit.
MIN_RANGE_RADII = 1.2

# Diameter of the sphere around the craft, and largest offset of its centre from that of the region [region's
# diagonals]. The region holds a part of the craft at worst, and the sphere is larger than its silhouette.
SPHERE_OF_REGION, OFFSET_OF_REGION = (0.75, 2.5), 0.75

# Margin of the corner map around the region, in which plausible poses place corners, and truncation of its distances
# [region's diagonals].
MAP_MARGIN, TRUNCATION = 0.25, 0.05

# Gauss-Newton steps, and the first ones, whose gate is the truncation; that of later ones is half of it.
STEPS, COARSE_STEPS = 10, 4

# Scale of the weights 1 / (1 + (d / scale)^2) of Cauchy's estimator [truncations]: a corner at the gate of the later
# steps counts a quarter.
WEIGHT_SCALE = 0.3

# Largest rotation of a step [rad], within which the pinhole's derivatives hold, and damping [share of the diagonal].
MAX_STEP_RAD, DAMPING = 0.2, 1e-3

# Least residual that the covariance assumes [px]: corners at whole pixels are uniform within one, 1 / sqrt(12).
MIN_RMS_PX = 0.3

# Number of poses compared at once, limited by the processor's cache.
BATCH_POSES = 250


@dataclass(frozen=True, eq=False)
class ModelCorners:
    """Ends of wireframe edges, without duplicates.

    Parameters
    ----------
    points_m : (C, 3) array
        Positions, target frame [m].
    normals : (C, K, 3) array
        Normals of the adjacent faces, padded with zeros.
    always : (C,) array
        True at ends of members that no face hides.
    """

    points_m: Array
    normals: Array
    always: Array


def model_corners(model: BoardModel, join_m: float = 0.01) -> ModelCorners:
    """Return the corners of the wireframe's long edges and rods, as in the published wireframe."""
    least = MIN_LENGTH * model.radius_m
    edges = [e for e in model.wireframe if np.linalg.norm(e.b_m - e.a_m) > least or e.radius_m > 0]
    edges = edges or list(model.wireframe)
    points = np.array([p for e in edges for p in (e.a_m, e.b_m)])
    indices: List[int] = []
    member = np.zeros(len(points), int)
    for k, p in enumerate(points):
        near = [n for n, c in enumerate(indices) if np.abs(points[c] - p).max() < join_m]
        if near:
            member[k] = near[0]
        else:
            member[k] = len(indices)
            indices.append(k)
    faces = [
        np.concatenate([np.zeros((0, 3)), *(edges[e // 2].normals for e in np.flatnonzero(member == n))])
        for n in range(len(indices))
    ]
    max_faces = max(1, max((len(f) for f in faces), default=1))
    normals = np.zeros((len(indices), max_faces, 3))
    for n, f in enumerate(faces):
        normals[n, : len(f)] = f
    return ModelCorners(points[indices], normals, np.array([len(f) == 0 for f in faces]))


@dataclass(frozen=True, eq=False)
class CornerMap:
    """Map from pixels to the nearest image corner, over a box around the region.

    Parameters
    ----------
    points : (N, 2) array
        Corners [full-resolution px].
    x0 : float
        Left edge of the box [px].
    y0 : float
        Upper edge of the box [px].
    distance : (h, w) array
        Distance to the nearest corner, float32 [px].
    label : (h, w) array
        Label of the nearest corner.
    index : (L,) array
        Index in ``points`` of each label.
    cap_px : float
        Truncation of the distances [px].
    """

    points: Array
    x0: float
    y0: float
    distance: Array
    label: Array
    index: Array
    cap_px: float

    def lookup(self, pixels: Array) -> Tuple[Array, Array]:
        """Return the truncated distance to, and index of, the corner nearest to pixels (..., 2)."""
        h, w = self.distance.shape
        x, y = np.rint(pixels[..., 0] - self.x0), np.rint(pixels[..., 1] - self.y0)
        inside = (x >= 0) & (x < w) & (y >= 0) & (y < h)
        xi, yi = np.clip(x, 0, w - 1).astype(int), np.clip(y, 0, h - 1).astype(int)
        d = np.where(inside, np.minimum(self.distance[yi, xi], self.cap_px), self.cap_px)
        return d, self.index[self.label[yi, xi]]


def corner_map(points: Array, region: Region) -> CornerMap:
    """Return the map of corners (N, 2), N >= 1, over a region enlarged by a quarter of its diagonal."""
    margin, cap_px = MAP_MARGIN * region.diagonal_px, TRUNCATION * region.diagonal_px
    low = np.floor(np.array([region.x0, region.y0]) - margin)
    high = np.array([region.x1, region.y1]) + margin
    # distances are needed within the box only; those of a 5 x 5 mask are at most 2 % too short
    clipped = np.clip(points, low, high)
    reach = 1.05 * cap_px + 2.0
    low = np.maximum(low, np.floor(clipped.min(axis=0) - reach))
    high = np.minimum(high, clipped.max(axis=0) + reach)
    w, h = (high - low).astype(int) + 1
    zero = np.full((h, w), 255, np.uint8)
    pixels = np.clip(np.rint(points - low).astype(int), 0, [w - 1, h - 1])
    zero[pixels[:, 1], pixels[:, 0]] = 0
    distance, label = cv2.distanceTransformWithLabels(
        zero, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    index = np.zeros(int(label.max()) + 1, int)
    index[label[pixels[:, 1], pixels[:, 0]]] = np.arange(len(pixels))
    return CornerMap(points, float(low[0]), float(low[1]), distance, label, index, cap_px)


def visible_corners(corners: ModelCorners, R: Array, t: Array) -> Array:
    """Return a mask (B, C) of corners with a face towards the camera; occlusion is ignored."""
    C = -np.einsum("bji,bj->bi", R, t)
    rays = C[:, None] - corners.points_m[None]
    toward = np.einsum("ckj,bcj->bck", corners.normals, rays) > 0
    return np.asarray(toward.any(axis=2) | corners.always)


def plausible(q: Array, t: Array, model: BoardModel, camera: CameraIntrinsics, region: Region) -> Array:
    """Return a mask (N,) of poses in front of the camera whose craft roughly covers the region."""
    centre = np.einsum("nij,j->ni", quat.matrix(q), model.centre_m) + t
    z = centre[:, 2]
    ok = np.isfinite(centre).all(axis=1) & (z > MIN_RANGE_RADII * model.radius_m)
    z = np.where(ok, z, 1.0)
    size = (camera.fx_px + camera.fy_px) * model.radius_m / z
    pixels = camera.pixels(np.where(ok[:, None], centre, 1.0))
    least, largest = SPHERE_OF_REGION
    reach = OFFSET_OF_REGION * region.diagonal_px
    ok &= (size > least * region.diagonal_px) & (size < largest * region.diagonal_px)
    ok &= np.abs(pixels[:, 0] - 0.5 * (region.x0 + region.x1)) < reach
    ok &= np.abs(pixels[:, 1] - 0.5 * (region.y0 + region.y1)) < reach
    return np.asarray(ok)


def reprojection(
    q: Array, t: Array, corners: ModelCorners, camera: CameraIntrinsics, image: CornerMap
) -> Tuple[Array, Array]:
    """Return the mean truncated distance of image corners to visible model corners [px], and the inlier share.

    An inlier is an image corner within half the truncation distance.

    Notes
    -----
    The distance is taken from image to model. From model to image it is smallest for a craft too far away, whose
    corners crowd around a few image corners.
    """
    error, inliers = np.zeros(len(q)), np.zeros(len(q))
    to = np.ascontiguousarray(image.points.T, np.float32)
    for low in range(0, len(q), BATCH_POSES):
        part = slice(low, low + BATCH_POSES)
        R = quat.matrix(q[part])
        visible = visible_corners(corners, R, t[part])
        pixels = camera.pixels(np.einsum("bij,cj->bci", R, corners.points_m) + t[part, None])
        placed = np.where(visible[..., None], pixels, 1e6).astype(np.float32)
        # compact the visible corners to the front, so that corners visible in no pose are skipped
        first = np.argsort(~visible, axis=1, kind="stable")[:, : int(visible.sum(axis=1).max(initial=0))]
        placed = np.take_along_axis(placed, first[..., None], axis=1)
        gap = np.full((len(R), to.shape[1]), np.float32(image.cap_px**2))
        u, v = np.empty_like(gap), np.empty_like(gap)
        for c in range(placed.shape[1]):
            np.subtract(placed[:, c, :1], to[0], out=u)
            np.subtract(placed[:, c, 1:], to[1], out=v)
            np.multiply(u, u, out=u)
            np.multiply(v, v, out=v)
            np.add(u, v, out=u)
            np.minimum(gap, u, out=gap)
        d = np.sqrt(gap)
        error[part] = d.mean(axis=1)
        inliers[part] = (d < 0.5 * image.cap_px).mean(axis=1)
    return error, inliers


def _mutual_nearest(distance: Array, nearest: Array, is_visible: Array) -> Array:
    """Return a mask (B, C) of visible model corners that are mutual nearest neighbours with an image corner.

    An image corner matches one corner of the craft; others that crowd around it would bias the pose.

    Parameters
    ----------
    distance : (B, C, 2) array
        Vectors from each corner to the nearest image corner [px].
    nearest : (B, C) array
        Index of that image corner.
    is_visible : (B, C) array
        True for visible corners of the model.
    """
    d = np.where(is_visible, np.hypot(distance[..., 0], distance[..., 1]), np.inf)
    least = np.full((len(d), int(nearest.max(initial=0)) + 1), np.inf)
    rows = np.arange(len(d))[:, None]
    np.minimum.at(least, (rows, nearest), d)
    return np.asarray(is_visible & (d <= least[rows, nearest]))


def refine_on_corners(
    q: Array, t: Array, corners: ModelCorners, camera: CameraIntrinsics, image: CornerMap, radius_m: float
) -> Tuple[Array, Array, Array]:
    """Refine poses by Gauss-Newton steps on nearest corners, first with a wide gate, then with a narrow one.

    Return q (B, 4), t (B, 3) and covariance (B, 6, 6).
    """
    H = np.tile(np.eye(6), (len(q), 1, 1))
    rms = np.ones(len(q))
    for k in range(STEPS):
        R = quat.matrix(q)
        visible = visible_corners(corners, R, t)
        arm = np.einsum("bij,cj->bci", R, corners.points_m)
        P = arm + t[:, None]
        z = np.maximum(P[..., 2], 1e-2)
        pixels = camera.pixels(P)
        d, nearest = image.lookup(pixels)
        gate = image.cap_px * (1.0 if k < COARSE_STEPS else 0.5)
        r = image.points[nearest] - pixels
        w = (_mutual_nearest(r, nearest, visible) & (d < gate)) / (
            1 + (d / (WEIGHT_SCALE * image.cap_px)) ** 2
        )
        # d(pixel)/d(point) of the pinhole; the lens changes it by less than the gate
        gu = np.stack([camera.fx_px / z, np.zeros_like(z), -camera.fx_px * P[..., 0] / z**2], axis=-1)
        gv = np.stack([np.zeros_like(z), camera.fy_px / z, -camera.fy_px * P[..., 1] / z**2], axis=-1)
        g = np.concatenate([gu, gv], axis=1)
        both = np.concatenate([arm, arm], axis=1)
        J = np.concatenate([np.cross(both, g), g], axis=-1)
        residual = np.concatenate([r[..., 0], r[..., 1]], axis=1)
        weight = np.concatenate([w, w], axis=1)
        depth = float(np.median(t[:, 2]))
        step, H = gauss_newton_step(J, residual, weight, parameter_scale(depth, radius_m), DAMPING)
        step = np.nan_to_num(step)
        size = np.linalg.norm(step[:, :3], axis=1, keepdims=True)
        q, t = apply_step(q, t, step / np.maximum(1.0, size / MAX_STEP_RAD))
        t[:, 2] = np.maximum(t[:, 2], MIN_RANGE_RADII * radius_m)
        rms = np.sqrt((weight * residual**2).sum(axis=1) / np.maximum(weight.sum(axis=1), 1e-9))
    return q, t, np.linalg.pinv(H) * np.maximum(rms, MIN_RMS_PX)[:, None, None] ** 2


def gauss_newton_step(J: Array, r: Array, w: Array, scale: Array, damping: float) -> Tuple[Array, Array]:
    """Solve the weighted normal equations of a batch.

    Parameters
    ----------
    J : (B, M, 6) array
        Derivatives of the residuals.
    r : (B, M) array
        Residuals.
    w : (B, M) array
        Weights.
    scale : (6,) array
        Natural size of each parameter, for damping.
    damping : float
        Share of the mean diagonal that is added to the diagonal.

    Returns
    -------
    step : (B, 6) array
        Parameter step, unscaled.
    normal : (B, 6, 6) array
        Normal matrix, unscaled.
    """
    Jw = J * w[..., None]
    H = np.swapaxes(Jw, 1, 2) @ J
    g = np.einsum("bmi,bm->bi", Jw, r)
    S = scale[None, :, None] * scale[None, None, :]
    A = H * S
    trace = np.trace(A, axis1=1, axis2=2)[:, None, None]
    A = A + (damping * trace / 6 + 1e-9) * np.eye(6)
    step = np.linalg.solve(A, (g * scale)[..., None])[..., 0] * scale
    return step, H


def apply_step(q: Array, t: Array, step: Array) -> Tuple[Array, Array]:
    """Rotate about the target's origin, then translate, in camera axes."""
    return quat.normalise(quat.multiply(quat.from_rotvec(step[:, :3]), q)), t + step[:, 3:]


def parameter_scale(depth_m: float, radius_m: float) -> Array:
    """Return parameter steps of similar effect on the image: rotations, lateral shifts, shift in depth."""
    return np.array([1, 1, 1, radius_m, radius_m, max(depth_m, radius_m)]) * 0.5
