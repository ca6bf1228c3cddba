"""Views of the target from directions all around: visible wireframe samples, and a template for each view.

For targets with curved surfaces, half of a template lies on the occluding contour, where the wireframe has no edges.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Tuple

import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.occluding_contours import Outlines
from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.estimation.vectors import sphere_directions
from flyaround.hil.board.hybrid.geometry.wireframe import EdgeSamples, OccludingTriangles, project
from flyaround.hil.board.hybrid.model.visibility import visible_samples

Array = np.ndarray

# Number of view directions, 9 deg apart, and of in-plane rotations, 10 deg apart: within the convergence range of edge
# alignment (docs/lab/2026-11-estimator.md).
N_VIEWS, N_ROLLS = 500, 36

# Samples of a template and of a view, few enough for thousands of poses at once.
SHAPE_SAMPLES, TRACK_SAMPLES = 40, 120

# A target is curved if at least this share of its outline has a radius of curvature of at least the second value [radii
# of the target].
MIN_CURVED_SHARE, MIN_CURVATURE_RADIUS = 0.08, 0.1

# Share of a curved target's template on the occluding contour.
CONTOUR_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class ViewTable:
    """Camera views from V directions.

    Parameters
    ----------
    directions : (V, 3) array
        Unit vectors from the target to the camera, target frame.
    R_camera_from_target : (V, 3, 3) array
        Rotation of a camera that looks at the target's centre.
    track : (V, M) array
        Indices of visible samples, evenly spread.
    weight : (V, M) array
        1, or 0 for padding.
    shape_xy : (V, N, 2) array
        Template: projections at unit distance, times range [m].
    shape_angle : (V, N) array
        Orientation of the template's normals.
    box : (V, N_ROLLS, 4) array
        Bounding box of the view after each in-plane rotation [m].
    distance_m : float
        Range of the views [m].
    """

    directions: Array
    R_camera_from_target: Array
    track: Array
    weight: Array
    shape_xy: Array
    shape_angle: Array
    box: Array
    distance_m: float

    def nearest(self, R: Array, t: Array, centre_m: Array) -> Array:
        """Return the index of the view nearest to each pose's line of sight."""
        C = -np.einsum("bji,bj->bi", R, t) - centre_m
        return np.asarray(np.argmax(C @ self.directions.T, axis=1))


def look_at(direction: Array) -> Array:
    """Return the rotation, camera from target, of a camera in ``direction`` that looks at the target."""
    z = -direction
    # any axis that is not nearly parallel
    helper = np.array([1.0, 0, 0]) if abs(z[0]) < 0.8 else np.array([0, 1.0, 0])
    x = np.cross(helper, z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def build_views(
    model: BoardModel, samples: EdgeSamples, occ: OccludingTriangles, distance_m: float, views: int = N_VIEWS
) -> ViewTable:
    """Compute the table of ``views`` directions at ``distance_m``."""
    rng = np.random.default_rng(0)
    unit = CameraIntrinsics(1, 1, 1.0, 1.0, 0.0, 0.0)
    directions = sphere_directions(views)
    R = np.stack([look_at(d) for d in directions])
    centre = model.centre_m
    track = np.zeros((views, TRACK_SAMPLES), np.intp)
    weight = np.zeros((views, TRACK_SAMPLES), np.float32)
    xy = np.zeros((views, SHAPE_SAMPLES, 2), np.float32)
    angle = np.zeros((views, SHAPE_SAMPLES), np.float32)
    box = np.zeros((views, N_ROLLS, 4), np.float32)
    for v in range(views):
        C = centre + distance_m * directions[v]
        visible, _ = visible_samples(samples, occ, C)
        ids = np.flatnonzero(visible)
        if not len(ids):
            ids = np.arange(1)
        samples_kept = _spread(ids, TRACK_SAMPLES, rng)
        track[v, : len(samples_kept)] = samples_kept
        weight[v, : len(samples_kept)] = 1.0
        t = -R[v] @ C
        pr = project(samples, unit, R[v][None], t[None], ids[None])
        p = pr.pixels[0] * distance_m
        pick = _spread(np.arange(len(ids)), SHAPE_SAMPLES, rng)
        pick = np.resize(pick, SHAPE_SAMPLES)
        xy[v] = p[pick]
        angle[v] = pr.angle[0][pick]
        box[v] = _rolled_boxes(p)
    return ViewTable(directions, R, track, weight, xy, angle, box, distance_m)


def _rolled_boxes(points: Array) -> Array:
    """Return the boxes (N_ROLLS, 4) of points (N, 2) that are rolled about the line of sight: x0, y0, x1, y1."""
    turns = np.arange(N_ROLLS) * 2 * np.pi / N_ROLLS
    c, s = np.cos(turns), np.sin(turns)
    x, y = points[:, :1] * c - points[:, 1:] * s, points[:, :1] * s + points[:, 1:] * c
    return np.stack([x.min(axis=0), y.min(axis=0), x.max(axis=0), y.max(axis=0)], axis=-1)


def _spread(ids: Array, count: int, rng: np.random.Generator) -> Array:
    """Return at most ``count`` of ``ids``, one from each of ``count`` equal sections of the list."""
    if len(ids) <= count:
        return ids
    edges = np.linspace(0, len(ids), count + 1)
    indices = np.floor(edges[:-1] + rng.random(count) * np.diff(edges)).astype(int)
    return ids[np.clip(indices, 0, len(ids) - 1)]


def is_round(model: BoardModel) -> bool:
    """Return True if much of the target's outline lies on curved surfaces, where the wireframe has no edges."""
    if model.outlines is None:
        return False
    return float(np.mean(curved(model))) > MIN_CURVED_SHARE


def curved(model: BoardModel) -> Array:
    """Return True for contour points (V, N) on surfaces of large radius of curvature."""
    assert model.outlines is not None  # noqa: S101 - guaranteed by the caller
    return np.asarray(model.outlines.radius_m > MIN_CURVATURE_RADIUS * model.radius_m)


def with_outlines(table: ViewTable, outlines: Outlines, centre_m: Array) -> ViewTable:
    """Return the table with half of each template on the occluding contour, and boxes that include it."""
    rng = np.random.default_rng(0)
    xy, angle, box = table.shape_xy.copy(), table.shape_angle.copy(), table.box.copy()
    n_contour = int(CONTOUR_SHARE * SHAPE_SAMPLES)
    for v, direction in enumerate(table.directions):
        C = centre_m + table.distance_m * direction
        p, a = _visible_contour(outlines, table.R_camera_from_target[v], C, table.distance_m)
        low, high = np.split(_rolled_boxes(p), 2, axis=-1)
        box[v] = np.concatenate([np.minimum(box[v, :, :2], low), np.maximum(box[v, :, 2:], high)], axis=-1)
        # evenly spaced contour points replace every second wireframe sample
        stretch = len(p) / n_contour
        pick = np.floor((np.arange(n_contour) + rng.random(n_contour)) * stretch).astype(int) % len(p)
        selected = np.linspace(0, SHAPE_SAMPLES - 1, n_contour).astype(int)
        xy[v, selected], angle[v, selected] = p[pick], a[pick]
    return replace(table, shape_xy=xy, shape_angle=angle, box=box)


def _visible_contour(outlines: Outlines, R: Array, C_m: Array, distance_m: float) -> Tuple[Array, Array]:
    """Return the contour (N, 2) seen from ``C_m`` at unit distance, times range [m], and the angles of its normals."""
    points, normals = outlines.seen_from(int(outlines.nearest(C_m[None])[0]), C_m)
    P, n = (points - C_m) @ R.T, normals @ R.T
    p = P[:, :2] / np.maximum(P[:, 2:], 1e-6) * distance_m
    return p.astype(np.float32), np.mod(np.arctan2(n[:, 1], n[:, 0]), np.pi).astype(np.float32)
