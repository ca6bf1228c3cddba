"""Photometric alignment: Gauss-Newton steps on every pixel that depends on the pose."""

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
from flyaround.hil.board.hybrid.model.image_formation import blurred, gaussian, response_tables
from flyaround.hil.board.hybrid.model.rasteriser import draw_faces, order_faces
from flyaround.hil.board.hybrid.model.shadow_map import ShadowMap
from flyaround.hil.board.hybrid.native.interface import contiguous
from flyaround.hil.board.hybrid.native.library import library
from flyaround.hil.board.hybrid.refine.edges import limit_one_step
from flyaround.hil.board.hybrid.refine.motion_images import pose_motion
from flyaround.hil.board.svd.refinement import parameter_scale

Array = np.ndarray

# Limit of Tukey's biweight [standard deviations]; 4.685 has 95 % efficiency for normal residuals, a lower limit rejects
# more outliers.
BIWEIGHT_LIMIT = 4.0

# Expected distance of an edge from its rendering: at the end [patch px], and per pixel of blur; hand-tuned.
EDGE_ERROR_PX, EDGE_ERROR_PER_BLUR = 0.2, 0.6

# Over-relaxation of steps on blurred images, which are too short because brightnesses absorb part of the error;
# hand-tuned.
OVER_RELAXATION = 1.5

# Factor on the covariance of the normal equations, because model errors outweigh noise. With it, the errors on
# development frames have the median of the chi-square distribution.
COVARIANCE_INFLATION = 150.0

# Least number of pixels of a fit, five for each of its six parameters.
MIN_ROWS = 30

# Maximum number of groups of faces whose brightness is estimated with the pose: in general, and at the end (forty:
# docs/lab/2026-11-estimator.md).
JOINT_GROUPS, FINAL_JOINT_GROUPS = 16, 40

# Blur of the score [patch px], and limit of its residuals [sigma of the noise]; hand-tuned.
SCORE_BLUR_PX, MAX_RESIDUAL_SIGMA = 0.8, 6.0

# Share of full scale above which a noisy pixel counts as saturated.
SATURATED = 0.94

# Minimum coverage at which a pixel counts in front of a texture.
MIN_COVERAGE = 0.05

# Maximum number of groups with separate brightness (coverage.h), and number of elements of their normal matrix.
MAX_GROUPS, MATRIX_SIZE = 63, (63 + 7) ** 2

# The library returns two counts as first + COUNT_BASE * second.
COUNT_BASE = 1000


def photo_draw(
    q: Array,
    t: Array,
    faces: Faces,
    patch: ImagePatch,
    camera: CameraIntrinsics,
    sun: Optional[ShadowMap] = None,
) -> Shading:
    """Render the craft at a pose, with brightnesses estimated from the image.

    Parameters
    ----------
    q : (4,) array
        Attitude, camera from target.
    t : (3,) array
        Position of the target, camera axes [m].
    faces : Faces
        Faces of the target.
    patch : ImagePatch
        Reduced region of the image around the target.
    camera : CameraIntrinsics
        Pinhole camera (see ``ImagePatch.rays``).
    sun : ShadowMap, optional
        Source of shadows; None for no shadows.
    """
    R = quat.matrix(q)
    visible_face = draw_faces(faces, order_faces(faces, -R.T @ t), camera, R, t, patch)
    return photo_shade(visible_face, q, t, faces, patch, camera, sun)


def photo_shade(
    visible_face: Array,
    q: Array,
    t: Array,
    faces: Faces,
    patch: ImagePatch,
    camera: CameraIntrinsics,
    sun: Optional[ShadowMap] = None,
) -> Shading:
    """Return the view of the faces from ``draw_faces`` at the pose; other parameters as in ``photo_draw``."""
    dark = None if sun is None else sun.shadows(faces, visible_face, patch, camera, quat.matrix(q), t)
    return shade(faces, visible_face, patch, dark)


def photo_step(
    fit: PoseFit,
    shading: Shading,
    faces: Faces,
    patch: ImagePatch,
    camera: CameraIntrinsics,
    radius_m: float,
    blur: float,
    relax: float = OVER_RELAXATION,
    joint: int = JOINT_GROUPS,
) -> Optional[PoseFit]:
    """Return the pose after one Gauss-Newton step; None if the image has no information.

    Parameters
    ----------
    fit : PoseFit
        Pose to improve.
    shading : Shading
        Synthetic view at the pose.
    faces : Faces
        Faces of the target.
    patch : ImagePatch
        Reduced region of the image around the target.
    camera : CameraIntrinsics
        Pinhole camera.
    radius_m : float
        Radius of the target [m].
    blur : float
        Blur of image and view [patch px]; a wide blur converges from a larger distance.
    relax : float
        Factor of the step.
    joint : int
        Number of groups whose brightness is estimated with the pose.
    """
    R, t = quat.matrix(fit.q), fit.t
    noise = patch.sigma / max(1.0, 2 * np.sqrt(np.pi) * blur)
    blurs = OPTICS_PX / patch.factor, blur, float(np.hypot(blur, OPTICS_PX / patch.factor))
    slack = (EDGE_ERROR_PX + EDGE_ERROR_PER_BLUR * blur) ** 2
    G, _, rows = _gram(shading, faces, patch, camera, R, t, blurs, noise, slack, BIWEIGHT_LIMIT**2, joint)
    if rows < MIN_ROWS:
        return None
    H, g = projected(G)
    scale = parameter_scale(float(t[2]), radius_m)
    step = relax * damped_step(H, g, scale, 1e-5)
    step = limit_one_step(step, t, radius_m)
    return PoseFit(quat.rotate(fit.q, step[:3]), t + step[3:], COVARIANCE_INFLATION * _inverse(H))


def _inverse(H: Array) -> Array:
    """Return the inverse of a normal matrix; if it is singular, the pseudo-inverse, which is slower."""
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
    """Return the Gram matrix (K + 7, K + 7) of a step's weighted rows, the sum of weights, and the number of pixels.

    Parameters
    ----------
    shading : Shading
        Synthetic view.
    faces : Faces
        Faces of the target.
    patch : ImagePatch
        Reduced region of the image around the target.
    camera : CameraIntrinsics
        Pinhole camera.
    R : (3, 3) array
        Attitude, camera from target.
    t : (3,) array
        Position of the target, camera axes [m].
    blurs_px : tuple of float
        Blur of the optics, of this step, and of both.
    noise : float
        Noise of the patch under the blur of this step.
    slack : float
        Squared distance by which borders may still be displaced [px^2].
    tukey : float
        Squared limit of the biweight, in units of a residual's variance.
    joint : int
        Number of groups whose brightness is estimated with the pose.
    """
    (h, w), f = patch.gray.shape, patch.fine
    out, total = np.empty(MATRIX_SIZE), np.zeros(1)
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
        min(joint, MAX_GROUPS - 1),
        out,
        total,
    )
    if packed < 0:
        raise MemoryError("no memory for a step's normal equations")
    k, rows = packed % COUNT_BASE + 7, packed // COUNT_BASE
    return out[: k * k].reshape(k, k), float(total[0]), int(rows)


def projected(G: Array) -> Tuple[Array, Array]:
    """Return normal matrix (6, 6) and right side (6,) of weighted rows, brightnesses projected out.

    Variable projection (Golub & Pereyra 1973), because the brightnesses were estimated at the previous pose.

    Parameters
    ----------
    G : (K + 7, K + 7) array
        Gram matrix of the weighted derivatives by K brightnesses and six pose parameters, and of the residual.
    """
    k = len(G) - 7
    L = _regularised(G[:k, :k], 1e-6, 1e-12)
    left = G[k:, k:] - G[k:, :k] @ np.linalg.solve(L, G[:k, k:])
    return left[:6, :6], left[:6, 6]


def damped_step(H: Array, g: Array, scale: Array, damping: float) -> Array:
    """Return the step (6,) of the damped normal equations, solved in scaled parameters."""
    A = _regularised(H * scale[:, None] * scale[None, :], damping, 1e-9)
    return np.asarray(np.linalg.solve(A, g * scale) * scale)


def _regularised(A: Array, share: float, least: float) -> Array:
    """Return the matrix with ``share`` of its mean diagonal plus ``least`` added to the diagonal."""
    A = A.copy()
    diagonal = A.ravel()[:: len(A) + 1]
    diagonal += share * diagonal.sum() / max(len(A), 1) + least
    return A


def explained(shading: Shading, patch: ImagePatch) -> float:
    """Return the share of the image explained by the craft: 1 minus the ratio of residuals with and without the craft.

    Residuals are bounded, so that a missing shadow costs its area and not its depth.
    """
    noise, none, least = _without_craft(patch)
    blurs = OPTICS_PX / patch.factor, SCORE_BLUR_PX, 1.0
    residual = _unexplained(shading, patch, noise, none, blurs, MAX_RESIDUAL_SIGMA**2, MIN_COVERAGE)
    return 1.0 - residual / max(least, 1e-9)


@functools.lru_cache(maxsize=4)
def _without_craft(patch: ImagePatch) -> Tuple[float, Array, float]:
    """Return the noise of the blurred patch, residuals (h, w) of the background, and their bounded sum."""
    noise = patch.sigma / (2 * np.sqrt(np.pi) * SCORE_BLUR_PX)
    none = (patch.blurred(SCORE_BLUR_PX) - patch.background) / noise
    return noise, contiguous(none, "float32"), bounded(none, MAX_RESIDUAL_SIGMA**2)


def _unexplained(
    shading: Shading,
    patch: ImagePatch,
    noise: float,
    none: Array,
    blurs_px: Tuple[float, float, float],
    bound: float,
    covered: float,
) -> float:
    """Return the sum of bounded squared residuals of a synthetic view.

    Parameters
    ----------
    shading : Shading
        Synthetic view.
    patch : ImagePatch
        Reduced region of the image around the target.
    noise : float
        Noise of the blurred patch.
    none : (h, w) array
        Residuals without the craft, which replace those of pixels with coverage of at most ``covered``.
    blurs_px : tuple of float
        Blur of the optics, of the score, and of the coverage.
    bound : float
        Limit of a squared residual.
    covered : float
        Minimum coverage of a pixel that counts.
    """
    (h, w), f = patch.gray.shape, patch.fine
    optics, score, cover = (gaussian(b) for b in blurs_px)
    residual: float = library().fly_photometric_cost(
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
    if residual < 0:
        raise MemoryError("no memory to compare a drawn craft with the picture")
    return residual


def bounded(e: Array, bound: float) -> float:
    """Return the sum of squared residuals, each bounded and reduced by the expectation of noise."""
    return float(np.maximum(np.minimum(e * e, bound) - 1.5, 0.0).sum())


def likeness(shading: Shading, patch: ImagePatch) -> Tuple[float, float]:
    """Return the likeness of the synthetic view to the image on the pixels that it covers.

    Returns
    -------
    correlation : float
        Correlation of view and image, -1..1; 0 if the view covers too few pixels.
    covered : float
        Score on these pixels, at most 1; 0 if the view covers too few pixels.
    """
    picture = shading.picture
    h, w = patch.gray.shape
    cover = cv2.resize((shading.visible_face > 0).astype(np.float32), (w, h), interpolation=cv2.INTER_AREA)
    on = blurred(cover, 1.0) > MIN_COVERAGE
    drawn = blurred(picture, float(np.hypot(SCORE_BLUR_PX, OPTICS_PX / patch.factor)))
    drawn = patch.response.mean(drawn)[on].astype(float)
    gray = patch.blurred(SCORE_BLUR_PX)
    noise = patch.sigma / (2 * np.sqrt(np.pi) * SCORE_BLUR_PX)
    none = ((gray - patch.background) / noise)[on]
    gray = gray[on].astype(float)
    if len(gray) < 30 or not gray.std() * drawn.std() > 0:
        return 0.0, 0.0
    covered = 1.0 - bounded((gray - drawn) / noise, MAX_RESIDUAL_SIGMA**2) / max(
        bounded(none, MAX_RESIDUAL_SIGMA**2), 1e-9
    )
    return float(np.corrcoef(gray, drawn)[0, 1]), covered


def saturated_share(shading: Shading, patch: ImagePatch) -> float:
    """Return the saturated share of the pixels covered by the synthetic view."""
    on = shading.centre > 0
    return float((patch.gray[on] > SATURATED * patch.full_scale).mean()) if on.any() else 0.0
