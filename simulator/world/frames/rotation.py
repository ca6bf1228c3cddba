"""Unit quaternions (Hamilton, scalar first) and rotation matrices, named ``a_from_b``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flyaround.simulator.runtime.arrays import FloatArray


def quat_multiply(p_wxyz: ArrayLike, q_wxyz: ArrayLike) -> FloatArray:
    """Return the Hamilton product; ``q_a_from_c = quat_multiply(q_a_from_b, q_b_from_c)``.

    Parameters
    ----------
    p_wxyz : array_like
        (..., 4) left quaternion, scalar first.
    q_wxyz : array_like
        (..., 4) right quaternion, scalar first.

    Returns
    -------
    (..., 4) array
        Quaternion, scalar first.
    """
    p, q = np.asarray(p_wxyz, float), np.asarray(q_wxyz, float)
    if p.ndim == 1 and q.ndim == 1:
        return np.array(_product(*p.tolist(), *q.tolist()))
    pw, px, py, pz = np.moveaxis(p, -1, 0)
    qw, qx, qy, qz = np.moveaxis(q, -1, 0)
    return np.stack(_product(pw, px, py, pz, qw, qx, qy, qz), axis=-1)


def _product(pw: Any, px: Any, py: Any, pz: Any, qw: Any, qx: Any, qy: Any, qz: Any) -> list[Any]:  # noqa: ANN401
    """Return the components of the Hamilton product, of floats (far faster for single quaternions) or of arrays."""
    return [
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    ]


def quat_conjugate(q_wxyz: ArrayLike) -> FloatArray:
    """Return the inverse of a unit quaternion: ``q_b_from_a`` of ``q_a_from_b``.

    Returns
    -------
    (..., 4) array
        New array, scalar first, of the same norm.
    """
    return np.asarray(q_wxyz, float) * np.array([1.0, -1.0, -1.0, -1.0])


def quat_normalize(q_wxyz: ArrayLike) -> FloatArray:
    """Return the unit quaternion along ``q_wxyz``.

    Returns
    -------
    (..., 4) array
        New array of unit quaternions; their signs are kept.

    Raises
    ------
    ValueError
        If a quaternion is zero or not finite, or does not have four numbers.
    """
    q = np.asarray(q_wxyz, float)
    if q.shape[-1:] != (4,):
        raise ValueError(f"a quaternion has four numbers, got the shape {q.shape}")
    norm = np.linalg.norm(q, axis=-1, keepdims=True)
    if not np.all(np.isfinite(norm)) or np.any(norm < 1e-12):
        raise ValueError(f"a quaternion must be finite and not zero, got {q.tolist()}")
    return q / norm


def matrix_from_quat(q_wxyz: ArrayLike) -> FloatArray:
    """Return the rotation matrix ``R_a_from_b`` of ``q_a_from_b``, so that ``x_a = R @ x_b``.

    Parameters
    ----------
    q_wxyz : array_like
        (..., 4) unit quaternion.

    Returns
    -------
    (..., 3, 3) array
        Matrix.
    """
    q = np.asarray(q_wxyz, float)
    if q.ndim == 1:
        return np.array(_rows(*q.tolist()))
    return np.stack([np.stack(row, axis=-1) for row in _rows(*np.moveaxis(q, -1, 0))], axis=-2)


def _rows(w: Any, x: Any, y: Any, z: Any) -> list[list[Any]]:  # noqa: ANN401
    """Return the rows of the matrix, of floats or arrays."""
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]


def quat_from_matrix(R: ArrayLike) -> FloatArray:
    """Return the unit quaternion ``q_a_from_b`` of ``R_a_from_b``, with ``w >= 0``.

    Parameters
    ----------
    R : array_like
        (3, 3) rotation matrix.

    Returns
    -------
    (4,) array
        Unit quaternion, scalar first.

    Raises
    ------
    ValueError
        If the matrix is not a rotation to three digits.

    References
    ----------
    Shepperd (1978), Quaternion from rotation matrix, J. Guidance and Control 1(3).
    """
    m = np.asarray(R, float)
    # the negated test also refuses NaN
    if m.shape != (3, 3) or not (np.abs(m @ m.T - np.eye(3)).max() < 1e-3 and np.linalg.det(m) > 0):
        raise ValueError(f"a (3, 3) rotation matrix is needed, got {m.tolist()}")
    trace = float(np.trace(m))
    diag = [trace, m[0, 0], m[1, 1], m[2, 2]]
    k = int(np.argmax(diag))
    if k == 0:
        q = np.array([1 + trace, m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
    elif k == 1:
        q = np.array([m[2, 1] - m[1, 2], 1 + 2 * m[0, 0] - trace, m[0, 1] + m[1, 0], m[0, 2] + m[2, 0]])
    elif k == 2:
        q = np.array([m[0, 2] - m[2, 0], m[0, 1] + m[1, 0], 1 + 2 * m[1, 1] - trace, m[1, 2] + m[2, 1]])
    else:
        q = np.array([m[1, 0] - m[0, 1], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], 1 + 2 * m[2, 2] - trace])
    q = q / np.linalg.norm(q)
    return q if q[0] >= 0 else -q


def quat_from_rotvec(rotvec_rad: ArrayLike) -> FloatArray:
    """Return the quaternion of a rotation by ``|rotvec_rad|`` about its direction.

    Parameters
    ----------
    rotvec_rad : array_like
        (..., 3) axis times angle [rad].

    Returns
    -------
    (..., 4) array
        Unit quaternion, scalar first.

    Raises
    ------
    ValueError
        If the last axis does not hold three numbers.
    """
    v = np.asarray(rotvec_rad, float)
    if v.shape[-1:] != (3,):
        raise ValueError(f"a rotation vector has three numbers, got the shape {v.shape}")
    angle = np.linalg.norm(v, axis=-1, keepdims=True)
    # sin(x/2)/x by NumPy's sinc, which is exact at zero
    return np.concatenate([np.cos(angle / 2), 0.5 * np.sinc(angle / (2 * np.pi)) * v], axis=-1)


def rotation_angle_rad(p_wxyz: ArrayLike, q_wxyz: ArrayLike) -> float:
    """Return the angle between two attitudes, ``2 acos |<p, q>|`` evaluated without loss near zero.

    Returns
    -------
    float
        Angle [rad], 0 to pi.
    """
    d = quat_multiply(quat_conjugate(p_wxyz), q_wxyz)
    return float(2 * np.arctan2(np.linalg.norm(d[1:]), abs(d[0])))


def rotvec_from_quat(q_wxyz: ArrayLike) -> FloatArray:
    """Return the rotation vector of a unit quaternion.

    Returns
    -------
    (3,) array
        Axis times angle [rad], at most pi long; the same for ``q`` and ``-q`` unless ``w`` is 0.
    """
    d = np.asarray(q_wxyz, float)
    d = d if d[0] >= 0 else -d
    sine = float(np.linalg.norm(d[1:]))
    if sine < 1e-12:
        return np.asarray(2.0 * d[1:])
    return np.asarray(2.0 * np.arctan2(sine, d[0]) / sine * d[1:])


def rotvec_between(q_a_from_b_wxyz: ArrayLike, q_a_from_c_wxyz: ArrayLike) -> FloatArray:
    """Return the rotation vector from attitude b to attitude c.

    Returns
    -------
    (3,) array
        Axis times angle in b's axes [rad], at most pi long.
    """
    return rotvec_from_quat(quat_multiply(quat_conjugate(q_a_from_b_wxyz), q_a_from_c_wxyz))
