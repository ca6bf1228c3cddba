"""Alignment of the drawn craft on the picture itself: every pixel counts, each by what the pose does to it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Tuple

import cv2
import numpy as np

from hil.board.svd import quaternion as quat
from hil.board.svd.levels import LOCAL_FACES, OPTICS_PX, blurred, coverage, shade
from hil.board.svd.model import CameraIntrinsics
from hil.board.svd.motion import motion_images
from hil.board.svd.refine import apply_step, gauss_newton_step, limit_step, parameter_scale
from hil.board.svd.shade import Canvas, Faces, draw_faces

Array = np.ndarray

# Where a residual stops counting, in units of its robust spread.
TUKEY = 4.0

# How far an edge may be from where it is drawn: at the end, and more for each pixel of blur [canvas px].
FLOOR_PX, SLACK = 0.2, 0.6

# Faces whose brightness is found together with the pose.
JOINT = 16

# Verification: blur against noise [canvas px], and the residual beyond which more costs no more [noise].
SCORE_BLUR_PX, BOUND = 0.8, 6.0


@dataclass(frozen=True, eq=False)
class PhotoFit:
    """A pose aligned on the picture.

    Parameters
    ----------
    q, t : (4,), (3,). explained : share of the picture's variance within the region that is explained.
    cost : mean robust residual in noise units. covariance : (6, 6).
    """

    q: Array
    t: Array
    cost: float
    covariance: Array


def photo_align(
    q: Array,
    t: Array,
    faces: Faces,
    canvas: Canvas,
    camera: CameraIntrinsics,
    radius_m: float,
    blurs_px: Tuple[float, ...],
    local_faces: int = LOCAL_FACES,
) -> PhotoFit:
    """Gauss-Newton on the difference of the picture and the drawn craft.

    Parameters
    ----------
    blurs_px : blur of both pictures in each iteration [canvas px]: wide first, to reach far.
    local_faces : see ``shade``; none is enough to rank poses.
    """
    q, t = q[None].copy(), t[None].copy()
    R = quat.matrix(q)[0]
    order = faces.order(-R.T @ t[0])
    H, cost = np.eye(6), 9.9
    for blur in blurs_px:
        R = quat.matrix(q)[0]
        shading = shade(faces, draw_faces(faces, order, camera, R, t[0], canvas), canvas, local_faces)
        optics = float(np.hypot(blur, OPTICS_PX / canvas.factor))
        drawn = blurred(np.minimum(blurred(shading.picture, OPTICS_PX / canvas.factor), canvas.full), blur)
        e = blurred(canvas.gray, blur) - drawn
        D = motion_images(shading, faces, canvas, camera, R, t[0])
        D = np.stack([blurred(d, optics) for d in D])
        use = np.abs(D).max(axis=0) > 1e-6
        cover = coverage(shading, canvas, JOINT)
        M = np.stack([blurred(m, optics) for m in cover])
        craft = shading.centre > 0
        noise = canvas.sigma / max(1.0, 2 * np.sqrt(np.pi) * blur)
        gx, gy = (
            cv2.Sobel(drawn, cv2.CV_32F, 1, 0, scale=0.125),
            cv2.Sobel(drawn, cv2.CV_32F, 0, 1, scale=0.125),
        )
        slope = (FLOOR_PX + SLACK * blur) ** 2 * (gx * gx + gy * gy)
        weight = np.zeros(e.shape)
        for part in (craft, ~craft):
            m = part & use
            if m.any():
                flat = m & (slope < noise**2)
                spread = max(1.4826 * float(np.median(np.abs(e[flat]))) if flat.any() else noise, noise)
                variance = spread**2 + slope[m]
                weight[m] = np.clip(1 - e[m] ** 2 / (TUKEY**2 * variance), 0, None) ** 2 / variance
        rows = use & (weight > 0)
        if int(rows.sum()) < 30:
            break
        J, r, wt = D[:, rows].T.astype(float), e[rows].astype(float), weight[rows]
        J, r = without(M[:, rows].T.astype(float), J, r, wt)
        step, normal = gauss_newton_step(
            J[None], r[None], wt[None], parameter_scale(float(t[0, 2]), radius_m), 1e-5
        )
        q, t = apply_step(q, t, limit_step(step, t, radius_m))
        H = normal[0]
        cost = float(np.sqrt((wt * r * r).sum() / wt.sum())) / noise
    return PhotoFit(q[0], t[0], cost, np.linalg.pinv(H))


def without(M: Array, J: Array, r: Array, w: Array) -> Tuple[Array, Array]:
    """Columns ``J`` (N, 6) and residuals ``r`` (N,) less what the levels ``M`` (N, K) explain of them.

    Golub and Pereyra (1973), variable projection: a step of the pose must not be judged with brightnesses that
    were taken from the picture at the old one.
    """
    Mw = M * w[:, None]
    A = Mw.T @ M
    A += (1e-6 * np.trace(A) / max(len(A), 1) + 1e-12) * np.eye(len(A))
    x = np.linalg.solve(A, Mw.T @ np.column_stack([J, r]))
    left = np.column_stack([J, r]) - M @ x
    return left[:, :-1], left[:, -1]


def photo_score(q: Array, t: Array, faces: Faces, canvas: Canvas, camera: CameraIntrinsics) -> float:
    """How much better the drawn craft explains the picture than the background alone, 0..1.

    Residuals are bounded: a shadow that is not drawn costs its area, not its depth.
    """
    R = quat.matrix(q)
    seen = draw_faces(faces, faces.order(-R.T @ t), camera, R, t, canvas)
    shading = shade(faces, seen, canvas, local_faces=0)
    drawn = np.minimum(blurred(shading.picture, OPTICS_PX / canvas.factor), canvas.full)
    gray = blurred(canvas.gray, SCORE_BLUR_PX)
    noise = canvas.sigma / (2 * np.sqrt(np.pi) * SCORE_BLUR_PX)
    e = (gray - blurred(drawn, SCORE_BLUR_PX)) / noise
    none = (gray - canvas.plain) / noise
    return 1.0 - float(_bounded(e) / max(_bounded(none), 1e-9))


def _bounded(e: Array) -> float:
    # the noise itself costs one everywhere: it is nobody's fault
    return float(np.maximum(np.minimum(e * e, BOUND**2) - 1.5, 0.0).sum())
