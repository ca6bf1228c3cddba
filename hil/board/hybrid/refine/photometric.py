"""Alignment of the drawn craft on the picture itself: every pixel counts, each by what the pose does to it."""

from __future__ import annotations

import functools
from typing import Optional, Tuple

import cv2
import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.faces import Faces
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.geometry.shading import Shading
from flyaround.hil.board.hybrid.hypotheses.hypothesis import PoseFit
from flyaround.hil.board.hybrid.model.face_gains import OPTICS_PX, shade
from flyaround.hil.board.hybrid.model.image_formation import gaussian, response_tables
from flyaround.hil.board.hybrid.model.many_groups import blurred
from flyaround.hil.board.hybrid.model.rasteriser import draw_faces, order_faces
from flyaround.hil.board.hybrid.model.shadow_map import ShadowMap
from flyaround.hil.board.hybrid.native.interface import contiguous
from flyaround.hil.board.hybrid.native.library import library
from flyaround.hil.board.hybrid.refine import many_groups
from flyaround.hil.board.hybrid.refine.edges import limit_one_step
from flyaround.hil.board.hybrid.refine.many_groups import bounded
from flyaround.hil.board.hybrid.refine.motion_images import pose_motion
from flyaround.hil.board.svd.refinement import parameter_scale

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

# Groups of faces whose brightness is found together with the pose, and at the end.
JOINT, JOINT_AT_END = 16, 40

# Verification: blur against noise [patch px], and the residual beyond which more costs no more [noise].
SCORE_BLUR_PX, BOUND = 0.8, 6.0

# Share of the scale from which a pixel is burnt out, noise and all.
BURNT_OUT = 0.94

# Share of a pixel covered from which it counts where there is a texture behind.
COVERED = 0.05

# Most groups with a brightness of their own (coverage.h), and a matrix with room for them.
MOST, ROOM = 63, (63 + 7) ** 2

# The library returns two counts in one number, the second times this.
PACK = 1000


def photo_draw(
    q: Array,
    t: Array,
    faces: Faces,
    patch: ImagePatch,
    camera: CameraIntrinsics,
    sun: Optional[ShadowMap] = None,
) -> Shading:
    """Draw the craft at a pose, as bright as the picture says.

    Parameters
    ----------
    camera : a pinhole (see ``ImagePatch.rays``). sun : casts shadows; None draws none.
    """
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
    blur : of both pictures [patch px]; wide ones reach far. relax : how much longer the step is made.
    joint : groups whose brightness is found together with the pose.
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
    if shading.group.dtype != np.uint8:
        return many_groups.gram(shading, faces, patch, camera, R, t, blurs_px, noise, slack, tukey, joint)
    (h, w), f = patch.gray.shape, patch.fine
    out, total = np.empty(ROOM), np.zeros(1)
    packed = library().fly_normal_equations(
        pose_motion(shading, faces, patch, camera, R, t),
        contiguous(shading.group, "uint8", (h * f, w * f)),
        contiguous(shading.centre, "uint8", (h, w)),
        contiguous(shading.picture, "float32", (h, w)),
        contiguous(patch.blurred(blurs_px[1]), "float32", (h, w)),
        h,
        w,
        f,
        response_tables(patch.response),
        *(gaussian(b) for b in blurs_px),
        noise,
        slack,
        tukey,
        min(joint, MOST - 1),
        out,
        total,
    )
    if packed < 0:
        raise MemoryError("no memory for a step's normal equations")
    k, rows = packed % PACK + 7, packed // PACK
    return out[: k * k].reshape(k, k), float(total[0]), int(rows)


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


def explained(shading: Shading, patch: ImagePatch) -> float:
    """Return how much better the drawn craft explains the picture than the background alone, 0..1.

    Residuals are bounded: a shadow that is not drawn costs its area, not its depth.
    """
    noise, none, least = _without_craft(patch)
    blurs = OPTICS_PX / patch.factor, SCORE_BLUR_PX, 1.0
    left = _unexplained(shading, patch, noise, none, blurs, BOUND**2, COVERED)
    return 1.0 - left / max(least, 1e-9)


@functools.lru_cache(maxsize=4)
def _without_craft(patch: ImagePatch) -> Tuple[float, Array, float]:
    """Noise of the patch blurred for the score, deviations (h, w) from its background, and what they leave."""
    noise = patch.sigma / (2 * np.sqrt(np.pi) * SCORE_BLUR_PX)
    none = (patch.blurred(SCORE_BLUR_PX) - patch.background) / noise
    return noise, contiguous(none, "float32"), bounded(none, BOUND**2)


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
    if shading.group.dtype != np.uint8:
        return many_groups.unexplained(shading, patch, noise, none, blurs_px, bound, covered)
    (h, w), f = patch.gray.shape, patch.fine
    optics, score, cover = (gaussian(b) for b in blurs_px)
    left: float = library().fly_photometric_cost(
        contiguous(shading.picture, "float32", (h, w)),
        contiguous(shading.group, "uint8", (h * f, w * f)),
        h,
        w,
        f,
        optics,
        response_tables(patch.response),
        contiguous(patch.blurred(blurs_px[1]), "float32", (h, w)),
        score,
        noise,
        bound,
        contiguous(none, "float32", (h, w)) if patch.textured else None,
        cover,
        covered,
    )
    if left < 0:
        raise MemoryError("no memory to compare a drawn craft with the picture")
    return left


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
    covered = 1.0 - bounded((gray - drawn) / noise, BOUND**2) / max(bounded(none, BOUND**2), 1e-9)
    return float(np.corrcoef(gray, drawn)[0, 1]), covered


def burnt_share(shading: Shading, patch: ImagePatch) -> float:
    """Share of what a drawn craft covers that is at the end of the picture's scale."""
    on = shading.centre > 0
    return float((patch.gray[on] > BURNT_OUT * patch.full).mean()) if on.any() else 0.0
