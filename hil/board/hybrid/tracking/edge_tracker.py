"""Alignment of a predicted pose on search profiles across the model's visible edges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional, Tuple

import cv2
import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.vectors import cross
from flyaround.hil.board.hybrid.geometry.wireframe import EdgeSamples, jacobian, project
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.model.visibility import visible_samples
from flyaround.hil.board.hybrid.refine.robust import tukey
from flyaround.hil.board.svd.refinement import gauss_newton_step, parameter_scale

Array = np.ndarray

# Covariance inflation, because neighbouring samples and successive frames share their errors: with it, the errors on
# ``tango-flyaround`` have the median of chi-square.
COVARIANCE_INFLATION = 12.0

# Edge samples per frame, and pixels averaged along an edge to either side.
MAX_SAMPLES, AVERAGED_PX = 220, 2

# Edge candidates kept per profile, because the model's own edge may not be the strongest.
CANDIDATES = 3

# Half length of a profile and of the derivative kernel [px of the reduced image].
HALF_PROFILE_PX, HALF_KERNEL_PX = 12, 2

# Additional distance at which a stronger edge is preferred, per sigma of strength [px].
STRENGTH_BONUS_PX = 0.04

# Minimum strength of an edge [sigma of the noise].
MIN_STRENGTH_SIGMA = 4.5

# Polarity in earlier frames from which a reversed edge counts as another one, and the factor on its strength; largest
# strength that earns the bonus [sigma]. Hand-tuned, as are the values below.
REVERSED, REVERSED_FACTOR, MAX_BONUS_SIGMA = 0.4, 0.3, 40.0

# Least standard deviation of the residuals [px of the reduced image], and limit of the biweight in standard deviations.
# Its upper bound is three gates: at the start a share of a profile's half length, from there falling to a pixel.
MIN_SPREAD_PX, BIWEIGHT_LIMIT, START_GATE, LIMIT_GATES = 0.4, 4.0, 0.35, 3.0

# Shortest side of the image around the target [px].
MIN_SIDE_PX = 16

# Weight above which a sample counts as tracked; chosen by eye.
MIN_WEIGHT = 0.2

# Gauss-Newton iterations at each reduction.
ITERATIONS = 6

# Derivative of a Gaussian of one pixel, normalised to a unit step.
_DERIVATIVE = np.array([-0.0585, -0.2597, 0.0, 0.2597, 0.0585], np.float32) / 0.7534


@dataclass(frozen=True, eq=False)
class TrackFit:
    """A pose aligned on edges.

    Parameters
    ----------
    q : (4,) array
        Attitude quaternion, camera from target.
    t : (3,) array
        Target position, camera frame [m].
    covariance : (6, 6) array
        Covariance of rotation [rad] and translation [m], camera axes.
    matched_share : float
        Share of the visible samples with an image edge nearby.
    near_share : float
        Share of the visible samples with an image edge within a pixel.
    rms_px : float
        RMS of the inlier residuals [px].
    n_inliers : int
        Number of inliers.
    polarity : (S,) array
        Sign and reliability of each sample's edge, -1..1: positive if it is brighter along the normal.
    """

    q: Array
    t: Array
    covariance: Array
    matched_share: float
    near_share: float
    rms_px: float
    n_inliers: int
    polarity: Array


def track_edges(
    target: PreparedTarget,
    image: Array,
    noise: float,
    q: Array,
    t: Array,
    reach_px: float,
    polarity: Array,
    *,
    empty: bool = False,
) -> Optional[TrackFit]:
    """Align a pose on edges within ``reach_px`` of the model's edges; return None if nothing is visible.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    image : (H, W) array
        Image, uint8 or uint16.
    noise : float
        Standard deviation of the image noise.
    q : (4,) array
        Predicted attitude quaternion, camera from target.
    t : (3,) array
        Predicted target position, camera frame [m].
    reach_px : float
        Search range [px].
    polarity : (S,) array
        Sign and reliability of each sample's edge in earlier frames, -1..1; see ``TrackFit.polarity``.
    empty : bool
        True if the background is empty space, darker than the target.

    Notes
    -----
    RAPID's one-dimensional search (Harris & Stennett 1990), with several candidates kept for each sample so that the
    pose as a whole chooses between the parallel edges of a frame (Vacchetti et al. 2004). It runs first on a reduced
    image over the range of the prediction error, then at full resolution.
    """
    R = quat.matrix(q)
    visible, _ = visible_samples(target.samples, target.occ, -R.T @ t)
    idx = np.flatnonzero(visible)
    if len(idx) < 8:
        return None
    if len(idx) > MAX_SAMPLES:
        idx = idx[np.linspace(0, len(idx) - 1, MAX_SAMPLES).astype(int)]
    if empty:
        polarity = np.where(polarity == 0, outline_polarity(target.samples, R, t), polarity)
    fit: Optional[TrackFit] = None
    factors = (max(1, int(np.ceil(reach_px / HALF_PROFILE_PX))), 1)
    for factor in dict.fromkeys(factors):
        # at the coarse scale: fewer iterations and a wider loss
        fit = _one_scale(target, image, noise, q, t, idx, factor, polarity)
        if fit is None:
            return None
        q, t = fit.q, fit.t
    return fit


def outline_polarity(samples: EdgeSamples, R: Array, t: Array) -> Array:
    """Return the expected polarity (S,) of outlines in front of empty space, -0.5..0.5 along the projected normal.

    The magnitude is 0.5, because another part of the target may lie behind an outline.
    """
    C = -R.T @ t
    idx = np.arange(len(samples))[None]
    X, T = (a[0] for a in samples.outline(idx, C[None]))
    sight = C - X
    facing = np.einsum("skj,sj->sk", samples.normals, sight) > 0
    turned_away = (samples.faces == 2) & (facing.sum(axis=1) == 1)
    outward = np.where(facing[:, :1], samples.normals[:, 1], samples.normals[:, 0])
    round_member = samples.radius_m != 0
    tangent_side = cross(T, X - C) * np.sign(samples.radius_m)[:, None]
    outward = np.where(round_member[:, None], tangent_side, outward)
    # the projected normal is the projected tangent rotated by 90 degrees: its sense in space is sight x tangent
    n = cross(T, sight)
    side = np.sign(np.einsum("sj,sj->s", outward, n))
    return np.asarray(np.where(turned_away | round_member, -0.5 * side, 0.0))


def _one_scale(
    target: PreparedTarget,
    image: Array,
    noise: float,
    q: Array,
    t: Array,
    idx: Array,
    factor: int,
    polarity: Array,
) -> Optional[TrackFit]:
    """Return the pose aligned at one reduction of the image; None if too little of it is in view."""
    samples, camera = target.samples, target.camera
    pr = project(samples, camera, quat.matrix(q)[None], t[None], idx[None])
    pixels, n = pr.pixels[0], pr.normals[0]
    edges = _edge_candidates(image, noise, pixels, n, factor, polarity[idx])
    if edges is None:
        return None
    candidate, strength, sign = edges
    fit_q, fit_t = q, t
    H, choice = np.eye(6), np.zeros(len(idx), int)
    r, weight = np.zeros(len(idx)), np.zeros(len(idx))
    for k in range(ITERATIONS):
        now = project(samples, camera, quat.matrix(fit_q)[None], fit_t[None], idx[None])
        gaps = candidate - np.einsum("mi,mi->m", now.pixels[0] - pixels, n)[:, None]
        r, weight, choice = _weighted_residuals(gaps, strength, factor, k)
        J = jacobian(now, camera, fit_t[None])
        scale = parameter_scale(float(fit_t[2]), target.radius_m)
        step, normal = gauss_newton_step(J, r[None], weight[None], scale, 1e-5)
        if not np.isfinite(step).all():
            return None
        fit_q, fit_t, H = quat.rotate(fit_q, step[0, :3]), fit_t + step[0, 3:], normal[0]
    rms = float(np.sqrt((weight * r * r).sum() / max(float(weight.sum()), 1e-9)))
    new_polarity, is_inlier = polarity.copy(), weight > 0.5
    new_polarity[idx[is_inlier]] = (
        0.7 * new_polarity[idx[is_inlier]] + 0.3 * sign[np.arange(len(idx)), choice][is_inlier]
    )
    return TrackFit(
        fit_q,
        fit_t,
        np.linalg.pinv(H) * max(rms, 0.15) ** 2 * COVARIANCE_INFLATION,
        float((weight > MIN_WEIGHT).mean()),
        float((np.isfinite(candidate).any(axis=1) & (np.abs(r) < 1.0 * factor) & (weight > 0)).mean()),
        rms,
        int((weight > MIN_WEIGHT).sum()),
        new_polarity,
    )


def _edge_candidates(
    image: Array, noise: float, samples_px: Array, n: Array, factor: int, polarity: Array
) -> Optional[Tuple[Array, Array, Array]]:
    """Return offsets [px], strengths [sigma] and signs (M, CANDIDATES) of edges across each sample; None out of view.

    Parameters
    ----------
    image : (H, W) array
        The image.
    noise : float
        Standard deviation of the image noise.
    samples_px : (M, 2) array
        Samples [px].
    n : (M, 2) array
        Unit normals of the projected edges.
    factor : int
        Reduction of the image.
    polarity : (M,) array
        Polarity of each sample's edge in earlier frames.
    """
    crop = _crop(image, samples_px, factor * (HALF_PROFILE_PX + HALF_KERNEL_PX + 2))
    if crop is None:
        return None
    small, x0, y0 = crop
    if factor > 1:
        h, w = (s // factor for s in small.shape)
        small = cv2.resize(small[: h * factor, : w * factor], (w, h), interpolation=cv2.INTER_AREA)
    profile = _profiles(np.asarray(small, np.float32), ((samples_px - (x0, y0)) + 0.5) / factor - 0.5, n)
    offset, strength = _peaks(profile, noise / factor)
    # a candidate of opposite polarity belongs to another edge
    sign = np.sign(strength)
    strength = np.abs(strength) * np.where(sign * polarity[:, None] < -REVERSED, REVERSED_FACTOR, 1.0)
    return np.where(strength > MIN_STRENGTH_SIGMA, offset * factor, np.nan), strength, sign


def _weighted_residuals(gaps: Array, strength: Array, factor: int, k: int) -> Tuple[Array, Array, Array]:
    """Return residual [px], weight and index of the selected candidate of each sample, in iteration ``k``.

    Parameters
    ----------
    gaps : (M, CANDIDATES) array
        Distance from the model's edge to each candidate [px]; NaN if there is none.
    strength : (M, CANDIDATES) array
        Strength of each candidate [sigma].
    factor : int
        Reduction of the image.
    k : int
        Index of the iteration.
    """
    # the nearest edge is preferred, unless it is faint and a clear one is little farther away
    cost = np.where(
        np.isfinite(gaps),
        np.abs(gaps) / factor - STRENGTH_BONUS_PX * np.minimum(strength, MAX_BONUS_SIGMA),
        1e9,
    )
    choice = cost.argmin(axis=1)
    r = gaps[np.arange(len(gaps)), choice]
    ok = np.isfinite(r)
    r = np.where(ok, r, 0.0)
    spread = max(MIN_SPREAD_PX * factor, 1.4826 * float(np.median(np.abs(r[ok]))) if ok.any() else factor)
    gate = max(START_GATE * HALF_PROFILE_PX * factor * (1.0 - k / ITERATIONS), factor)
    limit = min(BIWEIGHT_LIMIT * spread, LIMIT_GATES * gate)
    return r, ok * tukey(r, limit), choice


def _crop(image: Array, pixels: Array, margin: float) -> "Optional[Tuple[Array, int, int]]":
    h, w = image.shape
    x0, y0 = (int(v) for v in np.clip(pixels.min(axis=0) - margin, 0, [w, h]))
    x1, y1 = (int(v) for v in np.clip(pixels.max(axis=0) + margin + 2, 0, [w, h]))
    if min(x1 - x0, y1 - y0) < MIN_SIDE_PX:
        return None
    return image[y0:y1, x0:x1], x0, y0


def _profiles(image: Array, pixels: Array, n: Array) -> Array:
    """Return the derivative (M, 2 HALF_PROFILE_PX + 1) across the edge at each sample, averaged along the edge."""
    k = np.arange(-(HALF_PROFILE_PX + HALF_KERNEL_PX), HALF_PROFILE_PX + HALF_KERNEL_PX + 1, dtype=np.float32)
    along = np.stack([-n[:, 1], n[:, 0]], axis=-1)
    s = np.arange(-AVERAGED_PX, AVERAGED_PX + 1, dtype=np.float32) * 1.2
    x = pixels[:, None, None, 0] + n[:, None, None, 0] * k + along[:, None, None, 0] * s[:, None]
    y = pixels[:, None, None, 1] + n[:, None, None, 1] * k + along[:, None, None, 1] * s[:, None]
    m, a, p = x.shape
    values = cv2.remap(
        image,
        x.reshape(m * a, p).astype(np.float32),
        y.reshape(m * a, p).astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    ).reshape(m, a, p)
    mean = values.mean(axis=1)
    return sum(
        _DERIVATIVE[j] * mean[:, j : j + 2 * HALF_PROFILE_PX + 1] for j in range(2 * HALF_KERNEL_PX + 1)
    )


def _peaks(profile: Array, noise: float) -> Tuple[Array, Array]:
    """Return offset [px] and signed strength [sigma] of the strongest ``CANDIDATES`` edges of each profile."""
    g = np.abs(profile)
    mid = g[:, 1:-1]
    peak = np.where((mid >= g[:, :-2]) & (mid > g[:, 2:]), mid, 0.0)
    best = np.argsort(-peak, axis=1)[:, :CANDIDATES] + 1
    rows = np.arange(len(g))[:, None]
    a, b, c = g[rows, best - 1], g[rows, best], g[rows, best + 1]
    curve = a - 2 * b + c
    sub = np.where(np.abs(curve) > 1e-9, 0.5 * (a - c) / np.where(np.abs(curve) > 1e-9, curve, 1.0), 0.0)
    height = np.where(peak[rows, best - 1] > 0, b, 0.0)
    sigma = max(noise * PROFILE_NOISE, 1e-6)
    return best - HALF_PROFILE_PX + np.clip(sub, -0.5, 0.5), height / sigma * np.sign(profile[rows, best])


def _profile_noise() -> float:
    """Return the noise of the derivative for white noise of unit variance after the same sampling."""
    rng = np.random.default_rng(3)
    field = rng.standard_normal((96, 96)).astype(np.float32)
    angle = rng.uniform(0, 2 * np.pi, 200)
    n = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return float(np.std(_profiles(field, rng.uniform(30, 65, (200, 2)), n)))


PROFILE_NOISE = _profile_noise()
