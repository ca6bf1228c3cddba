"""What a pose does to the drawn picture: its derivative lives where faces meet."""

from __future__ import annotations

import numpy as np

from hil.board.svd.levels import Shading
from hil.board.svd.model import CameraIntrinsics
from hil.board.svd.pnp import undistorted_rays
from hil.board.svd.shade import Canvas, Faces

Array = np.ndarray


def motion_images(
    shading: Shading, faces: Faces, canvas: Canvas, camera: CameraIntrinsics, R: Array, t: Array
) -> Array:
    """(6, h, w) derivative of the drawn picture by (turn about the target's origin, shift), camera axes.

    Where two groups meet, the nearer face's point carries the border with it.
    """
    h, w = canvas.gray.shape
    f = canvas.fine
    s = f / canvas.factor
    out = np.zeros((6, h * w))
    n_c = faces.normals @ R.T
    d_c = faces.offset + n_c @ t
    n_c = np.concatenate([[[0.0, 0.0, 0.0]], n_c])
    d_c = np.concatenate([[1.0], d_c])
    g, ids = shading.group, shading.seen
    for axis in (0, 1):
        if axis == 0:
            y, x = np.nonzero(g[:, 1:] != g[:, :-1])
            y2, x2 = y, x + 1
        else:
            y, x = np.nonzero(g[1:] != g[:-1])
            y2, x2 = y + 1, x
        if not len(y):
            continue
        a, b = ids[y, x], ids[y2, x2]
        u = (0.5 * (x + x2) + 0.5) / s - 0.5 + canvas.x0
        v = (0.5 * (y + y2) + 0.5) / s - 0.5 + canvas.y0
        ray = np.concatenate(
            [undistorted_rays(camera, np.stack([u, v], axis=-1)), np.ones((len(u), 1))], axis=1
        )
        za = _depth(n_c[a], d_c[a], ray)
        zb = _depth(n_c[b], d_c[b], ray)
        z = np.minimum(za, zb)
        ok = np.isfinite(z) & (z > 0.1)
        z = np.where(ok, z, 1.0)
        X = ray * z[:, None]
        slope = np.zeros_like(X)
        focal = camera.fx_px if axis == 0 else camera.fy_px
        slope[:, axis] = focal / z
        slope[:, 2] = -focal / z * ray[:, axis]
        J = np.concatenate([np.cross(X - t, slope), slope], axis=1) * s
        cell = (np.minimum(y, y2) // f) * w + np.minimum(x, x2) // f
        step = (_brightness(shading, g[y, x], cell) - _brightness(shading, g[y2, x2], cell)) * ok / (f * f)
        for k in range(6):
            out[k] += np.bincount(cell, step * J[:, k], h * w)
    return out.reshape(6, h, w).astype(np.float32)


def _depth(n: Array, d: Array, ray: Array) -> Array:
    slope = np.einsum("ij,ij->i", n, ray)
    return np.where(np.abs(slope) > 1e-6, d / np.where(np.abs(slope) > 1e-6, slope, 1.0), np.inf)


def _brightness(shading: Shading, group: Array, cell: Array) -> Array:
    level = shading.level[group]
    which = shading.local_of[group]
    if not len(shading.local):
        return level
    flat = shading.local.reshape(len(shading.local), -1)
    return level + np.where(which >= 0, flat[np.maximum(which, 0), cell], 0.0)
