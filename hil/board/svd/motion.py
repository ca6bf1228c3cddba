"""What a pose does to the drawn picture: its derivative lives where faces meet."""

from __future__ import annotations

import numpy as np

from hil.board.svd.levels import Shading
from hil.board.svd.model import CameraIntrinsics
from hil.board.svd.shade import Canvas, Faces

Array = np.ndarray


def motion_images(
    shading: Shading, faces: Faces, canvas: Canvas, camera: CameraIntrinsics, R: Array, t: Array
) -> Array:
    """(h, w, 6) float32 derivative of the drawn picture by (turn about the target's origin, shift), camera axes.

    Where two groups meet, the nearer face's point carries the border with it.

    Parameters
    ----------
    camera : a pinhole (see ``Canvas.rays``).
    """
    h, w = canvas.gray.shape
    f = canvas.fine
    wide = w * f
    g, ids = shading.group, shading.seen
    right = np.flatnonzero(_padded(g[:, 1:] != g[:, :-1], 1))
    down = np.flatnonzero(g[1:] != g[:-1])
    if not len(right) + len(down):
        return np.zeros((h, w, 6), np.float32)
    here = np.concatenate([right, down])
    there = np.concatenate([right + 1, down + wide])
    across = np.arange(len(here)) < len(right)
    u, v = canvas.rays(camera)
    y, x = np.divmod(here, wide)
    step_u, step_v = u[1] - u[0], v[1] - v[0]
    rx = u[x] + 0.5 * step_u * across
    ry = v[y] + 0.5 * step_v * ~across
    # inverse depth of a plane n.X = d along a ray is n.ray / d; the background has none
    n_c = faces.normals @ R.T
    near = np.zeros((len(n_c) + 1, 3))
    d_c = faces.offset + n_c @ t
    near[1:] = n_c / np.where(np.abs(d_c) > 1e-6, d_c, np.inf)[:, None]
    na, nb = near[ids.ravel()[here]], near[ids.ravel()[there]]
    inverse = np.maximum(na[:, 0] * rx + na[:, 1] * ry + na[:, 2], nb[:, 0] * rx + nb[:, 1] * ry + nb[:, 2])
    # faces seen from the edge have no depth that can be trusted
    ok = (inverse > 0.2 / t[2]) & (inverse < 5.0 / t[2])
    inverse = np.where(ok, inverse, 1.0 / t[2])
    X, Y, Z = rx / inverse - t[0], ry / inverse - t[1], 1.0 / inverse - t[2]
    flat_g = g.ravel()
    cell = (y // f) * w + x // f
    change = shading.brightness(flat_g[here], cell) - shading.brightness(flat_g[there], cell)
    k = change * ok * inverse / f * np.where(across, 1.0 / step_u, 1.0 / step_v) / f
    # slope of the picture's coordinate by the point: (1, 0, -rx) across, (0, 1, -ry) down, over the depth
    J = np.empty((len(here), 6))
    a = across
    J[:, 0] = np.where(a, -rx * Y, -ry * Y - Z)
    J[:, 1] = np.where(a, Z + rx * X, ry * X)
    J[:, 2] = np.where(a, -Y, X)
    J[:, 3], J[:, 4] = a, ~a
    J[:, 5] = -np.where(a, rx, ry)
    J *= k[:, None]
    index = cell[:, None] * 6 + np.arange(6)
    total = np.bincount(index.ravel(), J.ravel(), h * w * 6)
    return np.asarray(total.reshape(h, w, 6).astype(np.float32))


def _padded(border: Array, right: int) -> Array:
    return np.pad(border, ((0, 0), (0, right)))
