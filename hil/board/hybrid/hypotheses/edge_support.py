"""Edge support of a pose: the share of visible model edges with an image edge of similar orientation nearby.

Unmatched model edges and unmatched image edges count against a pose.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.geometry.wireframe import Projection, project
from flyaround.hil.board.hybrid.image.edge_field import EdgeField
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.model.silhouette import inward_sign, silhouette
from flyaround.hil.board.hybrid.model.view_tables import ViewTable
from flyaround.hil.board.hybrid.model.visibility import visible_samples

Array = np.ndarray

# Weight of a model edge on dark pixels relative to one on lit pixels: a face in shadow neither supports nor contradicts
# a pose (docs/lab/2026-11-estimator.md).
DARK_WEIGHT = 0.25

# Distance from a model edge at which an image edge counts 1/e [field px]; hand-tuned.
SOFT_PX = 1.5


@dataclass(frozen=True, eq=False)
class Support:
    """Edge evidence for one pose.

    Parameters
    ----------
    drawn : float
        Share of the visible model edges, by length, with an image edge nearby, 0..1.
    explained : float
        Share of the image edges that lie on the model, 0..1.
    outside : float
        Share of the lit pixels outside the model's silhouette; zero in front of empty space for a correct pose.
    total : float
        Combined score for ranking poses.
    visible : (M,) array
        Indices of the visible samples.
    """

    drawn: float
    explained: float
    outside: float
    total: float
    visible: Array


def quick_cost(
    target: PreparedTarget,
    q: Array,
    t: Array,
    views: ViewTable,
    field: EdgeField,
    cap_px: float,
    every: int = 1,
) -> Array:
    """Return the mean truncated distance (B,) to image edges of similar orientation, from the nearest view [field px].

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    q : (B, 4) array
        Attitude quaternions, camera from target.
    t : (B, 3) array
        Target positions, camera frame [m].
    views : ViewTable
        View table, which lists the visible samples of each view.
    field : EdgeField
        Edges of the region.
    cap_px : float
        Truncation distance [field px].
    every : int
        Stride through the samples.
    """
    R = quat.matrix(q)
    view = views.nearest(R, t, target.centre_m)
    idx, weight = views.track[view, ::every], views.weight[view, ::every]
    pr = project(target.samples, target.camera, R, t, idx)
    flat, inside = field.lookup(field.to_field(pr.pixels), pr.angle)
    d = np.where(inside, np.minimum(field.distance.reshape(-1)[flat], cap_px), cap_px)
    lit = field.lit.reshape(-1)[flat % field.lit.size] & inside
    # darkness hides edges, so a missing edge on dark pixels is weak evidence
    weight = weight * np.where(lit | (d < 0.5 * cap_px), 1.0, DARK_WEIGHT)
    return np.asarray((d * weight).sum(axis=1) / np.maximum(weight.sum(axis=1), 1.0))


def support(target: PreparedTarget, q: Array, t: Array, field: EdgeField, *, alone: bool = False) -> Support:
    """Return the edge evidence of the whole model for one pose, with exact visibility.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    q : (4,) array
        Attitude quaternion, camera from target.
    t : (3,) array
        Target position, camera frame [m].
    field : EdgeField
        Edges of the region.
    alone : bool
        True if this is the only pose on the field, so that the distance tables are not worth computing.

    Returns
    -------
    Support
        Shares and total score. With fewer than 8 visible samples, or a target behind the camera, the total is -1.
    """
    R = quat.matrix(q)
    visible, outline = visible_samples(target.samples, target.occ, -R.T @ t)
    idx = np.flatnonzero(visible)
    if len(idx) < 8 or t[2] <= 0:
        return Support(0.0, 0.0, 1.0, -1.0, idx)
    pr = project(target.samples, target.camera, R[None], t[None], idx[None])
    uv = field.to_field(pr.pixels)[0]
    flat, inside = field.lookup(uv, pr.angle[0])
    d, position = field.nearest_to(flat) if alone else (field.distance.reshape(-1)[flat], None)
    s = np.exp(-((d / SOFT_PX) ** 2)) * inside
    shape = silhouette(R, t, target.occ, target.camera, (field.x0, field.y0), field.factor, field.size)
    if field.empty:
        # in front of empty space the craft is the brighter side: an edge of the other polarity is not its outline
        inward = inward_sign(shape, uv, pr.normals[0])
        position = field.nearest_at(flat) if position is None else position
        e = np.clip(np.rint(position), 0, np.array(field.size) - 1).astype(np.intp)
        gx, gy = field.gx[e[:, 1], e[:, 0]], field.gy[e[:, 1], e[:, 0]]
        agree = inward * (gx * pr.normals[0][:, 0] + gy * pr.normals[0][:, 1])
        s = np.where(agree < 0, 0.0, s)
    # faces in shadow show no edges: missing ones on dark pixels count little
    blind = inside & ~field.lit.reshape(-1)[flat % field.lit.size] & (d > SOFT_PX)
    weight = (
        np.where(blind, DARK_WEIGHT, 1.0)
        * _projected_length(target, pr, R, idx)
        * np.where(outline[idx], 1.0, 0.6)
    )
    drawn = float((weight * s).sum() / max(weight.sum(), 1e-9))
    explained = _explained(target, uv, pr, field)
    lit = int(field.core.sum())
    outside = float((field.core & ~shape).sum() / lit) if lit else 0.0
    # lit area outside the silhouette counts fully, because empty space must be dark
    total = 0.5 * drawn + 0.5 * explained - outside
    return Support(drawn, explained, outside, total, idx)


def _projected_length(target: PreparedTarget, pr: Projection, R: Array, idx: Array) -> Array:
    P = pr.points_camera_m[0]
    D = target.samples.tangents[idx] @ R.T
    z = np.maximum(P[:, 2], 1e-3)
    du = D[:, 0] - P[:, 0] / z * D[:, 2]
    dv = D[:, 1] - P[:, 1] / z * D[:, 2]
    return np.asarray(np.hypot(du, dv) * target.camera.fx_px * target.spacing_m / z)


def _explained(target: PreparedTarget, uv: Array, pr: Projection, field: EdgeField) -> float:
    """Return the share of the field's edge pixels within about two pixels of the projected model."""
    total = int(field.mask.sum())
    if not total:
        return 0.0
    depth = np.maximum(pr.points_camera_m[0][:, 2], 1e-3)
    half = 0.55 * target.spacing_m * target.camera.fx_px / depth / field.factor
    n = pr.normals[0]
    along = np.stack([-n[:, 1], n[:, 0]], axis=-1) * half[:, None]
    ends = np.rint(np.clip(np.stack([uv - along, uv + along], axis=1), -5000, 5000)).astype(np.int32)
    drawn = np.zeros(field.mask.shape, np.uint8)
    cv2.polylines(drawn, list(ends), False, 1, 5)
    return float((drawn & field.mask).sum() / total)
