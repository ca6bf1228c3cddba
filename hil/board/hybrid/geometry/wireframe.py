"""Sample points of the wireframe, the mesh that occludes them, and their projection."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Tuple

import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.vectors import cross
from flyaround.hil.board.hybrid.native.interface import STRUCTURES, Structure, contiguous

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class EdgeSamples:
    """Evenly spaced points on the model's edges; round members have samples on both outlines.

    Parameters
    ----------
    points_m : (S, 3) array
        Positions, target frame [m].
    tangents : (S, 3) array
        Unit directions of the edges, target frame.
    radius_m : (S,) array
        Signed offset of the outline from a round member's axis [m]; 0 on face edges.
    normals : (S, 2, 3) array
        Outward normals of the adjacent faces; zero if there is none.
    faces : (S,) array
        Number of adjacent faces; samples without any are visible from everywhere.
    edge : (S,) array
        Index of the wireframe edge.
    """

    points_m: Array
    tangents: Array
    radius_m: Array
    normals: Array
    faces: Array
    edge: Array

    @cached_property
    def native(self) -> Structure:
        """C structure of the samples for the native library."""
        n = len(self.points_m)
        return STRUCTURES["samples"](
            points=contiguous(self.points_m, "float64", (n, 3)),
            tangents=contiguous(self.tangents, "float64", (n, 3)),
            radius=contiguous(self.radius_m, "float64", (n,)),
            normals=contiguous(self.normals, "float64", (n, 2, 3)),
            faces=contiguous(self.faces, "int64", (n,)),
            n=n,
        )

    def __len__(self) -> int:
        return len(self.points_m)

    def outline(self, idx: Array, C_m: Array) -> Tuple[Array, Array]:
        """Return positions (B, M, 3) of samples ``idx`` (B, M) seen from camera centres (B, 3), and tangents.

        The outline of a round member lies beside its axis, where the line of sight is tangent to it.
        """
        X, T, r = self.points_m[idx], self.tangents[idx], self.radius_m[idx]
        if np.any(r):
            across = cross(T, X - C_m[:, None, :])
            across /= np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-9)
            X = X + across * r[..., None]
        return X, T


@dataclass(frozen=True, eq=False)
class OccludingTriangles:
    """Occluding triangles prepared for rays from one point: first vertex, two edges, and their cross product."""

    v0: Array
    e1: Array
    e2: Array
    n: Array

    @cached_property
    def native(self) -> Structure:
        """C structure of the triangles for the native library."""
        shape = len(self.v0), 3
        arrays = {
            name: contiguous(a, "float64", shape)
            for name, a in (("v0", self.v0), ("e1", self.e1), ("e2", self.e2), ("n", self.n))
        }
        return STRUCTURES["occluders"](**arrays, triangles=len(self.v0))


@dataclass(frozen=True, eq=False)
class Projection:
    """Projected samples.

    Parameters
    ----------
    pixels : (B, M, 2) array
        Image positions [px].
    normals : (B, M, 2) array
        Unit normals of the projected edges.
    points_camera_m : (B, M, 3) array
        Positions in the camera frame [m].
    """

    pixels: Array
    normals: Array
    points_camera_m: Array

    @property
    def angle(self) -> Array:
        """Directions (B, M) of the normals, 0..pi."""
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
    # direction of the projected tangent; the lens changes it by less than the search tolerates
    du = camera.fx_px * (D[..., 0] - x * D[..., 2])
    dv = camera.fy_px * (D[..., 1] - y * D[..., 2])
    norm = np.maximum(np.hypot(du, dv), 1e-9)
    n = np.stack([-dv / norm, du / norm], axis=-1)
    xd, yd = camera.distort(x, y)
    uv = np.stack([camera.fx_px * xd + camera.cx_px, camera.fy_px * yd + camera.cy_px], axis=-1)
    return Projection(uv, n, P)


def jacobian(pr: Projection, camera: CameraIntrinsics, t: Array) -> Array:
    """Return the Jacobian (B, M, 6) of n . pixel: rotation about the target's origin, then translation."""
    P = pr.points_camera_m
    z = np.maximum(P[..., 2], 1e-3)
    gx = pr.normals[..., 0] * camera.fx_px / z
    gy = pr.normals[..., 1] * camera.fy_px / z
    gz = -(gx * P[..., 0] + gy * P[..., 1]) / z
    g = np.stack([gx, gy, gz], axis=-1)
    arm = P - t[:, None, :]
    # d(w x arm) . g = w . (arm x g)
    return np.concatenate([cross(arm, g), g], axis=-1)
