"""Poses from distributions of keypoints: their likelihood over evenly spread attitudes, then its maxima.

The sum of the keypoints' log-probabilities at the places where a pose projects them is compared at every attitude of a
grid, and Newton's method on the same sum finishes the best of those that are apart. So a craft with near-symmetries
gets one pose for each of its modes, which marginal means and PnP on peaks cannot give.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import List, Tuple

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.even_attitudes import even_attitudes
from flyaround.hil.board.hybrid.propose.keypoints.network_input import INPUT_FILL
from flyaround.hil.board.hybrid.propose.keypoints.network_output import BINS, REACH, STEP

Array = np.ndarray

# Attitudes of the grid: neighbours are about 15 degrees apart; and of the one that only places the craft.
ATTITUDES, PLACING_ATTITUDES = 3200, 1200

# Sizes compared about the network's, and the standard deviation of its logarithm.
SIZES, SIZE_SIGMA = (0.92, 1.0, 1.09), 0.08

# Widths by which the distributions are smoothed for the grid and for the two halves of the refinement [bins].
GRID_BINS, REFINE_BINS = 6.0, (3.0, 1.0)

# Share of probability spread over all bins: what one keypoint alone can take off a pose is bounded.
OUTLIERS = 0.05

# Log-likelihoods count this much too much: the errors of a craft's keypoints are those of one pose, not independent.
CORRELATED = 8.0

# Attitudes refined, the least angle between them [rad], and steps of each half of the refinement.
REFINED, APART_RAD, STEPS = 20, float(np.radians(11.0)), 5

# Least curvature of a log-probability [1 / bins^2], which keeps steps short where it is flat or convex.
LEAST_CURVATURE = 0.01

# Nearest that a keypoint may come to the camera [radii].
LEAST_DEPTH = 0.3


@dataclass(frozen=True, eq=False)
class PoseModes:
    """Poses in a crop's camera, the most likely first.

    Parameters
    ----------
    q : (N, 4) array
        Attitudes of the target.
    t : (N, 3) array
        Positions of the sphere's centre [radii of the sphere].
    log_likelihood : (N,) array
        Sums of the keypoints' log-probabilities over both axes.
    """

    q: Array
    t: Array
    log_likelihood: Array


def pose_modes(log_p: Array, points: Array, focal: float, log_size: float, most: int) -> PoseModes:
    """Return the maxima of the likelihood of poses.

    Parameters
    ----------
    log_p : (K, 2, BINS) array
        Log-probabilities of the keypoints along the columns and rows of a crop.
    points : (K, 3) array
        Keypoints from the sphere's centre, target frame [radii].
    focal : float
        Focal length of the crop's camera [half sides].
    log_size : float
        Logarithm of the craft's size over that of a crop that its sphere fills as it should.
    most : int
        Number of poses returned at most.
    """
    p = with_outliers(log_p)
    sizes = np.exp(log_size) * np.array(SIZES)
    coarse, at, _ = _grid_maxima(p, points, focal, ATTITUDES, sizes, REFINED)
    distance = _distance(focal) * np.exp(-log_size)
    q, t = coarse, at
    for width in REFINE_BINS:
        table = np.log(_smoothed(p, width))
        for _ in range(STEPS):
            q, t = _newton(table, points, focal, distance, q, t)
    table = likelihood_table(p)
    score = log_likelihoods(table, points, focal, q, t)
    order = np.argsort(-score)
    # after the modes the grid's maxima: where the distributions are wide, a mode stands for many poses
    q, t = np.concatenate([q[order], coarse]), np.concatenate([t[order], at])
    kept: List[int] = []
    for k in range(len(q)):
        if len(kept) < most and all(abs(float(q[k] @ q[j])) < np.cos(0.5 * APART_RAD) for j in kept):
            kept.append(k)
    return PoseModes(q[kept], t[kept], log_likelihoods(table, points, focal, q[kept], t[kept]))


def likeliest_place(log_p: Array, points: Array, focal: float, log_size: float) -> Array:
    """Return (3,) the position of the sphere's centre at the most likely pose of a coarse grid [radii].

    Parameters
    ----------
    log_p, points, focal, log_size
        As of `pose_modes`.
    """
    size = np.exp([log_size])
    _, t, _ = _grid_maxima(with_outliers(log_p), points, focal, PLACING_ATTITUDES, size, 1)
    return np.asarray(t[0])


def with_outliers(log_p: Array) -> Array:
    """Return the probabilities of log-probabilities, mixed with those of an outlier."""
    return np.asarray((1 - OUTLIERS) * np.exp(log_p.astype(np.float32)) + np.float32(OUTLIERS / BINS))


def likelihood_table(p: Array) -> Array:
    """Return (K, 2, BINS) log-probabilities as smooth as the grid's, of probabilities with their share of outliers."""
    return np.asarray(np.log(_smoothed(p, GRID_BINS)))


def log_likelihoods(table: Array, points: Array, focal: float, q: Array, t: Array) -> Array:
    """Return (N,) sums of the keypoints' log-probabilities at poses.

    Parameters
    ----------
    table : (K, 2, BINS) array
        Of `likelihood_table`.
    points : (K, 3) array
        Keypoints [radii].
    focal : float
        Focal length [half sides].
    q, t : (N, 4) array
        (N, 3) arrays Poses.
    """
    uv, _ = _projected(points, focal, quat.matrix(q), t)
    value, _, _ = _looked_up(table, uv)
    return np.asarray(value.sum(axis=(1, 2)))


def _smoothed(p: Array, width: float) -> Array:
    """Return distributions smoothed by a Gaussian [bins]."""
    reach = int(3 * width)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    kernel /= kernel.sum()
    size = BINS + 2 * reach
    spectrum = np.fft.rfft(np.pad(p, ((0, 0), (0, 0), (reach, reach)), mode="edge"), axis=-1)
    shape = np.fft.rfft(np.roll(np.pad(kernel, (0, size - len(kernel))), -reach))
    smooth = np.fft.irfft(spectrum * shape, size, axis=-1)[..., reach : reach + BINS]
    return np.maximum(smooth, 1e-6)


@lru_cache(maxsize=2)
def _grid(n: int) -> Tuple[Array, Array]:
    q = even_attitudes(n)
    return q, quat.matrix(q).astype(np.float32)


def _grid_maxima(
    p: Array, points: Array, focal: float, attitudes: int, sizes: Array, most: int
) -> Tuple[Array, Array, Array]:
    """Return the best poses of the grid that are apart, and their log-likelihoods: (N, 4), (N, 3), (N,)."""
    q, R = _grid(attitudes)
    table = np.log(_smoothed(p, GRID_BINS)).astype(np.float32)
    row = (np.arange(len(points), dtype=np.int32) * 2 + np.arange(2, dtype=np.int32)[:, None]) * BINS
    centre = (np.arange(BINS) + 0.5) * STEP - REACH
    middle = (p @ centre / p.sum(axis=-1)).mean(axis=0)
    # weak perspective: the middle of the keypoints is where the middle of their means is
    turned = R[:, :2] @ (points - points.mean(axis=0)).astype(np.float32).T
    away = _distance(focal)
    scores = np.empty((len(sizes), len(q)), np.float32)
    shift = ((middle + REACH) / STEP).astype(np.float32)[:, None]
    for score, factor in zip(scores, sizes):  # noqa: B905 - Python 3.9 has no strict=
        at = (turned * np.float32(focal / away * factor / STEP) + shift).astype(np.int32)
        np.clip(at, 0, BINS - 1, out=at)
        at += row
        score[:] = table.ravel().take(at).sum(axis=(1, 2))
    size = sizes[scores.argmax(axis=0)]
    best = scores.max(axis=0)
    kept: List[int] = []
    for k in np.argsort(-best)[: 10 * most]:
        if len(kept) == most:
            break
        if not kept or np.abs(q[kept] @ q[k]).max() < np.cos(0.5 * APART_RAD):
            kept.append(int(k))
    z = away / size[kept]
    off = R[kept] @ points.mean(axis=0)
    xy = middle * (z / focal)[:, None] - off[:, :2]
    return q[kept], np.column_stack([xy, z]), best[kept]


def _distance(focal: float) -> float:
    """Return the distance at which the sphere fills its share of a crop [radii]."""
    return float(np.hypot(1.0, focal / INPUT_FILL))


def _projected(points: Array, focal: float, R: Array, t: Array) -> Tuple[Array, Array]:
    """Return (N, K, 2) projections [half sides] and (N, K, 3) points in the crop's camera [radii]."""
    seen = points @ R.transpose(0, 2, 1) + t[:, None]
    z = np.maximum(seen[..., 2:], LEAST_DEPTH)
    return focal * seen[..., :2] / z, seen


def _looked_up(table: Array, uv: Array) -> Tuple[Array, Array, Array]:
    """Return values, slopes and curvatures (N, K, 2) of tables (K, 2, BINS) at places [half sides; bins]."""
    at = np.clip((uv + REACH) / STEP - 0.5, 1.0, BINS - 2.001)
    low = np.floor(at).astype(np.intp)
    part = at - low
    base = (np.arange(table.shape[0])[:, None] * 2 + np.arange(2)) * BINS
    flat = table.ravel()
    low = np.clip(low, 1, BINS - 3)
    a, b, c, d = (flat.take(base + low + k) for k in (-1, 0, 1, 2))
    slope = (1 - part) * 0.5 * (c - a) + part * 0.5 * (d - b)
    curve = (1 - part) * (a - 2 * b + c) + part * (b - 2 * c + d)
    return (1 - part) * b + part * c, slope, curve


def _newton(
    table: Array, points: Array, focal: float, distance: float, q: Array, t: Array
) -> Tuple[Array, Array]:
    """Return poses after one damped Newton step up the log-likelihood, with a prior on the distance."""
    R = quat.matrix(q)
    uv, seen = _projected(points, focal, R, t)
    value, slope, curve = _looked_up(table, uv)
    slope, weight = slope / STEP, np.maximum(-curve, LEAST_CURVATURE) / STEP**2
    x, y, z = seen[..., 0], seen[..., 1], np.maximum(seen[..., 2], LEAST_DEPTH)
    arm = seen - t[:, None]
    nought, arm_x, arm_y, arm_z = np.zeros_like(z), arm[..., 0], arm[..., 1], arm[..., 2]
    # slopes of u and v by a turn about each axis (the arm's cross product with those by a move) and by a move
    a, b, c = focal / z, -focal * x / z**2, -focal * y / z**2
    by_u = np.stack([arm_y * b, arm_z * a - arm_x * b, -arm_y * a, a, nought, b], axis=-1)
    by_v = np.stack([arm_y * c - arm_z * a, -arm_x * c, arm_x * a, nought, a, c], axis=-1)
    J = np.stack([by_u, by_v], axis=2)
    J = J.reshape(len(q), -1, 6)
    transposed = J.transpose(0, 2, 1)
    H = transposed @ (J * weight.reshape(len(q), -1, 1))
    g = (transposed @ slope.reshape(len(q), -1, 1))[..., 0]
    # wide distributions shrink towards their middle: without the prior, so would the craft
    prior = CORRELATED / (SIZE_SIGMA * distance) ** 2
    H[:, 5, 5] += prior
    g[:, 5] += prior * (distance - t[:, 2])
    H += np.eye(6) * (1e-3 * np.trace(H, axis1=1, axis2=2) / 6 + 1e-6)[:, None, None]
    step = np.linalg.solve(H, g[..., None])[..., 0]
    step[:, :3] *= np.minimum(1.0, 0.2 / np.maximum(np.linalg.norm(step[:, :3], axis=1), 1e-9))[:, None]
    bound = np.array([0.3, 0.3, 0.15]) * t[:, 2:]
    step[:, 3:] = np.clip(step[:, 3:], -bound, bound)
    half = 0.5 * step[:, :3]
    turn = np.concatenate([np.ones((len(q), 1)), half], axis=1)
    moved = quat.multiply(turn, q)
    moved /= np.linalg.norm(moved, axis=1, keepdims=True)
    new = t + step[:, 3:]
    new[:, 2] = np.maximum(new[:, 2], 1.05)
    # a step that makes it less likely is halved once, then left out
    before = value.sum(axis=(1, 2)) - 0.5 * prior * (t[:, 2] - distance) ** 2
    after = _looked_up(table, _projected(points, focal, quat.matrix(moved), new)[0])[0].sum(axis=(1, 2))
    after -= 0.5 * prior * (new[:, 2] - distance) ** 2
    worse = after < before - 1e-6
    moved[worse], new[worse] = q[worse], t[worse]
    return moved, new
