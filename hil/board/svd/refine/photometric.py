"""Alignment of the drawn craft on the picture itself: every pixel counts, each by what the pose does to it."""

from __future__ import annotations

from typing import Optional, Tuple

import cv2
import numpy as np

from flyaround.hil.board.svd.geometry import quaternion as quat
from flyaround.hil.board.svd.geometry.camera import CameraIntrinsics
from flyaround.hil.board.svd.geometry.faces import Faces
from flyaround.hil.board.svd.geometry.image_patch import ImagePatch
from flyaround.hil.board.svd.geometry.shading import Shading
from flyaround.hil.board.svd.hypotheses.hypothesis import PoseFit
from flyaround.hil.board.svd.model.face_gains import OPTICS_PX, blurred, coverage, shade
from flyaround.hil.board.svd.model.rasteriser import draw_faces, order_faces
from flyaround.hil.board.svd.model.shadow_map import ShadowMap
from flyaround.hil.board.svd.native.backend import accelerated
from flyaround.hil.board.svd.native.photometric import face_gains as native_gains
from flyaround.hil.board.svd.native.photometric import normal_equations as native_step
from flyaround.hil.board.svd.refine.edges import limit_one_step, parameter_scale
from flyaround.hil.board.svd.refine.motion_images import motion_images

Array = np.ndarray

# Where a residual stops counting, in units of its robust spread.
TUKEY = 4.0

# How far an edge may be from where it is drawn: at the end, and more for each pixel of blur [patch px].
FLOOR_PX, SLACK = 0.2, 0.6

# Steps on blurred pictures are made longer by this: they fall short, for the levels follow the error of the pose.
RELAX = 1.5

# What is not drawn outweighs the noise: variance over that of the normal equations, so that errors against
# development frames have the median of chi-square (eval-black and eval-earth, seeds 6001 and 6002).
INFLATION = 150.0

# A pixel that a shift by a pixel of the patch changes by less, in units of the noise, is left out of a step: these are
# one in three, and hold less than a thousandth of what the picture says.
TELLS = 0.02

# Groups of faces whose brightness is found together with the pose, and at the end.
JOINT, JOINT_AT_END = 16, 40

# Verification: blur against noise [patch px], and the residual beyond which more costs no more [noise].
SCORE_BLUR_PX, BOUND = 0.8, 6.0

# Share of the scale from which a pixel is burnt out, noise and all.
BURNT_OUT = 0.94

# Share of a pixel covered from which it counts where there is a texture behind.
COVERED = 0.05


def photo_align(
    q: Array,
    t: Array,
    faces: Faces,
    patch: ImagePatch,
    camera: CameraIntrinsics,
    radius_m: float,
    blurs_px: Tuple[float, ...],
    sun: Optional[ShadowMap] = None,
    relax: float = RELAX,
    joint: int = JOINT,
) -> PoseFit:
    """Gauss-Newton on the difference of the picture and the drawn craft.

    Parameters
    ----------
    camera : a pinhole (see ``ImagePatch.rays``). blurs_px : blur of both pictures in each iteration [patch px]: wide
        first, to reach far. sun : casts shadows; None draws none. relax : how much longer
        steps on blurred pictures are made. joint : groups whose brightness is found together with the pose.
    """
    fit = PoseFit(q, t, 9.9, INFLATION * np.eye(6))
    for blur in blurs_px:
        shading = photo_draw(fit.q, fit.t, faces, patch, camera, sun)
        longer = relax if blur > 0 else 1.0
        step = photo_step(fit, shading, faces, patch, camera, radius_m, blur, longer, joint)
        if step is None:
            break
        fit = step
    return fit


def photo_draw(
    q: Array,
    t: Array,
    faces: Faces,
    patch: ImagePatch,
    camera: CameraIntrinsics,
    sun: Optional[ShadowMap] = None,
) -> Shading:
    """The craft drawn at a pose, as bright as the picture says; parameters as in ``photo_align``."""
    R = quat.matrix(q)
    seen = draw_faces(faces, order_faces(faces, -R.T @ t), camera, R, t, patch)
    return photo_shade(seen, q, t, faces, patch, camera, sun)


def photo_shade(
    seen: Array,
    q: Array,
    t: Array,
    faces: Faces,
    patch: ImagePatch,
    camera: CameraIntrinsics,
    sun: Optional[ShadowMap] = None,
) -> Shading:
    """The same where the faces ``seen`` at the pose are drawn already."""
    dark = None if sun is None else sun.shadows(faces, seen, patch, camera, quat.matrix(q), t)
    return shade(faces, seen, patch, dark)


def photo_step(
    fit: PoseFit,
    shading: Shading,
    faces: Faces,
    patch: ImagePatch,
    camera: CameraIntrinsics,
    radius_m: float,
    blur: float,
    relax: float = RELAX,
    joint: int = JOINT,
) -> Optional[PoseFit]:
    """One step from the pose that ``shading`` was drawn at; None where the picture says nothing.

    Parameters
    ----------
    others as in ``photo_align``.
    """
    R, t = quat.matrix(fit.q), fit.t
    noise = patch.sigma / max(1.0, 2 * np.sqrt(np.pi) * blur)
    blurs = OPTICS_PX / patch.factor, blur, float(np.hypot(blur, OPTICS_PX / patch.factor))
    slack = (FLOOR_PX + SLACK * blur) ** 2
    G, total, rows = _gram(shading, faces, patch, camera, R, t, blurs, noise, slack, TUKEY**2, joint)
    if rows < 30:
        return None
    H, g, cost = projected(G)
    scale = parameter_scale(float(t[2]), radius_m)
    step = relax * damped_step(H, g, scale, 1e-5)
    step = limit_one_step(step, t, radius_m)
    cost = float(np.sqrt(cost / max(total, 1e-12))) / noise
    return PoseFit(quat.turned(fit.q, step[:3]), t + step[3:], cost, INFLATION * _inverse(H))


def _inverse(H: Array) -> Array:
    """Inverse of a normal matrix, the pseudo-inverse where there is none: that alone costs as much as ten of these."""
    try:
        return np.asarray(np.linalg.inv(H))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(H))


def _in_bytes(shading: Shading, *_: object) -> bool:
    return shading.group.dtype == np.uint8


@accelerated(native_step.normal_products, _in_bytes)
def _gram(
    shading: Shading,
    faces: Faces,
    patch: ImagePatch,
    camera: CameraIntrinsics,
    R: Array,
    t: Array,
    blurs_px: Tuple[float, float, float],
    noise: float,
    slack: float,
    tukey: float,
    joint: int,
) -> Tuple[Array, float, int]:
    """Products (K + 7, K + 7) of a step's weighted rows, the sum of weights, and how many pixels count.

    Parameters
    ----------
    blurs_px : of the optics, of this step, and of both. noise : of the patch blurred so. slack : squared distance that
        borders may still be off [px^2]. tukey : squared bound in units of a residual's deviation. joint : groups whose
        level is found with the pose.
    """
    lens, blur, optics = blurs_px
    shown, slope = patch.response.of(blurred(shading.picture, lens))
    drawn = blurred(shown, blur)
    e = patch.blurred(blur) - drawn
    D = [blurred(plane, optics) for plane in motion_images(shading, faces, patch, camera, R, t)]
    across, down = patch.scale
    least = TELLS * noise / (max(abs(float(t[2])), 1e-9) * patch.fine)
    use = (np.abs(D[3]) > least * across * camera.fx_px) | (np.abs(D[4]) > least * down * camera.fy_px)
    rows, w = _weights(e, drawn, use, shading.centre > 0, noise, slack, tukey)
    A = np.zeros((joint + 8, len(rows)), np.float32)
    k = coverage(shading, patch, joint, optics, rows, A)
    for j, x in enumerate((*D, e)):
        x.ravel().take(rows, out=A[k + j], mode="clip")
    A = A[: k + 7]
    if slope is not None:
        A[:-1] *= blurred(slope, blur).ravel().take(rows)
    A *= np.sqrt(w)
    return (A @ A.T).astype(float), float(w.sum()), len(rows)


def _weights(
    e: Array, drawn: Array, use: Array, craft: Array, noise: float, slack: float, tukey: float
) -> Tuple[Array, Array]:
    """Residuals that count, as flat indices (N,), and the weight (N,) float32 of each.

    From its noise, how far borders may still be off, and Tukey's bound.
    """
    gx = cv2.Sobel(drawn, cv2.CV_32F, 1, 0, scale=0.125)
    gy = cv2.Sobel(drawn, cv2.CV_32F, 0, 1, scale=0.125)
    rows = np.flatnonzero(use)
    craft = craft.ravel().take(rows)
    gx, gy, e = (a.ravel().take(rows) for a in (gx, gy, e))
    slope = np.float32(slack) * (gx * gx + gy * gy)
    flat = slope < noise**2
    spread = []
    for part in (~craft, craft):
        sample = np.abs(e[part & flat])[::2]
        middle = float(np.partition(sample, len(sample) // 2)[len(sample) // 2]) if len(sample) else 0.0
        spread.append(max(1.4826 * middle, noise) ** 2)
    variance = np.array(spread, np.float32).take(craft.view(np.uint8)) + slope
    weight = np.clip(1 - e * e / (np.float32(tukey) * variance), 0, None) ** 2 / variance
    counts = np.flatnonzero(weight)
    return rows.take(counts), weight.take(counts)


def projected(G: Array) -> Tuple[Array, Array, float]:
    """Normal matrix (6, 6), right side (6,) and squared residual of weighted rows, levels projected out.

    Golub and Pereyra (1973), variable projection: a step of the pose must not be judged with brightnesses that
    were taken from the picture at the old one.

    Parameters
    ----------
    G : (K + 7, K + 7) products of K levels' derivatives, six of the pose and the residual, all weighted.
    """
    k = len(G) - 7
    L = _loaded(G[:k, :k], 1e-6, 1e-12)
    left = G[k:, k:] - G[k:, :k] @ np.linalg.solve(L, G[:k, k:])
    return left[:6, :6], left[:6, 6], max(float(left[6, 6]), 0.0)


def damped_step(H: Array, g: Array, scale: Array, damping: float) -> Array:
    """(6,) step of the damped normal equations, in parameters of like size."""
    A = _loaded(H * scale[:, None] * scale[None, :], damping, 1e-9)
    return np.asarray(np.linalg.solve(A, g * scale) * scale)


def _loaded(A: Array, share: float, least: float) -> Array:
    """The matrix with ``share`` of its diagonal's mean and ``least`` added to each of that."""
    A = A.copy()
    diagonal = A.ravel()[:: len(A) + 1]
    diagonal += share * diagonal.sum() / max(len(A), 1) + least
    return A


def photo_score(
    q: Array,
    t: Array,
    faces: Faces,
    patch: ImagePatch,
    camera: CameraIntrinsics,
    sun: Optional[ShadowMap] = None,
) -> float:
    """How much better the drawn craft explains the picture than the background alone, 0..1.

    Residuals are bounded: a shadow that is not drawn costs its area, not its depth.

    Parameters
    ----------
    as in ``photo_align``.
    """
    return explained(photo_draw(q, t, faces, patch, camera, sun), patch)


def explained(shading: Shading, patch: ImagePatch) -> float:
    """The same of a craft that is drawn already."""
    if "none" not in patch.kept:
        noise = patch.sigma / (2 * np.sqrt(np.pi) * SCORE_BLUR_PX)
        none = (patch.blurred(SCORE_BLUR_PX) - patch.background) / noise
        patch.kept["none"] = noise, none, _bounded(none)
    noise, none, least = patch.kept["none"]
    blurs = OPTICS_PX / patch.factor, SCORE_BLUR_PX, 1.0
    left = _unexplained(shading, patch, noise, none, blurs, BOUND**2, COVERED)
    return 1.0 - left / max(least, 1e-9)


@accelerated(native_gains.unexplained, _in_bytes)
def _unexplained(
    shading: Shading,
    patch: ImagePatch,
    noise: float,
    none: Array,
    blurs_px: Tuple[float, float, float],
    bound: float,
    covered: float,
) -> float:
    """Sum of bounded squared deviations of a synthetic view from the patch.

    Parameters
    ----------
    noise : of the patch blurred for this. none : (h, w) deviations without the craft, which hold where no more than
        ``covered`` of a pixel is. blurs_px : of the optics, the score, and what is covered. bound : squared.
    """
    lens, blur, cover_blur = blurs_px
    drawn = patch.response.of(blurred(shading.picture, lens))[0]
    e = (patch.blurred(blur) - blurred(drawn, blur)) / noise
    if patch.textured:
        # clutter beside the craft is no pose's merit or fault
        h, w = e.shape
        cover = cv2.resize((shading.group > 0).astype(np.float32), (w, h), interpolation=cv2.INTER_AREA)
        e = np.where(blurred(cover, cover_blur) > covered, e, none)
    return _bounded(e, bound)


def photo_likeness(
    q: Array,
    t: Array,
    faces: Faces,
    patch: ImagePatch,
    camera: CameraIntrinsics,
    sun: Optional[ShadowMap] = None,
) -> Tuple[float, float]:
    """How the craft drawn at a pose looks like the picture; parameters as in ``photo_align``."""
    return likeness(photo_draw(q, t, faces, patch, camera, sun), patch)


def likeness(shading: Shading, patch: ImagePatch) -> Tuple[float, float]:
    """How the drawn craft looks like the picture where it covers it, clutter beside it left out.

    Returns
    -------
    Correlation of the two there, -1..1, and how much better the drawn craft explains these pixels than the
    background alone, 1 at most. Both are zero where next to nothing is covered.
    """
    picture = shading.picture
    h, w = patch.gray.shape
    cover = cv2.resize((shading.seen > 0).astype(np.float32), (w, h), interpolation=cv2.INTER_AREA)
    on = blurred(cover, 1.0) > COVERED
    drawn = blurred(picture, float(np.hypot(SCORE_BLUR_PX, OPTICS_PX / patch.factor)))
    drawn = patch.response.of(drawn)[0][on].astype(float)
    gray = patch.blurred(SCORE_BLUR_PX)
    noise = patch.sigma / (2 * np.sqrt(np.pi) * SCORE_BLUR_PX)
    none = ((gray - patch.background) / noise)[on]
    gray = gray[on].astype(float)
    if len(gray) < 30 or not gray.std() * drawn.std() > 0:
        return 0.0, 0.0
    covered = 1.0 - _bounded((gray - drawn) / noise) / max(_bounded(none), 1e-9)
    return float(np.corrcoef(gray, drawn)[0, 1]), covered


def burnt_share(shading: Shading, patch: ImagePatch) -> float:
    """Share of what a drawn craft covers that is at the end of the picture's scale."""
    on = shading.centre > 0
    return float((patch.gray[on] > BURNT_OUT * patch.full).mean()) if on.any() else 0.0


def _bounded(e: Array, bound: float = BOUND**2) -> float:
    # the noise itself costs one everywhere: it is nobody's fault
    return float(np.maximum(np.minimum(e * e, bound) - 1.5, 0.0).sum())
