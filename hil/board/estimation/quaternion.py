"""Unit quaternions (Hamilton, scalar first) as NumPy arrays, batched over leading axes."""

from __future__ import annotations

import math
from typing import Tuple

import numpy as np

Array = np.ndarray


def multiply(p: Array, q: Array) -> Array:
    """Return the Hamilton product of (..., 4) quaternions."""
    pw, px, py, pz = np.moveaxis(np.asarray(p, float), -1, 0)
    qw, qx, qy, qz = np.moveaxis(np.asarray(q, float), -1, 0)
    return np.stack(
        [
            pw * qw - px * qx - py * qy - pz * qz,
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
        ],
        axis=-1,
    )


def normalise(q: Array) -> Array:
    """Return (..., 4) quaternions scaled to unit length, with a non-negative scalar part."""
    q = np.asarray(q, float)
    if q.ndim == 1:
        # scalar arithmetic is faster than arrays for a single quaternion
        w, x, y, z = q.tolist()
        size = max(math.sqrt(w * w + x * x + y * y + z * z), 1e-300)
        return q / (-size if w < 0 else size)
    q = q / np.maximum(np.linalg.norm(q, axis=-1, keepdims=True), 1e-300)
    return np.where(q[..., :1] < 0, -q, q)


def matrix(q: Array) -> Array:
    """Return the rotation matrices (..., 3, 3) of unit quaternions: ``x_a = R @ x_b`` for ``q_a_from_b``."""
    q = np.asarray(q, float)
    w, x, y, z = q.tolist() if q.ndim == 1 else np.moveaxis(q, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    if q.ndim == 1:
        return np.array(rows)
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def from_matrix(R: Array) -> Array:
    """Return the quaternions (..., 4) of rotation matrices (..., 3, 3).

    References
    ----------
    Shepperd (1978), Quaternion from rotation matrix, J. Guidance and Control 1(3).
    """
    R = np.asarray(R, float)
    if R.ndim == 2:
        return normalise(np.array(_from_one(*R.ravel().tolist())))
    m = R.reshape(-1, 3, 3)
    d0, d1, d2 = m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]
    # all four pivots: the row with the largest pivot is well conditioned
    cand = np.empty((len(m), 4, 4))
    a, b, c = m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]
    e, f, g = m[:, 1, 0] + m[:, 0, 1], m[:, 0, 2] + m[:, 2, 0], m[:, 2, 1] + m[:, 1, 2]
    cand[:, 0] = np.stack([1 + d0 + d1 + d2, a, b, c], axis=-1)
    cand[:, 1] = np.stack([a, 1 + d0 - d1 - d2, e, f], axis=-1)
    cand[:, 2] = np.stack([b, e, 1 - d0 + d1 - d2, g], axis=-1)
    cand[:, 3] = np.stack([c, f, g, 1 - d0 - d1 + d2], axis=-1)
    k = np.argmax(cand[:, [0, 1, 2, 3], [0, 1, 2, 3]], axis=1)
    return normalise(cand[np.arange(len(m)), k]).reshape((*R.shape[:-2], 4))


def _from_one(
    xx: float, xy: float, xz: float, yx: float, yy: float, yz: float, zx: float, zy: float, zz: float
) -> Tuple[float, float, float, float]:
    """Return the quaternion, not normalised, of one matrix given by its elements."""
    a, b, c, e, f, g = zy - yz, xz - zx, yx - xy, yx + xy, xz + zx, zy + yz
    pivots = 1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz
    k = pivots.index(max(pivots))
    p = pivots[k]
    return ((p, a, b, c), (a, p, e, f), (b, e, p, g), (c, f, g, p))[k]


def from_rotvec(v: Array) -> Array:
    """Return the quaternion of a rotation by ``|v|`` about ``v`` (..., 3) [rad]."""
    v = np.asarray(v, float)
    angle = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle / 2), 0.5 * np.sinc(angle / (2 * np.pi)) * v], axis=-1)


def angle_rad(p: Array, q: Array) -> Array:
    """Return the angle between attitudes [rad], broadcast over leading axes."""
    if np.ndim(p) == 1 and np.ndim(q) == 1:
        (pw, px, py, pz), (qw, qx, qy, qz) = np.asarray(p, float).tolist(), np.asarray(q, float).tolist()
        return np.asarray(2 * np.arccos(min(abs(pw * qw + px * qx + py * qy + pz * qz), 1.0)))
    dot = np.abs(np.sum(np.asarray(p, float) * np.asarray(q, float), axis=-1))
    return np.asarray(2 * np.arccos(np.minimum(1.0, dot)))


def rotate(q: Array, v: Array) -> Array:
    """Return ``exp(v) q``: an attitude (4,) rotated by the rotation vector ``v`` (3,) [rad], in scalar arithmetic."""
    w, x, y, z = q.tolist()
    vx, vy, vz = v.tolist()
    angle = math.sqrt(vx * vx + vy * vy + vz * vz)
    half = 0.5 if angle < 1e-9 else math.sin(0.5 * angle) / angle
    c, a, b, d = math.cos(0.5 * angle), half * vx, half * vy, half * vz
    return normalise(
        np.array(
            [
                c * w - a * x - b * y - d * z,
                c * x + a * w + b * z - d * y,
                c * y - a * z + b * w + d * x,
                c * z + a * y - b * x + d * w,
            ]
        )
    )
