"""Poses from keypoint distributions: likelihood over an attitude grid, then refinement of its maxima.

The likelihood of a pose is the product of the keypoints' probabilities at their projections. It is evaluated at every
attitude of a grid, and Newton's method refines the best distinct ones. A target with near-symmetries so yields one pose
for each mode, unlike PnP on marginal means or peaks.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import List, Tuple

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.even_attitudes import even_attitudes
from flyaround.hil.board.hybrid.propose.keypoints.network_input import INPUT_FILL
from flyaround.hil.board.hybrid.propose.keypoints.network_output import BIN_WIDTH, BINS, HALF_RANGE

Array = np.ndarray

# Number of attitudes of the grid, about 15 degrees apart, and of the coarser one used for positioning.
GRID_ATTITUDES, COARSE_ATTITUDES = 3200, 1200

# Size factors tried around the network's size, and the standard deviation of its logarithm.
SIZE_FACTORS, SIZE_SIGMA = (0.92, 1.0, 1.09), 0.08

# Smoothing of the distributions for the grid and for the two halves of the refinement [bins].
GRID_BINS, REFINE_BINS = 6.0, (3.0, 1.0)

# Share of probability spread over all bins, which bounds the penalty of a single keypoint.
OUTLIER_SHARE = 0.05

# Divisor of the log-likelihoods, because the errors of one image's keypoints are correlated.
LIKELIHOOD_DIVISOR = 8.0

# Number of refined attitudes, minimum angle between them [rad], and iterations in each half of the refinement.
N_REFINED, MIN_SEPARATION_RAD, NEWTON_STEPS = 20, float(np.radians(11.0)), 5

# Minimum curvature of a log-probability [1 / bins^2], which limits the step where it is flat or convex.
MIN_CURVATURE = 0.01

# Minimum depth of a keypoint in front of the camera [radii].
MIN_DEPTH_RADII = 0.3


@dataclass(frozen=True, eq=False)
class PoseModes:
    """Poses in a crop's camera: refined ones, most likely first, then maxima of the grid of attitudes.

    Parameters
    ----------
    q : (N, 4) array
        Attitude quaternions, camera from target.
    t : (N, 3) array
        Positions of the sphere's centre [radii].
    log_likelihood : (N,) array
        Sums of the keypoints' log-probabilities over both axes.
    """

    q: Array
    t: Array
    log_likelihood: Array


def pose_modes(log_p: Array, points: Array, focal: float, log_size: float, most: int) -> PoseModes:
    """Search the maxima of the pose likelihood.

    Parameters
    ----------
    log_p : (K, 2, BINS) array
        Log-probabilities of the keypoints along the columns and rows of a crop.
    points : (K, 3) array
        Keypoints relative to the sphere's centre, target frame [radii].
    focal : float
        Focal length of the crop's camera [half sides].
    log_size : float
        Logarithm of the target's size over the size that the crop assumes.
    most : int
        Largest number of poses.

    Returns
    -------
    PoseModes
        At most ``most`` poses, pairwise at least ``MIN_SEPARATION_RAD`` apart: refined ones by decreasing likelihood,
        then unrefined ones of the grid.
    """
    p = with_outliers(log_p)
    sizes = np.exp(log_size) * np.array(SIZE_FACTORS)
    coarse, at, _ = _grid_maxima(p, points, focal, GRID_ATTITUDES, sizes, N_REFINED)
    distance = _distance(focal) * np.exp(-log_size)
    q, t = coarse, at
    for width in REFINE_BINS:
        table = np.log(_smooth(p, width))
        for _ in range(NEWTON_STEPS):
            q, t = _newton_step(table, points, focal, distance, q, t)
    table = likelihood_table(p)
    score = log_likelihoods(table, points, focal, q, t)
    order = np.argsort(-score)
    # the grid's maxima follow, because a mode of wide distributions covers many poses
    q, t = np.concatenate([q[order], coarse]), np.concatenate([t[order], at])
    separated: List[int] = []
    for k in range(len(q)):
        if len(separated) < most and all(
            abs(float(q[k] @ q[j])) < np.cos(0.5 * MIN_SEPARATION_RAD) for j in separated
        ):
            separated.append(k)
    return PoseModes(
        q[separated], t[separated], log_likelihoods(table, points, focal, q[separated], t[separated])
    )


def most_likely_position(log_p: Array, points: Array, focal: float, log_size: float) -> Array:
    """Return the position (3,) of the sphere's centre at the most likely pose of a coarse grid [radii].

    Parameters
    ----------
    log_p : (K, 2, BINS) array
        Log-probabilities of the keypoints along the columns and rows of a crop.
    points : (K, 3) array
        Keypoints relative to the sphere's centre, target frame [radii].
    focal : float
        Focal length of the crop's camera [half sides].
    log_size : float
        Logarithm of the target's size over the size that the crop assumes.
    """
    size = np.exp([log_size])
    _, t, _ = _grid_maxima(with_outliers(log_p), points, focal, COARSE_ATTITUDES, size, 1)
    return np.asarray(t[0])


def with_outliers(log_p: Array) -> Array:
    """Return probabilities from log-probabilities, mixed with a uniform outlier distribution."""
    return np.asarray(
        (1 - OUTLIER_SHARE) * np.exp(log_p.astype(np.float32)) + np.float32(OUTLIER_SHARE / BINS)
    )


def likelihood_table(p: Array) -> Array:
    """Return log-probabilities (K, 2, BINS) smoothed as for the grid, from probabilities with outliers."""
    return np.asarray(np.log(_smooth(p, GRID_BINS)))


def log_likelihoods(table: Array, points: Array, focal: float, q: Array, t: Array) -> Array:
    """Return the sums (N,) of the keypoints' log-probabilities at poses.

    Parameters
    ----------
    table : (K, 2, BINS) array
        Log-probabilities from `likelihood_table`.
    points : (K, 3) array
        Keypoints relative to the sphere's centre [radii].
    focal : float
        Focal length of the crop's camera [half sides].
    q : (N, 4) array
        Attitude quaternions, camera from target.
    t : (N, 3) array
        Positions of the sphere's centre [radii].
    """
    uv, _ = _project(points, focal, quat.matrix(q), t)
    value, _, _ = _look_up(table, uv)
    return np.asarray(value.sum(axis=(1, 2)))


def _smooth(p: Array, width: float) -> Array:
    """Return distributions after a Gaussian blur of ``width`` bins."""
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
    """Return the best distinct poses of the grid (N, 4), (N, 3), and their log-likelihoods (N,)."""
    q, R = _grid(attitudes)
    table = np.log(_smooth(p, GRID_BINS)).astype(np.float32)
    row = (np.arange(len(points), dtype=np.int32) * 2 + np.arange(2, dtype=np.int32)[:, None]) * BINS
    centre = (np.arange(BINS) + 0.5) * BIN_WIDTH - HALF_RANGE
    middle = (p @ centre / p.sum(axis=-1)).mean(axis=0)
    # weak perspective: the keypoints' centroid projects to the centroid of their means
    rotated = R[:, :2] @ (points - points.mean(axis=0)).astype(np.float32).T
    sphere_distance = _distance(focal)
    scores = np.empty((len(sizes), len(q)), np.float32)
    shift = ((middle + HALF_RANGE) / BIN_WIDTH).astype(np.float32)[:, None]
    for score, factor in zip(scores, sizes):  # noqa: B905 - Python 3.9 has no strict=
        bin_index = (rotated * np.float32(focal / sphere_distance * factor / BIN_WIDTH) + shift).astype(
            np.int32
        )
        np.clip(bin_index, 0, BINS - 1, out=bin_index)
        bin_index += row
        score[:] = table.ravel().take(bin_index).sum(axis=(1, 2))
    size = sizes[scores.argmax(axis=0)]
    best = scores.max(axis=0)
    kept: List[int] = []
    for k in np.argsort(-best)[: 10 * most]:
        if len(kept) == most:
            break
        if not kept or np.abs(q[kept] @ q[k]).max() < np.cos(0.5 * MIN_SEPARATION_RAD):
            kept.append(int(k))
    z = sphere_distance / size[kept]
    centroid_offset = R[kept] @ points.mean(axis=0)
    xy = middle * (z / focal)[:, None] - centroid_offset[:, :2]
    return q[kept], np.column_stack([xy, z]), best[kept]


def _distance(focal: float) -> float:
    """Return the distance at which the sphere fills its share of a crop [radii]."""
    return float(np.hypot(1.0, focal / INPUT_FILL))


def _project(points: Array, focal: float, R: Array, t: Array) -> Tuple[Array, Array]:
    """Return the projections (N, K, 2) [half sides], and the points (N, K, 3) in the crop's camera [radii]."""
    points_camera = points @ R.transpose(0, 2, 1) + t[:, None]
    z = np.maximum(points_camera[..., 2:], MIN_DEPTH_RADII)
    return focal * points_camera[..., :2] / z, points_camera


def _look_up(table: Array, uv: Array) -> Tuple[Array, Array, Array]:
    """Return values, slopes and curvatures (N, K, 2) of tables (K, 2, BINS) at positions [half sides; bins]."""
    position = np.clip((uv + HALF_RANGE) / BIN_WIDTH - 0.5, 1.0, BINS - 2.001)
    low = np.floor(position).astype(np.intp)
    part = position - low
    base = (np.arange(table.shape[0])[:, None] * 2 + np.arange(2)) * BINS
    flat = table.ravel()
    low = np.clip(low, 1, BINS - 3)
    a, b, c, d = (flat.take(base + low + k) for k in (-1, 0, 1, 2))
    slope = (1 - part) * 0.5 * (c - a) + part * 0.5 * (d - b)
    curve = (1 - part) * (a - 2 * b + c) + part * (b - 2 * c + d)
    return (1 - part) * b + part * c, slope, curve


def _newton_step(
    table: Array, points: Array, focal: float, distance: float, q: Array, t: Array
) -> Tuple[Array, Array]:
    """Return poses after one damped Newton step up the log-likelihood, with a prior on the distance."""
    R = quat.matrix(q)
    uv, points_camera = _project(points, focal, R, t)
    value, slope, curve = _look_up(table, uv)
    slope, weight = slope / BIN_WIDTH, np.maximum(-curve, MIN_CURVATURE) / BIN_WIDTH**2
    x, y, z = points_camera[..., 0], points_camera[..., 1], np.maximum(points_camera[..., 2], MIN_DEPTH_RADII)
    arm = points_camera - t[:, None]
    nought, arm_x, arm_y, arm_z = np.zeros_like(z), arm[..., 0], arm[..., 1], arm[..., 2]
    # derivatives of u and v by rotation about each axis (cross product of the arm), then by translation
    a, b, c = focal / z, -focal * x / z**2, -focal * y / z**2
    by_u = np.stack([arm_y * b, arm_z * a - arm_x * b, -arm_y * a, a, nought, b], axis=-1)
    by_v = np.stack([arm_y * c - arm_z * a, -arm_x * c, arm_x * a, nought, a, c], axis=-1)
    J = np.stack([by_u, by_v], axis=2)
    J = J.reshape(len(q), -1, 6)
    transposed = J.transpose(0, 2, 1)
    H = transposed @ (J * weight.reshape(len(q), -1, 1))
    g = (transposed @ slope.reshape(len(q), -1, 1))[..., 0]
    # wide distributions are biased towards the centre, which would shrink the target without the prior
    prior = LIKELIHOOD_DIVISOR / (SIZE_SIGMA * distance) ** 2
    H[:, 5, 5] += prior
    g[:, 5] += prior * (distance - t[:, 2])
    H += np.eye(6) * (1e-3 * np.trace(H, axis1=1, axis2=2) / 6 + 1e-6)[:, None, None]
    step = np.linalg.solve(H, g[..., None])[..., 0]
    step[:, :3] *= np.minimum(1.0, 0.2 / np.maximum(np.linalg.norm(step[:, :3], axis=1), 1e-9))[:, None]
    bound = np.array([0.3, 0.3, 0.15]) * t[:, 2:]
    step[:, 3:] = np.clip(step[:, 3:], -bound, bound)
    half = 0.5 * step[:, :3]
    turn = np.concatenate([np.ones((len(q), 1)), half], axis=1)
    q_new = quat.multiply(turn, q)
    q_new /= np.linalg.norm(q_new, axis=1, keepdims=True)
    new = t + step[:, 3:]
    new[:, 2] = np.maximum(new[:, 2], 1.05)
    # reject a step that decreases the likelihood
    before = value.sum(axis=(1, 2)) - 0.5 * prior * (t[:, 2] - distance) ** 2
    after = _look_up(table, _project(points, focal, quat.matrix(q_new), new)[0])[0].sum(axis=(1, 2))
    after -= 0.5 * prior * (new[:, 2] - distance) ** 2
    worse = after < before - 1e-6
    q_new[worse], new[worse] = q[worse], t[worse]
    return q_new, new
