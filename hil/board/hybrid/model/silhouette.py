"""The model's silhouette on the picture, and on which side of an edge the craft lies."""

from __future__ import annotations

from typing import Tuple

import cv2
import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.hybrid.geometry.wireframe import OccludingTriangles

Array = np.ndarray

# How far to either side of an edge the silhouette is asked [px of the mask].
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
    """(h, w) bool mask of the model on a region of the picture.

    Parameters
    ----------
    R, t : camera from target. origin : the region's corner; factor : picture pixels per mask pixel.
    size : (w, h) of the mask.
    """
    shape = np.zeros((size[1], size[0]), np.uint8)
    if not len(occ.v0):
        return shape > 0
    front = np.einsum("ij,ij->i", -R.T @ t - occ.v0, occ.n) > 0
    corners = np.stack([occ.v0, occ.v0 + occ.e1, occ.v0 + occ.e2], axis=1)[front] @ R.T + t
    uv = (camera.pixels(corners) - origin + 0.5) / factor - 0.5
    for triangle in np.rint(np.clip(uv, -4000, 4000) * 8).astype(np.int32):
        cv2.fillConvexPoly(shape, triangle, 1, cv2.LINE_8, 3)
    return shape > 0


def inward_sign(mask: Array, uv: Array, n: Array) -> Array:
    """(M,) +1 where the craft lies along ``n`` and space against it, -1 the other way, 0 elsewhere.

    Parameters
    ----------
    uv : (M, 2) points on the mask [px]. n : (M, 2) unit normals.
    """
    return _inside(mask, uv + PROBE_PX * n).astype(int) - _inside(mask, uv - PROBE_PX * n).astype(int)


def _inside(mask: Array, uv: Array) -> Array:
    h, w = mask.shape
    x, y = np.rint(uv[:, 0]).astype(int), np.rint(uv[:, 1]).astype(int)
    ok = (x >= 0) & (x < w) & (y >= 0) & (y < h)
    return np.asarray(ok & mask[np.clip(y, 0, h - 1), np.clip(x, 0, w - 1)])
