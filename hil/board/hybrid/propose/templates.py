"""Viewpoint templates: views of the target fitted to a region and scored by directional chamfer distance.

A few hundred directions times in-plane rotations (Shotton et al. 2008; Liu et al. 2010).
"""

from __future__ import annotations

from typing import Tuple

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.hybrid.image.edge_field import ORIENTATION_BINS, EdgeField
from flyaround.hil.board.hybrid.model.view_tables import N_ROLLS, ViewTable
from flyaround.hil.board.svd.region_of_interest import Region

Array = np.ndarray


def match_views(
    table: ViewTable, field: EdgeField, region: Region, camera: CameraIntrinsics, centre_m: Array, keep: int
) -> Tuple[Array, Array, Array]:
    """Return poses of the best views fitted to the region: q (B, 4), t (B, 3), cost (B,).

    Each rotated view is scaled to cover the region, and shifted to either end if its shape leaves room: parts in shadow
    make the region too small, never too large.

    Parameters
    ----------
    table : ViewTable
        View table.
    field : EdgeField
        Edges of the region.
    region : Region
        Image region.
    camera : CameraIntrinsics
        Intrinsics of the camera.
    centre_m : (3,) array
        Centre of the target, target frame [m].
    keep : int
        Number of poses.
    """
    w, h = field.size
    corners = field.to_field(np.array([[region.x0, region.y0], [region.x1, region.y1]]))
    (rx0, ry0), (rx1, ry1) = corners
    rw, rh = max(rx1 - rx0, 2.0), max(ry1 - ry0, 2.0)
    box = table.box
    bw, bh = box[..., 2] - box[..., 0], box[..., 3] - box[..., 1]
    sw, sh = rw / np.maximum(bw, 1e-6), rh / np.maximum(bh, 1e-6)
    cover, middle = np.maximum(sw, sh), np.sqrt(sw * sh)
    # skip views whose aspect ratio cannot be the region's, even with a part in shadow
    ratio = np.maximum(sw / sh, sh / sw)
    v_all, k_all = np.nonzero(ratio < 2.2)
    cap = 0.12 * max(w, h)
    cost_table = np.minimum(field.distance, cap).reshape(-1)
    turns = np.arange(N_ROLLS) * 2 * np.pi / N_ROLLS
    best = []
    for scale, ax, ay in ((middle, 0.5, 0.5), (cover, 0.0, 0.0), (cover, 1.0, 1.0)):
        # at nearly the same aspect ratio, both scales are equal within 4 %
        use = ratio[v_all, k_all] > 1.08 if ax != 0.5 else np.ones(len(v_all), bool)
        v, k = v_all[use], k_all[use]
        if not len(v):
            continue
        s = scale[v, k]
        ox = rx0 - s * box[v, k, 0] + ax * (rw - s * bw[v, k])
        oy = ry0 - s * box[v, k, 1] + ay * (rh - s * bh[v, k])
        cost = np.empty(len(v), np.float32)
        for a in range(0, len(v), 6000):
            sl = slice(a, a + 6000)
            cost[sl] = _chamfer(table, field, cost_table, v[sl], turns[k[sl]], s[sl], ox[sl], oy[sl])
        best.append((cost, v, turns[k], s, ox, oy))
    if not best:
        return np.zeros((0, 4)), np.zeros((0, 3)), np.zeros(0)
    cost, v, turn, s, ox, oy = (np.concatenate(c) for c in zip(*best))  # noqa: B905 - Python 3.9 has no strict=
    top = np.argsort(cost)[:keep]
    return (*_poses(table, field, camera, centre_m, v[top], turn[top], s[top], ox[top], oy[top]), cost[top])


def _chamfer(
    table: ViewTable,
    field: EdgeField,
    cost_table: Array,
    v: Array,
    turn: Array,
    s: Array,
    ox: Array,
    oy: Array,
) -> Array:
    w, h = field.size
    xy = table.shape_xy[v]
    c, sn = (np.cos(turn) * s).astype(np.float32)[:, None], (np.sin(turn) * s).astype(np.float32)[:, None]
    x = c * xy[..., 0] - sn * xy[..., 1] + ox.astype(np.float32)[:, None]
    y = sn * xy[..., 0] + c * xy[..., 1] + oy.astype(np.float32)[:, None]
    xi = np.clip(x + 0.5, 0, w - 1).astype(np.int32)
    yi = np.clip(y + 0.5, 0, h - 1).astype(np.int32)
    k = ((table.shape_angle[v] + turn.astype(np.float32)[:, None]) * (ORIENTATION_BINS / np.pi) + 0.5).astype(
        np.int32
    ) % ORIENTATION_BINS
    return np.asarray(cost_table.take((k * h + yi) * w + xi).mean(axis=1))


def _poses(
    table: ViewTable,
    field: EdgeField,
    camera: CameraIntrinsics,
    centre_m: Array,
    v: Array,
    turn: Array,
    s: Array,
    ox: Array,
    oy: Array,
) -> Tuple[Array, Array]:
    f = 0.5 * (camera.fx_px + camera.fy_px)
    depth = f / (s * field.factor)
    u = (ox + 0.5) * field.factor - 0.5 + field.x0
    w = (oy + 0.5) * field.factor - 0.5 + field.y0
    ray = np.stack(
        [(u - camera.cx_px) / camera.fx_px, (w - camera.cy_px) / camera.fy_px, np.ones(len(u))], -1
    )
    t_centre = ray * depth[:, None]
    # the view looks straight at the target: rotate it to the line of sight
    zero = np.zeros(len(v))
    Rz = quat.matrix(quat.from_rotvec(np.stack([zero, zero, turn], axis=-1)))
    d = ray / np.linalg.norm(ray, axis=1, keepdims=True)
    axis = np.stack([-d[:, 1], d[:, 0], zero], axis=-1)
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    angle = np.arctan2(sine, d[:, 2:])
    swing = quat.matrix(quat.from_rotvec(axis / np.maximum(sine, 1e-12) * angle))
    R = swing @ Rz @ table.R_camera_from_target[v]
    return quat.from_matrix(R), t_centre - R @ centre_m
