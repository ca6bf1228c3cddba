"""Pose from four coplanar points (IPPE), vectorised, with both solutions."""

from __future__ import annotations

from typing import Tuple

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat

Array = np.ndarray


def plane_poses(object_m: Array, rays: Array) -> Tuple[Array, Array, Array]:
    """Return both poses of each set of four coplanar points: q (N, 2, 4), t (N, 2, 3), valid (N,).

    Under weak perspective the second solution may fit the image as well as the first.

    Parameters
    ----------
    object_m : (N, 4, 3) array
        Coplanar points, target frame [m].
    rays : (N, 4, 2) array
        Undistorted normalised image points.

    References
    ----------
    Collins & Bartoli (2014), Infinitesimal plane-based pose estimation, IJCV 109.
    """
    n = len(object_m)
    centre = object_m.mean(axis=1)
    X = object_m - centre[:, None]
    # axes of the points' plane
    e1 = X[:, 2] - X[:, 1]
    e1 = e1 / np.maximum(np.linalg.norm(e1, axis=1, keepdims=True), 1e-12)
    e3 = np.cross(e1, X[:, 0] - X[:, 1])
    e3 = e3 / np.maximum(np.linalg.norm(e3, axis=1, keepdims=True), 1e-12)
    E = np.stack([e1, np.cross(e3, e1), e3], axis=1)
    xy = np.einsum("nij,nkj->nki", E[:, :2], X)
    H, valid = _homographies(xy, rays)
    v = H[:, :2, 2]
    J = H[:, :2, :2] - v[:, :, None] * H[:, 2:, :2]
    ray = np.concatenate([v, np.ones((n, 1))], axis=1)
    norm = np.linalg.norm(ray, axis=1)
    axis = np.stack([-v[:, 1], v[:, 0], np.zeros(n)], axis=-1)
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    angle = np.arctan2(sine, 1.0)
    Rv = quat.matrix(quat.from_rotvec(axis / np.maximum(sine, 1e-12) * angle))
    P = np.zeros((n, 2, 3))
    P[:, 0, 0] = P[:, 1, 1] = 1.0
    P[:, :, 2] = -v
    B = (P @ Rv)[:, :, :2]
    A = np.linalg.solve(B + 1e-15 * np.eye(2), J)
    gamma = np.linalg.norm(A, ord=2, axis=(1, 2))
    valid &= np.isfinite(gamma) & (gamma > 1e-9) & np.isfinite(norm)
    gamma = np.where(valid, gamma, 1.0)
    M = A / gamma[:, None, None]
    h = np.eye(2) - np.swapaxes(M, 1, 2) @ M
    b = np.sqrt(np.maximum(np.stack([h[:, 0, 0], h[:, 1, 1]], axis=-1), 0.0))
    b[:, 1] *= np.where(h[:, 0, 1] < 0, -1.0, 1.0)
    qs, ts = [], []
    for sign in (1.0, -1.0):
        R = np.zeros((n, 3, 3))
        R[:, :2, :2] = M
        R[:, 2, :2] = sign * b
        R[:, :, 2] = np.cross(R[:, :, 0], R[:, :, 1])
        # target to plane axes, then plane to camera
        full = Rv @ R @ E
        full = np.where(valid[:, None, None], full, np.eye(3))
        qs.append(quat.from_matrix(full))
        ts.append(ray / gamma[:, None] - np.einsum("nij,nj->ni", full, centre))
    return np.stack(qs, axis=1), np.stack(ts, axis=1), valid


def _homographies(xy: Array, uv: Array) -> Tuple[Array, Array]:
    n = len(xy)
    A = np.zeros((n, 8, 8))
    x, y, u, v = xy[..., 0], xy[..., 1], uv[..., 0], uv[..., 1]
    A[:, 0::2, 0], A[:, 0::2, 1], A[:, 0::2, 2] = x, y, 1
    A[:, 0::2, 6], A[:, 0::2, 7] = -u * x, -u * y
    A[:, 1::2, 3], A[:, 1::2, 4], A[:, 1::2, 5] = x, y, 1
    A[:, 1::2, 6], A[:, 1::2, 7] = -v * x, -v * y
    scale = np.abs(A).max(axis=(1, 2))
    det = np.abs(np.linalg.det(A / np.maximum(scale, 1e-12)[:, None, None]))
    valid = det > 1e-16
    A[~valid] = np.eye(8)
    h = np.linalg.solve(A, uv.reshape(n, 8)[..., None])[..., 0]
    H = np.concatenate([h, np.ones((n, 1))], axis=1).reshape(n, 3, 3)
    return H, valid
