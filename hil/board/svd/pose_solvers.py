"""Pose from points: OpenCV's solvers by name, and the perspective three-point problem in batches.

Sharma, Ventura & D'Amico (2018) solve each pair of groups with EPnP; the Milan thesis solves three random points of it
(P3P with RANSAC).
"""

from __future__ import annotations

from typing import Callable, List, Sequence, Tuple

import cv2
import numpy as np

from flyaround.hil.board.estimation import quaternion as quat

Array = np.ndarray


# Newton iterations on the cubic's closed-form root, and on the three depths: both converge quadratically.
CUBIC_STEPS, DEPTH_STEPS = 3, 3

# Points closer to collinear than this have no pose: sine of the angle at the first one.
COLLINEAR = 1e-9

Solver = Callable[[Array, Array], Tuple[List[Array], List[Array]]]


def point_solver(solver: str) -> Solver:
    """Return one of OpenCV's PnP solvers by name.

    It maps object points (N, 3) and rays (N, 2) at z = 1 to rotation vectors and translations, which may be non-finite.

    Parameters
    ----------
    solver : str
        One of ``settings.SOLVERS``.
    """
    eye = np.eye(3)
    flag = getattr(cv2, f"SOLVEPNP_{solver.upper()}")

    def solve(object_m: Array, rays: Array) -> Tuple[List[Array], List[Array]]:
        obj, img = np.ascontiguousarray(object_m, float), np.ascontiguousarray(rays, float)
        # IPPE is inaccurate for points that are not centred
        centre = obj.mean(axis=0) if solver == "ippe" else None
        try:
            if solver == "p3p":
                # solvePnPGeneric rejects three points
                _, rv, tv = cv2.solveP3P(obj[:3], img[:3], eye, None, flags=flag)
            else:
                centred = obj if centre is None else obj - centre
                _, rv, tv, _ = cv2.solvePnPGeneric(centred, img, eye, None, flags=flag)
        except cv2.error:
            return [], []
        turns, shifts = [v.ravel() for v in rv], [t.ravel() for t in tv]
        if centre is not None:
            shifts = [t - quat.matrix(quat.from_rotvec(v)) @ centre for v, t in zip(turns, shifts)]  # noqa: B905 - 3.9
        return turns, shifts

    return solve


def from_rotvecs(turns: Sequence[Array], shifts: Sequence[Array]) -> Tuple[Array, Array]:
    """Return q (K, 4), t (K, 3) of rotation vectors and translations, without non-finite ones."""
    v, t = np.array(turns).reshape(-1, 3), np.array(shifts).reshape(-1, 3)
    ok = np.isfinite(v).all(axis=1) & np.isfinite(t).all(axis=1)
    return quat.normalise(quat.from_rotvec(v[ok])), t[ok]


def three_point_poses(object_m: Array, rays: Array) -> Tuple[Array, Array, Array]:
    """Return up to four poses per triple: q (M, 4), t (M, 3), and the triple's index (M,), ascending.

    Parameters
    ----------
    object_m : (N, 3, 3) array
        Points, target frame [m].
    rays : (N, 3, 2) array
        Undistorted normalised image points.

    Notes
    -----
    The depths of the points satisfy three quadrics. One member of the pencil of two of them is a pair of planes (a root
    of a cubic), and each plane meets a third quadric in two directions.

    References
    ----------
    Persson & Nordberg (2018), Lambda Twist: an accurate fast robust perspective three point solver, ECCV.
    """
    x = np.asarray(object_m, float)
    y = np.concatenate([rays, np.ones((len(x), 3, 1))], axis=2)
    y = y / np.linalg.norm(y, axis=2, keepdims=True)
    # degenerate triples divide by zero; non-finite results are dropped later
    with np.errstate(all="ignore"):
        depths, of = _depths(x, y)
        x, P = x[of], depths[..., None] * y[of]
        d12, d13 = x[:, 0] - x[:, 1], x[:, 0] - x[:, 2]
        e12, e13 = P[:, 0] - P[:, 1], P[:, 0] - P[:, 2]
        c, e = np.cross(d12, d13), np.cross(e12, e13)
        area = (c * c).sum(axis=1)
        # the triangle's own axes in both frames; the inverse's rows are the dual axes in the target frame
        dual = np.stack([np.cross(d13, c), np.cross(c, d12), c], axis=1) / area[:, None, None]
        R = np.stack([e12, e13, e], axis=-1) @ dual
        t = P[:, 0] - np.einsum("nij,nj->ni", R, x[:, 0])
        ok = area > COLLINEAR**2 * (d12**2).sum(axis=1) * (d13**2).sum(axis=1)
    ok &= np.isfinite(R).all(axis=(1, 2)) & np.isfinite(t).all(axis=1)
    return quat.from_matrix(R[ok]), t[ok], of[ok]


def _depths(x: Array, y: Array) -> Tuple[Array, Array]:
    """Return distances (M, 3) of three points along unit rays y (N, 3, 3), and the triple's index (M,)."""
    a12, a13, a23 = (((x[:, i] - x[:, j]) ** 2).sum(axis=1) for i, j in ((0, 1), (0, 2), (1, 2)))
    b12, b13, b23 = (-2.0 * (y[:, i] * y[:, j]).sum(axis=1) for i, j in ((0, 1), (0, 2), (1, 2)))
    none = np.zeros(len(x))
    first = _symmetric(a23, a23 * b12 / 2, none, a23 - a12, -a12 * b23 / 2, -a12)
    second = _symmetric(a23, none, a23 * b13 / 2, -a13, -a13 * b23 / 2, a23 - a13)
    g = _pencil_root(first, second)
    depths, valid = [], []
    for normal in _planes(first - g[:, None, None] * second):
        # s1 = w0 s2 + w1 s3 on this plane; s3 = tau s2
        w0, w1 = -normal[:, 1] / normal[:, 0], -normal[:, 2] / normal[:, 0]
        a = (a13 - a12) * w1**2 - a12 * b13 * w1 - a12
        b = 2 * (a13 - a12) * w0 * w1 + a13 * b12 * w1 - a12 * b13 * w0
        c = (a13 - a12) * w0**2 + a13 * b12 * w0 + a13
        inside = b * b - 4 * a * c
        root = np.sqrt(np.maximum(inside, 0.0))
        # one root without cancellation, the other from the product of both
        large = -0.5 * (b + np.where(b < 0, -root, root))
        for tau in (large / a, c / large):
            s2 = np.sqrt(a23 / (tau * (b23 + tau) + 1))
            s = np.stack([(w0 + w1 * tau) * s2, s2, tau * s2], axis=-1)
            depths.append(s)
            valid.append((inside >= 0) & (s > 0).all(axis=1) & np.isfinite(s).all(axis=1))
    row, solution = np.nonzero(np.stack(valid, axis=1))
    s = np.stack(depths, axis=1)[row, solution]
    squares, dots = np.stack([a12, a13, a23], axis=-1)[row], np.stack([b12, b13, b23], axis=-1)[row]
    for _ in range(DEPTH_STEPS):
        s = s + _newton(s, squares, dots)
    ok = (s > 0).all(axis=1)
    return s[ok], row[ok]


def _symmetric(xx: Array, xy: Array, xz: Array, yy: Array, yz: Array, zz: Array) -> Array:
    """Return symmetric matrices (N, 3, 3) from their six entries (N,)."""
    return np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=-1).reshape(-1, 3, 3)


def _pencil_root(first: Array, second: Array) -> Array:
    """Return a real g (N,) with det(first - g second) = 0; of three roots, the one farthest from the others."""
    cofactor1, cofactor2 = _cofactors(first), _cofactors(second)
    p0, p3 = (first[:, 0] * cofactor1[:, 0]).sum(axis=1), -(second[:, 0] * cofactor2[:, 0]).sum(axis=1)
    p1, p2 = -(cofactor1 * second).sum(axis=(1, 2)), (cofactor2 * first).sum(axis=(1, 2))
    b, c, d = p2 / p3, p1 / p3, p0 / p3
    shift = -b / 3
    p, q = c - b * b / 3, d + b * (2 * b * b / 27 - c / 3)
    disc = q * q / 4 + p**3 / 27
    # one real root (Cardano, without cancellation) or three (Viete)
    root = np.sqrt(np.maximum(disc, 0.0))
    big = np.cbrt(-q / 2 - np.where(q < 0, -root, root))
    one = big - np.where(big == 0, 0.0, p / (3 * np.where(big == 0, 1.0, big)))
    m = 2 * np.sqrt(np.maximum(-p, 0.0) / 3)
    angle = np.arccos(np.clip(-4 * q / np.maximum(m**3, 1e-300), -1.0, 1.0))
    three = np.where(q < 0, m * np.cos(angle / 3), m * np.cos((angle + 2 * np.pi) / 3))
    g = np.where(disc > 0, one, three) + shift
    for _ in range(CUBIC_STEPS):
        step = (((g + b) * g + c) * g + d) / ((3 * g + 2 * b) * g + c)
        g = g - np.where(np.isfinite(step), step, 0.0)
    return np.asarray(g)


def _cofactors(A: Array) -> Array:
    """Return the cofactors (N, 3, 3) of symmetric matrices."""
    rows = [np.cross(A[:, 1], A[:, 2]), np.cross(A[:, 2], A[:, 0]), np.cross(A[:, 0], A[:, 1])]
    return np.stack(rows, axis=1)


def _planes(A: Array) -> Tuple[Array, Array]:
    """Return the normals (N, 3) of the two planes of a degenerate quadratic form."""
    trace = np.trace(A, axis1=1, axis2=2)
    minors = np.trace(_cofactors(A), axis1=1, axis2=2)
    root = np.sqrt(np.maximum(trace * trace / 4 - minors, 0.0))
    large = trace / 2 + np.where(trace < 0, -root, root)
    small = minors / large
    e1, e2 = _eigenvector(A, large), _eigenvector(A, small)
    ratio = np.sqrt(np.maximum(-small / large, 0.0))[:, None]
    return e1 + ratio * e2, e1 - ratio * e2


def _eigenvector(A: Array, value: Array) -> Array:
    """Return unit eigenvectors (N, 3) of symmetric matrices for a simple eigenvalue: the largest cofactor row."""
    rows = _cofactors(A - value[:, None, None] * np.eye(3))
    size = np.linalg.norm(rows, axis=2)
    best = rows[np.arange(len(A)), size.argmax(axis=1)]
    return np.asarray(best / np.linalg.norm(best, axis=1, keepdims=True))


def _newton(s: Array, squares: Array, dots: Array) -> Array:
    """Apply one Newton step to s_i^2 + s_j^2 + b_ij s_i s_j = a_ij, pairs 12 13 23: (N, K, 3)."""
    s1, s2, s3 = s[..., 0], s[..., 1], s[..., 2]
    b12, b13, b23 = dots[..., 0], dots[..., 1], dots[..., 2]
    r1 = squares[..., 0] - (s1 * s1 + s2 * s2 + b12 * s1 * s2)
    r2 = squares[..., 1] - (s1 * s1 + s3 * s3 + b13 * s1 * s3)
    r3 = squares[..., 2] - (s2 * s2 + s3 * s3 + b23 * s2 * s3)
    j11, j12 = 2 * s1 + b12 * s2, 2 * s2 + b12 * s1
    j21, j23 = 2 * s1 + b13 * s3, 2 * s3 + b13 * s1
    j32, j33 = 2 * s2 + b23 * s3, 2 * s3 + b23 * s2
    det = -j11 * j23 * j32 - j12 * j21 * j33
    step = (
        np.stack(
            [
                -j23 * j32 * r1 - j12 * j33 * r2 + j12 * j23 * r3,
                -j21 * j33 * r1 + j11 * j33 * r2 - j11 * j23 * r3,
                j21 * j32 * r1 - j11 * j32 * r2 - j12 * j21 * r3,
            ],
            axis=-1,
        )
        / det[..., None]
    )
    return np.where(np.isfinite(step).all(axis=-1, keepdims=True), step, 0.0)
