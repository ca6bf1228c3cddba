"""Ellipse detection by a Hough transform, and the poses of a round body from its circles; an optional stream.

The outlook of the Milan thesis proposes separate Hough transforms for shapes other than lines.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import List, Optional, Tuple

import cv2
import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.camera import CameraIntrinsics, undistorted_rays
from flyaround.hil.board.estimation.target_model import BoardModel

Array = np.ndarray

# The limits of this module are chosen by hand; Xie & Ji state none for images of this size.

# Edge points that vote, and pairs of them tried as the ends of a major axis. The votes take time in proportion to the
# product; fewer miss ellipses among other edges.
MAX_POINTS, MAX_PAIRS = 260, 6000

# Major axes that are tried, relative to the region's diagonal: smaller ellipses are fittings, larger ones do not fit.
AXIS_RANGE = (0.2, 1.1)

# Ratios of minor to major axis that are voted for: flatter ellipses look like two parallel lines, and above 1 the axes
# swap.
AXIS_RATIOS = (0.12, 1.02)

# Pairs that are fitted, and votes of MAX_POINTS that a pair needs: fewer are common among unrelated edges.
FITTED_PAIRS, MIN_VOTES = 60, 8

# Distances from the outline at which edges are fitted, first and second time [px]; the last also counts as covered.
FIT_REACH_PX = (4.0, 2.5)

# Edge points that an ellipse needs, more than twice its five parameters.
MIN_FITTED_POINTS = 12

# Share of an outline that edges must cover: a round body hides half of its far rim.
MIN_COVERED = 0.5

# Smallest minor axis [px]: below it both sides of the outline lie in one band of FIT_REACH_PX.
MIN_WIDTH_PX = 4

# Steps of the ratio of the axes up to 1, and pairs that vote at once, which bounds the memory.
RATIO_STEPS, BATCH_PAIRS = 32, 1000

# Ellipses count as one if centres and major axes differ by less than this share of the axis and this scatter [px].
SAME_SHARE, SAME_CENTRE_PX, SAME_AXIS_PX = 0.1, 3, 2

# Edges of a ring: fewer are a polygon, more than any model of a board has are a loop. Its neighbours turn by at most 36
# degrees, whose cosine is 0.81.
RING_EDGES, MIN_RING_COSINE = (10, 400), 0.7

# Distance at which ends of edges are one vertex, which differs by the rounding of the file [m], and the spread of a
# ring's radius relative to its mean: a regular polygon has none but rounding.
JOINED_M, MAX_RING_SPREAD = 1e-4, 0.02

# Points of an outline from which the cone of its rays is fitted, seven for each of its five parameters.
CONE_POINTS = 36

# Ellipses kept per image, circles per model, and roll angles tried about a circle's axis. The number of poses to test
# is proportional to their product.
MAX_ELLIPSES, MAX_CIRCLES, N_ROLLS = 4, 8, 24


@dataclass(frozen=True)
class EllipseFit:
    """Ellipse in the image.

    Parameters
    ----------
    u : float
        Column of the centre [px].
    v : float
        Row of the centre [px].
    a : float
        Semi-major axis [px].
    b : float
        Semi-minor axis [px].
    angle_rad : float
        Angle of the major axis, from x to y.
    share : float
        Share of the outline that is covered by edges.
    """

    u: float
    v: float
    a: float
    b: float
    angle_rad: float
    share: float

    def points(self, n: int = 90) -> Array:
        """Return (n, 2) points of the outline [px]."""
        s = np.arange(n) * (2 * np.pi / n)
        c, d = np.cos(self.angle_rad), np.sin(self.angle_rad)
        x, y = self.a * np.cos(s), self.b * np.sin(s)
        return np.stack([self.u + c * x - d * y, self.v + d * x + c * y], axis=-1)


def hough_ellipses(mask: Array, origin: Tuple[float, float], diagonal_px: float) -> Tuple[EllipseFit, ...]:
    """Return the ellipses whose outlines are best covered by edges.

    Parameters
    ----------
    mask : (h, w) array
        Thin edges of the region.
    origin : tuple of float
        Full-resolution pixel of the mask's upper left corner.
    diagonal_px : float
        Diagonal of the region.

    References
    ----------
    Xie & Ji (2002), A new efficient ellipse detection method, ICPR: two points are taken as the ends of the major axis,
    and every third one votes for the semi-minor axis in a one-dimensional accumulator. Each winner is then fitted to
    the edges near it by least squares.
    """
    ys, xs = np.nonzero(mask)
    if len(xs) < MIN_FITTED_POINTS:
        return ()
    points = np.stack([xs, ys], axis=-1).astype(float)
    rng = np.random.default_rng(len(xs))
    sample = points[rng.permutation(len(points))[:MAX_POINTS]]
    i, j = np.triu_indices(len(sample), 1)
    axis = np.linalg.norm(sample[i] - sample[j], axis=1)
    ok = (axis > AXIS_RANGE[0] * diagonal_px) & (axis < AXIS_RANGE[1] * diagonal_px)
    i, j = i[ok], j[ok]
    pick = rng.permutation(len(i))[:MAX_PAIRS]
    i, j = i[pick], j[pick]
    a, b, votes = _minor_axes(sample, i, j)
    distance = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 3)
    ellipses: List[EllipseFit] = []
    for k in np.argsort(-votes)[:FITTED_PAIRS]:
        if votes[k] < MIN_VOTES:
            break
        d = sample[j[k]] - sample[i[k]]
        centre = 0.5 * (sample[i[k]] + sample[j[k]])
        start = EllipseFit(
            float(centre[0]), float(centre[1]), float(a[k]), float(b[k]), float(np.arctan2(d[1], d[0])), 0.0
        )
        fit = _refit(start, points, distance)
        if fit is None or fit.share < MIN_COVERED or any(_same_ellipse(fit, other) for other in ellipses):
            continue
        ellipses.append(fit)
    ellipses.sort(key=lambda e: -e.share * e.a)
    return tuple(
        EllipseFit(e.u + origin[0], e.v + origin[1], e.a, e.b, e.angle_rad, e.share)
        for e in ellipses[:MAX_ELLIPSES]
    )


def _minor_axes(sample: Array, i: Array, j: Array) -> Tuple[Array, Array, Array]:
    """Return semi-minor axes and votes of each pair of points as ends of a major axis."""
    half = 0.5 * np.linalg.norm(sample[i] - sample[j], axis=1)
    best_b, best_votes = np.zeros(len(i)), np.zeros(len(i))
    for low in range(0, len(i), BATCH_PAIRS):
        part = slice(low, low + BATCH_PAIRS)
        centre = 0.5 * (sample[i[part]] + sample[j[part]])
        a = half[part][:, None]
        d = np.linalg.norm(sample[None] - centre[:, None], axis=2)
        f = np.linalg.norm(sample[None] - sample[j[part]][:, None], axis=2)
        cos = (a * a + d * d - f * f) / np.maximum(2 * a * d, 1e-9)
        cos2 = np.clip(cos * cos, 0, 1)
        b2 = a * a * d * d * (1 - cos2) / np.maximum(a * a - d * d * cos2, 1e-9)
        is_plausible = (d < a) & (b2 > (AXIS_RATIOS[0] * a) ** 2) & (b2 <= (AXIS_RATIOS[1] * a) ** 2)
        bins = np.clip(np.sqrt(np.maximum(b2, 0)) / a * RATIO_STEPS, 0, RATIO_STEPS).astype(int)
        counts = np.zeros((len(a), RATIO_STEPS + 1))
        row = np.repeat(np.arange(len(a)), len(sample))
        np.add.at(counts, (row, bins.ravel()), is_plausible.ravel().astype(float))
        best = counts.argmax(axis=1)
        best_b[part] = (best + 0.5) / RATIO_STEPS * a[:, 0]
        best_votes[part] = counts[np.arange(len(a)), best]
    return half, best_b, best_votes


def _refit(e: EllipseFit, points: Array, distance: Array) -> Optional[EllipseFit]:
    for reach in FIT_REACH_PX:
        near = _band(e, points, reach)
        if near.sum() < MIN_FITTED_POINTS:
            return None
        (u, v), (width, height), angle = cv2.fitEllipseDirect(points[near].astype(np.float32))
        if not np.all(np.isfinite([u, v, width, height])) or min(width, height) < MIN_WIDTH_PX:
            return None
        turn = np.radians(angle) + (0.0 if width >= height else np.pi / 2)
        e = EllipseFit(u, v, 0.5 * max(width, height), 0.5 * min(width, height), float(turn), 0.0)
    pixels = np.rint(e.points()).astype(int)
    h, w = distance.shape
    inside = (pixels[:, 0] >= 0) & (pixels[:, 0] < w) & (pixels[:, 1] >= 0) & (pixels[:, 1] < h)
    pixels = np.clip(pixels, 0, [w - 1, h - 1])
    share = float((inside & (distance[pixels[:, 1], pixels[:, 0]] < FIT_REACH_PX[1])).mean())
    return EllipseFit(e.u, e.v, e.a, e.b, e.angle_rad, share)


def _band(e: EllipseFit, points: Array, reach: float) -> Array:
    """Return True for points within about ``reach`` pixels of the outline."""
    c, s = np.cos(e.angle_rad), np.sin(e.angle_rad)
    x = points[:, 0] - e.u
    y = points[:, 1] - e.v
    p, q = (c * x + s * y) / e.a, (-s * x + c * y) / max(e.b, 1e-6)
    r = np.hypot(p, q)
    # first-order distance: the implicit value over its gradient
    slope = np.hypot(p / e.a, q / max(e.b, 1e-6)) / np.maximum(r, 1e-9)
    return np.asarray(np.abs(r - 1) / np.maximum(slope, 1e-9) < reach)


def _same_ellipse(a: EllipseFit, b: EllipseFit) -> bool:
    """Return True if centres and major axes differ by less than a tenth of the axis and a few pixels of scatter."""
    share = SAME_SHARE * a.a
    return bool(
        np.hypot(a.u - b.u, a.v - b.v) < share + SAME_CENTRE_PX and abs(a.a - b.a) < share + SAME_AXIS_PX
    )


@dataclass(frozen=True, eq=False)
class Circle:
    """Circle of the wireframe: centre (3,) and unit axis, target frame, and radius [m]."""

    centre_m: Array
    axis: Array
    radius_m: float


def model_circles(model: BoardModel) -> Tuple[Circle, ...]:
    """Return closed rings of short wireframe edges that lie on a circle, largest first."""
    ends = np.array([[e.a_m, e.b_m] for e in model.wireframe if e.radius_m == 0]).reshape(-1, 2, 3)
    free = np.ones(len(ends), bool)
    out: List[Circle] = []
    for k in range(len(ends)):
        if not free[k]:
            continue
        ring = _ring_from(ends, k)
        if len(ring) < RING_EDGES[0]:
            continue
        free[ring] = False
        p = ends[ring].reshape(-1, 3)
        centre = p.mean(axis=0)
        r = np.linalg.norm(p - centre, axis=1)
        if r.std() < MAX_RING_SPREAD * r.mean():
            axis = np.linalg.svd(p - centre)[2][2]
            out.append(Circle(centre, axis, float(r.mean())))
    out.sort(key=lambda c: -c.radius_m)
    return tuple(out[:MAX_CIRCLES])


def _ring_from(ends: Array, start: int) -> List[int]:
    """Return the chain of edges from ``start`` until the ring closes; empty if it does not."""
    ring, point = [start], ends[start, 1]
    heading = ends[start, 1] - ends[start, 0]
    for _ in range(RING_EDGES[1]):
        near = np.linalg.norm(ends - point, axis=2) < JOINED_M
        best, best_cos, best_end = -1, MIN_RING_COSINE, 0
        for m in np.flatnonzero(near.any(axis=1)):
            if m == ring[-1]:
                continue
            end = 1 - int(near[m].argmax())
            d = ends[m, end] - point
            cos = float(d @ heading / max(np.linalg.norm(d) * np.linalg.norm(heading), 1e-12))
            if cos > best_cos:
                best, best_cos, best_end = int(m), cos, end
        if best < 0:
            return []
        if best == start:
            return ring
        if best in ring:
            return []
        ring.append(best)
        heading, point = ends[best, best_end] - point, ends[best, best_end]
    return []


def circle_poses(
    ellipses: Tuple[EllipseFit, ...], circles: Tuple[Circle, ...], camera: CameraIntrinsics
) -> Tuple[Array, Array]:
    """Return poses q (N, 4), t (N, 3) of every ellipse matched with every circle, at ``N_ROLLS`` angles about its axis.

    A circle determines its axis up to a mirror image and its sense, and leaves the roll undetermined.

    References
    ----------
    Forsyth et al. (1991), Invariant descriptors for 3D object recognition and pose, IEEE PAMI 13, appendix.
    """
    q_out: List[Array] = []
    t_out: List[Array] = []
    for e in ellipses:
        rays = undistorted_rays(camera, e.points(CONE_POINTS))
        for normal, centre in circle_views(rays):
            for c in circles:
                for sign in (1.0, -1.0):
                    base = _rotation_between(sign * c.axis, normal)
                    angle = np.arange(N_ROLLS) * (2 * np.pi / N_ROLLS)
                    q = quat.normalise(quat.multiply(quat.from_rotvec(angle[:, None] * normal), base))
                    q_out.append(q)
                    t_out.append(centre * c.radius_m - np.einsum("nij,j->ni", quat.matrix(q), c.centre_m))
    if not q_out:
        return np.zeros((0, 4)), np.zeros((0, 3))
    return np.concatenate(q_out), np.concatenate(t_out)


def circle_views(rays: Array) -> List[Tuple[Array, Array]]:
    """Return both solutions (axis towards the camera, centre) for a unit circle with outline rays (N, 2) at z = 1."""
    x, y = rays[:, 0], rays[:, 1]
    mean = np.array([x.mean(), y.mean()])
    scale = max(float(np.hypot(x - mean[0], y - mean[1]).mean()), 1e-9)
    u, v = (x - mean[0]) / scale, (y - mean[1]) / scale
    D = np.stack([u * u, u * v, v * v, u, v, np.ones_like(u)], axis=-1)
    A, B, C, F, G, H = np.linalg.svd(D)[2][5]
    Q = np.array([[A, B / 2, F / 2], [B / 2, C, G / 2], [F / 2, G / 2, H]])
    T = np.array([[1, 0, -mean[0]], [0, 1, -mean[1]], [0, 0, scale]]) / scale
    Q = T.T @ Q @ T
    values, vectors = np.linalg.eigh(Q)
    # a cone: two eigenvalues of one sign, ordered l1 >= l2 > 0 > l3
    if (values > 0).sum() == 1:
        values, vectors = -values[::-1], vectors[:, ::-1]
    if not values[0] < 0 < values[1]:
        return []
    l3, l2, l1 = values
    e1, e3 = vectors[:, 2], vectors[:, 0]
    s, c = np.sqrt(max(l1 - l2, 0.0) / (l1 - l3)), np.sqrt((l2 - l3) / (l1 - l3))
    out = []
    for sign in (1.0, -1.0):
        normal = sign * s * e1 + c * e3
        centre = _unit_section(Q, normal)
        if centre[2] < 0:
            centre = -centre
        normal = normal if normal @ centre < 0 else -normal
        out.append((normal, centre))
    return out


def _unit_section(Q: Array, normal: Array) -> Array:
    """Return the centre (3,) of the unit circle cut from cone ``Q`` by planes perpendicular to ``normal``.

    The centre is the pole of the plane's line at infinity, ``Q c`` along ``normal``. Its distance follows from the
    section ``(x - c)' Q (x - c) = -c' Q c``.
    """
    c = np.linalg.solve(Q, normal)
    c = c / max(float(np.linalg.norm(c)), 1e-12)
    # any axis that is not nearly parallel
    d = np.cross(normal, [1.0, 0.0, 0.0] if abs(normal[0]) < 0.9 else [0.0, 1.0, 0.0])
    r2 = -float(c @ Q @ c) / float(d @ Q @ d) * float(d @ d)
    return np.asarray(c / np.sqrt(max(r2, 1e-18)))


def _rotation_between(a: Array, b: Array) -> Array:
    """Return the quaternion of the shortest rotation from unit vector ``a`` to ``b``."""
    v, w = np.cross(a, b), 1.0 + float(a @ b)
    # opposite vectors: half a turn about any perpendicular axis
    if w < 1e-9:
        v = np.cross(a, [1.0, 0.0, 0.0] if abs(a[0]) < 0.9 else [0.0, 1.0, 0.0])
        w = 0.0
    return np.asarray(quat.normalise(np.array([w, *v])))
