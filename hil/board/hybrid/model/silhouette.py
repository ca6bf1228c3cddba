"""Silhouette of the model, and the side of an edge on which the target lies."""

from __future__ import annotations

from typing import Tuple

import cv2
import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.hybrid.geometry.wireframe import OccludingTriangles

Array = np.ndarray

# Distance from an edge at which the silhouette is sampled on either side [px of the mask].
PROBE_PX = 3.0


def silhouette(
    R: Array,
    t: Array,
    occ: OccludingTriangles,
    camera: CameraIntrinsics,
    origin: Tuple[float, float],
    factor: float,
    size: Tuple[int, int],
) -> Array:
    """Return the mask (h, w) of the model on a region of the image; the model is in front of the camera.

    Parameters
    ----------
    R : (3, 3) array
        Rotation, camera from target.
    t : (3,) array
        Target position, camera frame [m].
    occ : OccludingTriangles
        Mesh of the model.
    camera : CameraIntrinsics
        Intrinsics of the camera.
    origin : tuple of float
        Upper left corner of the region [image px].
    factor : float
        Image pixels per mask pixel.
    size : tuple of int
        Width and height of the mask.
    """
    shape = np.zeros((size[1], size[0]), np.uint8)
    if not len(occ.v0):
        return shape > 0
    front = np.einsum("ij,ij->i", -R.T @ t - occ.v0, occ.n) > 0
    corners = np.stack([occ.v0, occ.v0 + occ.e1, occ.v0 + occ.e2], axis=1)[front] @ R.T + t
    uv = (camera.pixels(corners) - origin + 0.5) / factor - 0.5
    # in eighths of a pixel; OpenCV's fixed-point numbers would overflow far outside the mask
    for triangle in np.rint(np.clip(uv, -4000, 4000) * 8).astype(np.int32):
        cv2.fillConvexPoly(shape, triangle, 1, cv2.LINE_8, 3)
    return shape > 0


def inward_sign(mask: Array, uv: Array, n: Array) -> Array:
    """Return +1 (M,) where the target lies on the side of the normal, -1 where it lies on the other, 0 if undecided.

    Parameters
    ----------
    mask : (h, w) array
        Silhouette.
    uv : (M, 2) array
        Points on its outline [px].
    n : (M, 2) array
        Unit normals of the outline.
    """
    return _inside(mask, uv + PROBE_PX * n).astype(int) - _inside(mask, uv - PROBE_PX * n).astype(int)


def _inside(mask: Array, uv: Array) -> Array:
    h, w = mask.shape
    x, y = np.rint(uv[:, 0]).astype(int), np.rint(uv[:, 1]).astype(int)
    ok = (x >= 0) & (x < w) & (y >= 0) & (y < h)
    return np.asarray(ok & mask[np.clip(y, 0, h - 1), np.clip(x, 0, w - 1)])
