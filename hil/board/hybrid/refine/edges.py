"""Pose refinement on image edges: robust Gauss-Newton on distances normal to the projected model edges."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Tuple

import cv2
import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.geometry.wireframe import jacobian, project
from flyaround.hil.board.hybrid.hypotheses.hypothesis import EdgeFit, PoseFit
from flyaround.hil.board.hybrid.image.edge_field import EdgeField
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.model.silhouette import inward_sign, silhouette
from flyaround.hil.board.hybrid.model.view_tables import ViewTable
from flyaround.hil.board.hybrid.refine.robust import geman_mcclure, tukey
from flyaround.hil.board.svd.refinement import MIN_RANGE_RADII, apply_step, gauss_newton_step, parameter_scale

Array = np.ndarray

# Bounds of a step, within which the linearisation holds; hand-tuned, as are the values below: rotation [rad], and
# change of range as a share of it. The sideways shift is bounded by the target's radius.
MAX_ROTATION_RAD, MAX_RANGE_SHARE = 0.25, 0.2

# Scale of the Geman-McClure weights as a share of the reach.
WEIGHT_SCALE = 0.4

# Lower bound of the residuals' standard deviation for the biweight [field px].
MIN_SPREAD_PX = 0.35

# Least strength of an edge on a profile, in units of the gradient noise: one of 16,000 samples of noise is stronger.
MIN_STRENGTH = 4.0

# Limit of the biweight, in standard deviations of the residuals; at 4.7 it is 95 % efficient on normal noise.
BIWEIGHT_LIMIT = 4.0

# Scale of the offsets that count as very near [field px].
TIGHT_PX = 0.7

# Gradient strength above which an edge is not preferred any more, in units of the noise.
MAX_STRENGTH = 30.0

# Factor of the covariance of the normal equations, which take neighbouring samples as independent, and the least
# residual that it assumes [field px].
COVARIANCE_INFLATION, MIN_RMS_PX = 4.0, 0.1


def align_to_field(
    target: PreparedTarget,
    q: Array,
    t: Array,
    views: ViewTable,
    field: EdgeField,
    reach_px: Tuple[float, ...],
    every: int = 1,
) -> Tuple[Array, Array]:
    """Align a batch of poses with their closest image edges, one Gauss-Newton step per entry of ``reach_px``.

    Parameters
    ----------
    target : PreparedTarget
        Target with the samples of its edges.
    q : (B, 4) array
        Initial attitudes, camera from target.
    t : (B, 3) array
        Initial positions of the target, camera axes [m].
    views : ViewTable
        Visible samples by viewing direction.
    field : EdgeField
        Image edges of the region.
    reach_px : tuple of float
        Distance beyond which edges are ignored, per iteration [field px].
    every : int
        Use every ``every``-th sample only.

    Returns
    -------
    q : (B, 4) array
        Aligned attitudes, camera from target.
    t : (B, 3) array
        Aligned positions of the target, camera axes [m].
    """
    camera, radius_m = target.camera, target.radius_m
    idx = weight = np.zeros(0)
    for k, reach in enumerate(reach_px):
        R = quat.matrix(q)
        if k % 3 == 0:
            view = views.nearest(R, t, target.centre_m)
            idx, weight = views.track[view, ::every], views.weight[view, ::every]
        pr = project(target.samples, camera, R, t, idx)
        uv = field.to_field(pr.pixels)
        flat, inside = field.lookup(uv, pr.angle)
        d = field.distance.reshape(-1)[flat]
        e = field.nearest.reshape(-1, 2)[flat]
        r = np.einsum("bmi,bmi->bm", e - uv, pr.normals)
        # points less than 0.1 m before the camera project too unsteadily
        w = weight * inside * (d < reach) * (pr.points_camera_m[..., 2] > 0.1)
        w = geman_mcclure(w, r, WEIGHT_SCALE * reach)
        J = jacobian(pr, camera, t) / field.factor
        depth = float(np.median(np.maximum(t[:, 2], radius_m)))
        step, _ = gauss_newton_step(J, r, w, parameter_scale(depth, radius_m), 1e-3)
        step = limit_step(step, t, radius_m)
        q, t = apply_step(q, t, step)
        t[:, 2] = np.maximum(t[:, 2], MIN_RANGE_RADII * radius_m)
    return q, t


def limit_one_step(step: Array, t: Array, radius_m: float) -> Array:
    """Limit one step (6,) as `limit_step` does, in scalar arithmetic, which is faster than NumPy for six numbers."""
    a, b, c, x, y, z = step.tolist()
    ratio = max(
        math.sqrt(a * a + b * b + c * c) / MAX_ROTATION_RAD,
        abs(z) / (MAX_RANGE_SHARE * max(float(t[2]), radius_m)),
        math.sqrt(x * x + y * y) / radius_m,
        1.0,
    )
    if not math.isfinite(ratio + a + b + c + x + y + z):
        step = limit_step(step[None], t[None], radius_m)[0]
        return np.asarray(step)
    return step / ratio


def limit_step(step: Array, t: Array, radius_m: float) -> Array:
    """Scale down steps (B, 6) that leave the region where the linearisation holds.

    A step rotates by at most ``MAX_ROTATION_RAD``, changes the range by at most ``MAX_RANGE_SHARE`` of it, and shifts
    sideways by at most the radius. A step that is not finite, or whose length overflows, becomes zero.
    """
    depth = np.maximum(t[:, 2], radius_m)
    step = np.where(np.isfinite(step).all(axis=1, keepdims=True), step, 0.0)
    with np.errstate(over="ignore"):
        ratio = np.maximum(
            np.linalg.norm(step[:, :3], axis=1) / MAX_ROTATION_RAD,
            np.maximum(
                np.abs(step[:, 5]) / (MAX_RANGE_SHARE * depth),
                np.linalg.norm(step[:, 3:5], axis=1) / radius_m,
            ),
        )
    return step / np.maximum(1.0, np.nan_to_num(ratio, nan=np.inf, posinf=np.inf))[:, None]


@dataclass(frozen=True, eq=False)
class Gradients:
    """Image gradient of a region at nearly full resolution, for the sub-pixel edge search.

    Parameters
    ----------
    gx : (h, w) array
        Gradient along the columns, float32.
    gy : (h, w) array
        Gradient along the rows, float32.
    sigma : float
        Standard deviation of the noise of one component.
    x0 : float
        Left edge of the region, as in `EdgeField`.
    y0 : float
        Upper edge of the region, as in `EdgeField`.
    factor : float
        Image pixels per pixel of the region.
    empty : bool
        True if the background is empty space.
    """

    gx: Array
    gy: Array
    sigma: float
    x0: float
    y0: float
    factor: float
    empty: bool


def fine_align(
    target: PreparedTarget, q: Array, t: Array, idx: Array, gradients: Gradients, reach_px: Tuple[int, ...]
) -> Tuple[PoseFit, EdgeFit]:
    """Align a pose by one-dimensional searches along the normals of visible samples, with sub-pixel accuracy.

    Edge polarity is ignored except on the silhouette in front of empty space. There the craft is the brighter side,
    which distinguishes the outer edge of a bright frame from the inner one.

    Parameters
    ----------
    target : PreparedTarget
        Target with the samples of its edges.
    q : (4,) array
        Attitude, camera from target.
    t : (3,) array
        Position of the target, camera axes [m].
    idx : (M,) array
        Indices of the visible samples.
    gradients : Gradients
        Gradient of the region.
    reach_px : tuple of int
        Half length of the search, per iteration [field px].

    Returns
    -------
    PoseFit
        Aligned pose with its covariance; the initial pose if no sample is visible.
    EdgeFit
        Share and accuracy of the samples that found an edge.

    References
    ----------
    Harris & Stennett (1990), RAPID; Drummond & Cipolla (2002), robust weights.
    """
    q, t = q[None].copy(), t[None].copy()
    camera, radius_m, f = target.camera, target.radius_m, gradients.factor
    origin = gradients.x0, gradients.y0
    H, rms, matched_share, tight, inliers = np.eye(6), 9.9, 0.0, 0.0, 0.0
    if not len(idx):
        return PoseFit(q[0], t[0]), EdgeFit(matched_share, tight, rms * f)
    h, w = gradients.gx.shape
    for reach in reach_px:
        pr = project(target.samples, camera, quat.matrix(q), t, idx[None])
        uv = ((pr.pixels[0] - origin + 0.5) / f - 0.5).astype(np.float32)
        n = pr.normals[0].astype(np.float32)
        inward = np.zeros(len(uv), int)
        if gradients.empty:
            shape = silhouette(quat.matrix(q)[0], t[0], target.occ, camera, origin, f, (w, h))
            inward = inward_sign(shape, uv, n)
        offset, strength = search_normals(gradients, uv, n, inward, reach)
        is_edge = strength > MIN_STRENGTH
        r = np.where(is_edge, offset, 0.0)
        spread = max(MIN_SPREAD_PX, 1.4826 * float(np.median(np.abs(r[is_edge]))) if is_edge.any() else 1.0)
        weight = is_edge * tukey(r, BIWEIGHT_LIMIT * spread)
        J = jacobian(pr, camera, t) / f
        step, normal = gauss_newton_step(
            J, r[None], weight[None], parameter_scale(float(t[0, 2]), radius_m), 1e-6
        )
        step = limit_step(step, t, radius_m)
        q, t = apply_step(q, t, step)
        H = normal[0]
        inliers = float(weight.sum())
        matched_share = inliers / len(idx)
        tight = float((is_edge * np.exp(-((r / TIGHT_PX) ** 2))).sum()) / len(idx)
        rms = float(np.sqrt((weight * r * r).sum() / max(inliers, 1e-9)))
    covariance = np.linalg.pinv(H) * max(rms, MIN_RMS_PX) ** 2 * COVARIANCE_INFLATION
    return PoseFit(q[0], t[0], covariance), EdgeFit(matched_share, tight, rms * f)


def search_normals(
    gradients: Gradients, uv: Array, n: Array, inward: Array, reach: int
) -> Tuple[Array, Array]:
    """Search the best edge along each normal.

    The best edge is the local maximum of gradient strength, weighted in favour of small offsets.

    Returns
    -------
    offset : (M,) array
        Sub-pixel offset along the normal [field px]; 0 without an edge.
    strength : (M,) array
        Gradient in units of its noise; 0 without an edge.
    """
    k = np.arange(-reach, reach + 1, dtype=np.float32)
    x = uv[:, :1] + n[:, :1] * k
    y = uv[:, 1:] + n[:, 1:] * k
    gx = cv2.remap(gradients.gx, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
    gy = cv2.remap(gradients.gy, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
    g = (gx * n[:, :1] + gy * n[:, 1:]) / gradients.sigma
    polarity = inward[:, None]
    g = np.where(polarity == 0, np.abs(g), np.maximum(g * polarity, 0.0))
    peak = np.zeros_like(g)
    mid = g[:, 1:-1]
    is_peak = (mid >= g[:, :-2]) & (mid > g[:, 2:])
    # clip the strength: a distant strong edge must not win over a near moderate one
    weight = np.minimum(mid, MAX_STRENGTH) * (1 - 0.6 * np.abs(k[1:-1]) / (reach + 1e-6))
    peak[:, 1:-1] = np.where(is_peak, weight, 0.0)
    best = np.argmax(peak, axis=1)
    rows = np.arange(len(g))
    is_edge = peak[rows, best] > 0
    best = np.clip(best, 1, g.shape[1] - 2)
    a, b, c = g[rows, best - 1], g[rows, best], g[rows, best + 1]
    curve = a - 2 * b + c
    sub = np.where(np.abs(curve) > 1e-6, 0.5 * (a - c) / np.where(np.abs(curve) > 1e-6, curve, 1.0), 0.0)
    return np.where(is_edge, k[best] + np.clip(sub, -0.5, 0.5), 0.0), np.where(is_edge, b, 0.0)
