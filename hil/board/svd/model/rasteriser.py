"""The craft drawn as faces of unknown brightness, for alignment on the whole picture rather than on edges.

Which face is seen in which pixel follows from the pose; how bright each face is, the picture itself tells (the mean
of its pixels), so nothing needs to be known of the Sun. What remains is a difference of pictures, and its
derivative by the pose lives where faces meet.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Tuple

import cv2
import numpy as np

if TYPE_CHECKING:
    from flyaround.hil.board.svd.geometry.camera import CameraIntrinsics

from flyaround.hil.board.svd.geometry.faces import Faces
from flyaround.hil.board.svd.geometry.image_patch import ImagePatch
from flyaround.hil.board.svd.native.backend import accelerated
from flyaround.hil.board.svd.native.raster import rasteriser as native

Array = np.ndarray

# What OpenCV's polygon filling adds on every side [px]: with it the drawn area is the true one.
BORDER_PX = 0.48


# Width below which what is drawn is too wide all the same [px].
NARROW_PX = 1.2


@accelerated(native.order_faces)
def order_faces(faces: Faces, C_m: Array) -> Array:
    """Faces that look at the camera centre ``C_m`` (3,), the farthest first."""
    gain, base, ids, node = faces.painting_places
    side = (faces.plane[:, :3] @ C_m > faces.plane[:, 3]).astype(np.float32)
    keep = (faces.normals @ C_m > faces.offset)[ids]
    ids, rank = ids[keep], (gain @ side + base)[node[keep]]
    middle = faces.middles[ids] - C_m
    far_first = -np.einsum("ij,ij->i", middle, middle)
    # within a leaf by distance; faces on the plane of a node lie beside each other
    return np.asarray(ids[np.lexsort((far_first, rank))])


def _undistorted(_: Faces, __: Array, camera: CameraIntrinsics, *___: object) -> bool:
    return not camera.distorted


@accelerated(native.draw_faces, _undistorted)
def draw_faces(
    faces: Faces,
    order: Array,
    camera: CameraIntrinsics,
    R: Array,
    t: Array,
    patch: ImagePatch,
    least_px: float = 0.5,
) -> Array:
    """(h * fine, w * fine) int32: number of the face seen + 1, 0 where there is none.

    Parameters
    ----------
    order : faces to draw, the farthest first. least_px : smaller ones are left to their neighbours [drawn px^2].
    """
    h, w = patch.gray.shape
    p = camera.pixels(faces.corners[order] @ R.T + t)
    p = (p - (patch.x0, patch.y0) + 0.5) * patch.scale - 0.5
    return fill_faces(p, order, (h * patch.fine, w * patch.fine), least_px, exact=patch.exact)


@accelerated(native.fill_faces)
def fill_faces(
    p: Array, order: Array, shape: Tuple[int, int], least_px: float, *, exact: bool = False
) -> Array:
    """Convex polygons ``p`` (P, 4, 2) filled one over the other with their number in ``order`` + 1.

    Parameters
    ----------
    exact : whether those narrower than a pixel get their true area.
    """
    d1, d2 = p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]
    worth = np.abs(d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]) > 2.0 * least_px
    p, order = inset(shortened(p[worth]) if exact else p[worth]), order[worth]
    seen = np.zeros(shape, np.int32)
    polygons = np.rint(np.clip(p, -3000, 3000) * 16).astype(np.int32)
    fill, line = cv2.fillConvexPoly, cv2.LINE_8
    for polygon, number in zip(polygons, (order + 1).tolist()):  # noqa: B905 - Python 3.9 has no strict=
        fill(seen, polygon, number, line, 4)
    return seen


def shortened(p: Array) -> Array:
    """(P, 4, 2) convex polygons, narrow ones made shorter so that they cover what they should.

    OpenCV draws nothing narrower than a pixel. The rims of plates lie along the craft's outline as such strips: drawn
    a pixel wide each they make the craft larger by a tenth of a pixel all round, and its range longer.
    """
    (ax, ay), (bx, by) = (p[:, 2] - p[:, 0]).T, (p[:, 3] - p[:, 1]).T
    first, second = ax * ax + ay * ay, bx * bx + by * by
    squared = np.maximum(np.maximum(first, second), 1e-12)
    area = 0.5 * np.abs(ax * by - ay * bx)
    narrow = np.flatnonzero(area * area < NARROW_PX**2 * squared)
    if not len(narrow):
        return p
    some, length = p[narrow], np.sqrt(squared[narrow])
    width = area[narrow] / length
    longer = (first > second)[narrow]
    ux, uy = (
        np.where(longer, ax[narrow], bx[narrow]) / length,
        np.where(longer, ay[narrow], by[narrow]) / length,
    )
    # the width drawn after ``inset``, measured at all angles
    share = width / (0.98 + 0.19 * width) - 1.0
    along = some[..., 0] * ux[:, None] + some[..., 1] * uy[:, None]
    away = share[:, None] * (along - 0.25 * along.sum(axis=1, keepdims=True))
    out = p.copy()
    out[narrow, :, 0] += away * ux[:, None]
    out[narrow, :, 1] += away * uy[:, None]
    return out


def inset(p: Array) -> Array:
    """(P, 4, 2) convex polygons made smaller by what OpenCV adds to them: it fills the border's pixels too."""
    x, y = np.ascontiguousarray(p[..., 0]), np.ascontiguousarray(p[..., 1])
    ex, ey = x[:, [1, 2, 3, 0]] - x, y[:, [1, 2, 3, 0]] - y
    squared = ex * ex + ey * ey
    length = np.sqrt(squared)
    # unit normals to the left of each side, and of the side before it
    scale = 1.0 / np.maximum(length, 1e-9)
    ax, ay = -ey * scale, ex * scale
    bx, by = ax[:, [3, 0, 1, 2]], ay[:, [3, 0, 1, 2]]
    three = np.flatnonzero(squared[:, 2] < 1e-12)
    # a triangle's last corner is there twice: its two sides are the ones before and after both
    bx[three, 3], by[three, 3] = ax[three, 1], ay[three, 1]
    ax[three, 2], ay[three, 2] = ax[three, 3], ay[three, 3]
    d1, d2 = p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]
    twice = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]
    far = np.sign(twice) * np.minimum(BORDER_PX, 0.4 * np.abs(twice) / np.maximum(length.sum(axis=1), 1e-9))
    share = far[:, None] / np.maximum(1 + ax * bx + ay * by, 0.3)
    out = np.empty_like(p)
    out[..., 0], out[..., 1] = x + (ax + bx) * share, y + (ay + by) * share
    return out
