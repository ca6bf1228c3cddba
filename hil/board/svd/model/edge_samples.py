"""Points along the wireframe: where the model says an edge of the picture could be."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Tuple

import numpy as np

from hil.board.svd.geometry.vectors import cross
from hil.board.svd.model.target_model import BoardModel, CameraIntrinsics
from hil.board.svd.native.raster.visibility import packed_samples

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class EdgeSamples:
    """Evenly spaced points on the model's edges; round members give both sides of their outline.

    Parameters
    ----------
    points_m, tangents : (S, 3) position and unit direction, target frame.
    radius_m : (S,) signed offset of the outline from a round member's axis; 0 on face edges.
    normals : (S, 2, 3) outward normals of the adjacent faces, zero rows where there is none.
    faces : (S,) number of adjacent faces (0: seen from everywhere, then 1 or 2).
    edge : (S,) index of the wireframe edge.
    """

    points_m: Array
    tangents: Array
    radius_m: Array
    normals: Array
    faces: Array
    edge: Array

    def __len__(self) -> int:
        return len(self.points_m)

    @cached_property
    def packed(self) -> Tuple[Any, Tuple[Array, ...]]:
        """The samples as the kernels take them, and what keeps their arrays alive."""
        return packed_samples(self)

    def outline(self, idx: Array, C_m: Array) -> Tuple[Array, Array]:
        """Positions (B, M, 3) of samples ``idx`` (B, M) seen from camera centres (B, 3), and tangents.

        A round member's outline lies where the view ray grazes it: off the axis, across the ray.
        """
        X, T, r = self.points_m[idx], self.tangents[idx], self.radius_m[idx]
        if np.any(r):
            across = cross(T, X - C_m[:, None, :])
            across /= np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-9)
            X = X + across * r[..., None]
        return X, T


def sample_edges(model: BoardModel, spacing_m: float) -> EdgeSamples:
    """Samples of every edge, ``spacing_m`` apart, at least one on each."""
    points, tangents, radius, normals, faces, edge = [], [], [], [], [], []
    for k, e in enumerate(model.wireframe):
        d = e.b_m - e.a_m
        length = float(np.linalg.norm(d))
        if length < 1e-6:
            continue
        n = max(1, round(length / spacing_m))
        s = (np.arange(n) + 0.5) / n
        N = np.zeros((2, 3))
        given = e.normals[:2]
        if len(given):
            N[: len(given)] = given / np.maximum(np.linalg.norm(given, axis=1, keepdims=True), 1e-9)
        for side in (-1.0, 1.0) if e.radius_m > 0 else (0.0,):
            points.append(e.a_m + s[:, None] * d)
            tangents.append(np.repeat(d[None] / length, n, axis=0))
            radius.append(np.full(n, side * e.radius_m))
            normals.append(np.repeat(N[None], n, axis=0))
            faces.append(np.full(n, len(given)))
            edge.append(np.full(n, k))
    return EdgeSamples(
        np.concatenate(points),
        np.concatenate(tangents),
        np.concatenate(radius),
        np.concatenate(normals),
        np.concatenate(faces),
        np.concatenate(edge),
    )


@dataclass(frozen=True, eq=False)
class Projection:
    """Samples on the picture.

    Parameters
    ----------
    pixels : (B, M, 2). normals : (B, M, 2) unit, across the projected edge.
    points_camera_m : (B, M, 3).
    """

    pixels: Array
    normals: Array
    points_camera_m: Array

    @property
    def angle(self) -> Array:
        """(B, M) direction of the normal, 0..pi."""
        return np.mod(np.arctan2(self.normals[..., 1], self.normals[..., 0]), np.pi)


def project(samples: EdgeSamples, camera: CameraIntrinsics, R: Array, t: Array, idx: Array) -> Projection:
    """Project samples ``idx`` (B, M) under poses ``R`` (B, 3, 3), ``t`` (B, 3)."""
    C = -np.einsum("bji,bj->bi", R, t)
    X, T = samples.outline(idx, C)
    Rt = np.swapaxes(R, -1, -2)
    P = X @ Rt + t[:, None, :]
    D = T @ Rt
    z = np.maximum(P[..., 2], 1e-3)
    x, y = P[..., 0] / z, P[..., 1] / z
    # direction of the projected tangent; the lens bends it by less than the search tolerates
    du = camera.fx_px * (D[..., 0] - x * D[..., 2])
    dv = camera.fy_px * (D[..., 1] - y * D[..., 2])
    norm = np.maximum(np.hypot(du, dv), 1e-9)
    n = np.stack([-dv / norm, du / norm], axis=-1)
    xd, yd = camera.distort(x, y)
    uv = np.stack([camera.fx_px * xd + camera.cx_px, camera.fy_px * yd + camera.cy_px], axis=-1)
    return Projection(uv, n, P)


def jacobian(pr: Projection, camera: CameraIntrinsics, t: Array) -> Array:
    """d(n . pixel) by (rotation about the target's origin, translation), camera axes: (B, M, 6)."""
    P = pr.points_camera_m
    z = np.maximum(P[..., 2], 1e-3)
    gx = pr.normals[..., 0] * camera.fx_px / z
    gy = pr.normals[..., 1] * camera.fy_px / z
    gz = -(gx * P[..., 0] + gy * P[..., 1]) / z
    g = np.stack([gx, gy, gz], axis=-1)
    arm = P - t[:, None, :]
    # d(w x arm) . g = w . (arm x g)
    return np.concatenate([cross(arm, g), g], axis=-1)
