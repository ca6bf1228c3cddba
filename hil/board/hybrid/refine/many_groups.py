"""Step and score of a craft with more than 255 visible groups of faces, in NumPy (see ``model.many_groups``)."""

from __future__ import annotations

from typing import Tuple

import cv2
import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.faces import Faces
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.geometry.shading import Shading
from flyaround.hil.board.hybrid.model.many_groups import blurred, coverage

Array = np.ndarray

# Minimum change of a pixel by a shift of one patch pixel [noise]. Pixels below, one in three, have less than a
# thousandth of the information and are excluded from a step.
MIN_PIXEL_CHANGE = 0.02


def motion_images(
    shading: Shading, faces: Faces, patch: ImagePatch, camera: CameraIntrinsics, R: Array, t: Array
) -> Array:
    """Return the derivative (6, h, w) of the synthetic view by rotation about the target's origin and translation.

    See ``motion_images.motion_images``.
    """
    h, w = patch.gray.shape
    f = patch.fine
    wide = w * f
    g, ids = shading.group, shading.seen
    borders = np.zeros(g.shape, bool)
    np.not_equal(g[:, 1:], g[:, :-1], out=borders[:, :-1])
    right = np.flatnonzero(borders)
    down = np.flatnonzero(g[1:] != g[:-1])
    if not len(right) + len(down):
        return np.zeros((6, h, w), np.float32)
    here = np.concatenate([right, down])
    there = np.concatenate([right + 1, down + wide])
    across = np.arange(len(here)) < len(right)
    u, v = patch.rays(camera)
    # the remainder operator is ten times slower
    y = here // wide
    x = here - y * wide
    step_u, step_v = u[1] - u[0], v[1] - v[0]
    rx = (u[x] + 0.5 * step_u * across).astype(np.float32)
    ry = (v[y] + 0.5 * step_v * ~across).astype(np.float32)
    # inverse depth of a plane n.X = d along a ray is n.ray / d; the background has none
    n_c = faces.normals @ R.T
    near = np.zeros((3, len(n_c) + 1), np.float32)
    d_c = faces.offset + n_c @ t
    near[:, 1:] = n_c.T / np.where(np.abs(d_c) > 1e-6, d_c, np.inf)
    flat_ids = ids.ravel()
    na, nb = (np.take(near, np.take(flat_ids, at), axis=1, mode="clip") for at in (here, there))
    inverse = np.maximum(na[0] * rx + na[1] * ry + na[2], nb[0] * rx + nb[1] * ry + nb[2])
    # faces seen edge-on have no reliable depth
    ok = (inverse > 0.2 / t[2]) & (inverse < 5.0 / t[2])
    inverse = np.where(ok, inverse, np.float32(1.0 / t[2]))
    tx, ty, tz = (np.float32(c) for c in t)
    X, Y, Z = rx / inverse - tx, ry / inverse - ty, 1 / inverse - tz
    flat_g = g.ravel()
    # few rows and columns, so each is divided once
    cell = (np.arange(h * f) // f * w).take(y) + (np.arange(wide) // f).take(x)
    change = shading.brightness(flat_g[here], cell) - shading.brightness(flat_g[there], cell)
    k = (change * ok * inverse * np.where(across, 1.0 / (step_u * f * f), 1.0 / (step_v * f * f))).astype(
        np.float32
    )
    # slope of the image coordinate by the point: (1, 0, -rx) across, (0, 1, -ry) down, divided by depth
    n, own = len(right), np.where(across, rx, ry)
    turn_x, turn_y = -own * Y, own * X
    turn_x[n:] -= Z[n:]
    turn_y[:n] += Z[:n]
    # a border along the side of a patch pixel lies half in the next pixel: counted in one only, it would bias the pose
    # by a quarter of a pixel
    last = np.arange(max(wide, h * f)) % f == f - 1
    shared = np.flatnonzero(last.take(np.where(across, x, y)))
    k[shared] *= np.float32(0.5)
    cell = np.concatenate([cell, cell[shared] + np.where(across[shared], 1, w)])
    each = np.concatenate([np.arange(len(k)), shared])
    out = np.empty((6, h * w), np.float32)
    # a shift along a border does not move the border
    for j, slope in enumerate((turn_x, turn_y, np.where(across, -Y, X), across, ~across, -own)):
        out[j] = np.bincount(cell, (slope * k)[each], h * w)
    return out.reshape(6, h, w)


def gram(
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
    """Return the products (K + 7, K + 7) of a step's weighted rows, the sum of weights, and the number of pixels.

    See ``photometric._gram``.
    """
    lens, blur, optics = blurs_px
    shown, slope = patch.response.of(blurred(shading.picture, lens))
    drawn = blurred(shown, blur)
    e = patch.blurred(blur) - drawn
    D = [blurred(plane, optics) for plane in motion_images(shading, faces, patch, camera, R, t)]
    across, down = patch.scale
    least = MIN_PIXEL_CHANGE * noise / (max(abs(float(t[2])), 1e-9) * patch.fine)
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
    """Return the flat indices (N,) of residuals with non-zero weight, and their weights (N,), float32.

    Weights follow from the noise, the squared distance by which borders may still be displaced, and Tukey's limit.
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


def unexplained(
    shading: Shading,
    patch: ImagePatch,
    noise: float,
    none: Array,
    blurs_px: Tuple[float, float, float],
    bound: float,
    covered: float,
) -> float:
    """Return the sum of bounded squared residuals of a synthetic view; see ``photometric._unexplained``."""
    lens, blur, cover_blur = blurs_px
    drawn = patch.response.of(blurred(shading.picture, lens))[0]
    e = (patch.blurred(blur) - blurred(drawn, blur)) / noise
    if patch.textured:
        # clutter next to the craft is the same for every pose
        h, w = e.shape
        cover = cv2.resize((shading.group > 0).astype(np.float32), (w, h), interpolation=cv2.INTER_AREA)
        e = np.where(blurred(cover, cover_blur) > covered, e, none)
    return bounded(e, bound)


def bounded(e: Array, bound: float) -> float:
    """Return the sum of squared residuals, each bounded and reduced by the expectation under noise."""
    return float(np.maximum(np.minimum(e * e, bound) - 1.5, 0.0).sum())
