"""What a pose does to the drawn picture: its derivative lives where faces meet."""

from __future__ import annotations

import numpy as np

from flyaround.hil.board.svd.geometry.camera import CameraIntrinsics
from flyaround.hil.board.svd.geometry.faces import Faces
from flyaround.hil.board.svd.geometry.image_patch import ImagePatch
from flyaround.hil.board.svd.geometry.shading import Shading
from flyaround.hil.board.svd.native.backend import accelerated
from flyaround.hil.board.svd.native.photometric import normal_equations as native

Array = np.ndarray


def _in_bytes(shading: Shading, *_: object) -> bool:
    return shading.group.dtype == np.uint8


@accelerated(native.motion_images, _in_bytes)
def motion_images(
    shading: Shading, faces: Faces, patch: ImagePatch, camera: CameraIntrinsics, R: Array, t: Array
) -> Array:
    """(6, h, w) float32 derivative of the drawn picture by (turn about the target's origin, shift), camera axes.

    Where two groups meet, the nearer face's point carries the border with it.

    Parameters
    ----------
    camera : a pinhole (see ``ImagePatch.rays``).
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
    # a remainder costs ten times what this does
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
    # faces seen from the edge have no depth that can be trusted
    ok = (inverse > 0.2 / t[2]) & (inverse < 5.0 / t[2])
    inverse = np.where(ok, inverse, np.float32(1.0 / t[2]))
    tx, ty, tz = (np.float32(c) for c in t)
    X, Y, Z = rx / inverse - tx, ry / inverse - ty, 1 / inverse - tz
    flat_g = g.ravel()
    # of few rows and columns each is divided once
    cell = (np.arange(h * f) // f * w).take(y) + (np.arange(wide) // f).take(x)
    change = shading.brightness(flat_g[here], cell) - shading.brightness(flat_g[there], cell)
    k = (change * ok * inverse * np.where(across, 1.0 / (step_u * f * f), 1.0 / (step_v * f * f))).astype(
        np.float32
    )
    # slope of the picture's coordinate by the point: (1, 0, -rx) across, (0, 1, -ry) down, over the depth
    n, own = len(right), np.where(across, rx, ry)
    turn_x, turn_y = -own * Y, own * X
    turn_x[n:] -= Z[n:]
    turn_y[:n] += Z[:n]
    # a border along the side of a patch pixel lies half in the next one: all of it in this one would move what pulls
    # at the pose by a quarter of a pixel, and the pose with it
    last = np.arange(max(wide, h * f)) % f == f - 1
    shared = np.flatnonzero(last.take(np.where(across, x, y)))
    k[shared] *= np.float32(0.5)
    cell = np.concatenate([cell, cell[shared] + np.where(across[shared], 1, w)])
    each = np.concatenate([np.arange(len(k)), shared])
    out = np.empty((6, h * w), np.float32)
    # a shift across moves no border that runs across
    for j, slope in enumerate((turn_x, turn_y, np.where(across, -Y, X), across, ~across, -own)):
        out[j] = np.bincount(cell, (slope * k)[each], h * w)
    return out.reshape(6, h, w)
