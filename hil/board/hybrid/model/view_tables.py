"""Views of the target from everywhere: which samples of the wireframe each direction sees, and its template.

Of round bodies half of a template lies on the occluding contour: the wireframe says little of a cylinder's sides.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Tuple

import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.occluding_contours import Outlines
from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.hybrid.geometry.wireframe import EdgeSamples, OccludingTriangles, project
from flyaround.hil.board.hybrid.model.visibility import visible_samples

Array = np.ndarray

# Directions of the templates, 9 deg apart, and turns of each in the image, 10 deg: an alignment on edges reaches as far
# (docs/lab/2026-11-estimator.md).
VIEWS, TURNS = 500, 36

# Samples of a template, and of a view whose edges are tracked: few enough for thousands of poses at once.
SHAPE_SAMPLES, TRACK_SAMPLES = 40, 120

# Share of the outlines' points on surfaces curved more gently than a tenth of the craft, from which it counts as round.
ROUND, GENTLE = 0.08, 0.1

# Share of a view's template that is taken from the outline.
SHARE = 0.5


@dataclass(frozen=True, eq=False)
class ViewTable:
    """What a camera at each of V directions sees.

    Parameters
    ----------
    directions : (V, 3) unit vectors from the target to the camera, target frame.
    R_camera_from_target : (V, 3, 3) looking at the target's centre.
    track : (V, M) visible samples, spread evenly; weight : (V, M) 1, or 0 for padding.
    shape_xy : (V, N, 2) chosen samples on the plane at unit distance times range, model metres.
    shape_angle : (V, N) direction of their normals.
    box : (V, TURNS, 4) extent of everything visible after each turn [m].
    distance_m : range the table was made for.
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
        """Index of the view nearest to each pose's line of sight."""
        C = -np.einsum("bji,bj->bi", R, t) - centre_m
        return np.asarray(np.argmax(C @ self.directions.T, axis=1))


def sphere_directions(count: int) -> Array:
    """(count, 3) nearly even directions: the Fibonacci lattice."""
    k = np.arange(count) + 0.5
    z = 1 - 2 * k / count
    phi = np.pi * (1 + np.sqrt(5.0)) * k
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1)


def look_at(direction: Array) -> Array:
    """Rotation camera-from-target of a camera along ``direction`` looking back at the target."""
    z = -direction
    helper = np.array([1.0, 0, 0]) if abs(z[0]) < 0.8 else np.array([0, 1.0, 0])
    x = np.cross(helper, z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def build_views(
    model: BoardModel, samples: EdgeSamples, occ: OccludingTriangles, distance_m: float, views: int = VIEWS
) -> ViewTable:
    """Tables for ``views`` directions at ``distance_m``."""
    rng = np.random.default_rng(0)
    unit = CameraIntrinsics(1, 1, 1.0, 1.0, 0.0, 0.0)
    directions = sphere_directions(views)
    R = np.stack([look_at(d) for d in directions])
    centre = model.centre_m
    track = np.zeros((views, TRACK_SAMPLES), np.intp)
    weight = np.zeros((views, TRACK_SAMPLES), np.float32)
    xy = np.zeros((views, SHAPE_SAMPLES, 2), np.float32)
    angle = np.zeros((views, SHAPE_SAMPLES), np.float32)
    box = np.zeros((views, TURNS, 4), np.float32)
    turns = np.arange(TURNS) * 2 * np.pi / TURNS
    c, s = np.cos(turns), np.sin(turns)
    for v in range(views):
        C = centre + distance_m * directions[v]
        visible, _ = visible_samples(samples, occ, C)
        ids = np.flatnonzero(visible)
        if not len(ids):
            ids = np.arange(1)
        chosen = _spread(ids, TRACK_SAMPLES, rng)
        track[v, : len(chosen)] = chosen
        weight[v, : len(chosen)] = 1.0
        t = -R[v] @ C
        pr = project(samples, unit, R[v][None], t[None], ids[None])
        p = pr.pixels[0] * distance_m
        pick = _spread(np.arange(len(ids)), SHAPE_SAMPLES, rng)
        pick = np.resize(pick, SHAPE_SAMPLES)
        xy[v] = p[pick]
        angle[v] = pr.angle[0][pick]
        px = p[:, 0][:, None] * c - p[:, 1][:, None] * s
        py = p[:, 0][:, None] * s + p[:, 1][:, None] * c
        box[v] = np.stack([px.min(axis=0), py.min(axis=0), px.max(axis=0), py.max(axis=0)], axis=-1)
    return ViewTable(directions, R, track, weight, xy, angle, box, distance_m)


def _spread(ids: Array, count: int, rng: np.random.Generator) -> Array:
    """At most ``count`` of ``ids``, one from each of ``count`` equal stretches of the list."""
    if len(ids) <= count:
        return ids
    edges = np.linspace(0, len(ids), count + 1)
    at = np.floor(edges[:-1] + rng.random(count) * np.diff(edges)).astype(int)
    return ids[np.clip(at, 0, len(ids) - 1)]


def is_round(model: BoardModel) -> bool:
    """Whether much of the craft's outline lies on curved surfaces, where no edge of the wireframe is."""
    if model.outlines is None:
        return False
    return float(np.mean(curved(model))) > ROUND


def curved(model: BoardModel) -> Array:
    """(V, N) which points of the outlines lie on gently curved surfaces."""
    assert model.outlines is not None  # noqa: S101 - the caller asked
    return np.asarray(model.outlines.radius_m > GENTLE * model.radius_m)


def with_outlines(table: ViewTable, outlines: Outlines, centre_m: Array) -> ViewTable:
    """The table with half of each view's template on the outline, and its boxes grown to hold it."""
    rng = np.random.default_rng(0)
    xy, angle, box = table.shape_xy.copy(), table.shape_angle.copy(), table.box.copy()
    turns = np.arange(TURNS) * 2 * np.pi / TURNS
    c, s = np.cos(turns), np.sin(turns)
    taken = int(SHARE * SHAPE_SAMPLES)
    for v, direction in enumerate(table.directions):
        C = centre_m + table.distance_m * direction
        p, a = _seen(outlines, table.R_camera_from_target[v], C, table.distance_m)
        px = p[:, :1] * c - p[:, 1:] * s
        py = p[:, :1] * s + p[:, 1:] * c
        low = np.stack([px.min(axis=0), py.min(axis=0)], axis=-1)
        high = np.stack([px.max(axis=0), py.max(axis=0)], axis=-1)
        box[v] = np.concatenate([np.minimum(box[v, :, :2], low), np.maximum(box[v, :, 2:], high)], axis=-1)
        # evenly along the outline, in place of every second sample of the wireframe
        stretch = len(p) / taken
        pick = np.floor((np.arange(taken) + rng.random(taken)) * stretch).astype(int) % len(p)
        at = np.linspace(0, SHAPE_SAMPLES - 1, taken).astype(int)
        xy[v, at], angle[v, at] = p[pick], a[pick]
    return replace(table, shape_xy=xy, shape_angle=angle, box=box)


def _seen(outlines: Outlines, R: Array, C_m: Array, distance_m: float) -> Tuple[Array, Array]:
    """The outline from ``C_m``: (N, 2) on the plane at unit distance times range [m], and its normals' angles."""
    points, normals = outlines.seen_from(int(outlines.nearest(C_m[None])[0]), C_m)
    P, n = (points - C_m) @ R.T, normals @ R.T
    p = P[:, :2] / np.maximum(P[:, 2:], 1e-6) * distance_m
    return p.astype(np.float32), np.mod(np.arctan2(n[:, 1], n[:, 0]), np.pi).astype(np.float32)
