"""The rasteriser, shadows and hidden edges in numpy: what the compiled library must compute."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from flyaround.hil.board.estimation.camera import CameraIntrinsics
    from flyaround.hil.board.estimation.faces import Faces
    from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch

Array = np.ndarray

# What OpenCV's polygon filling adds on every side [px]: with it the drawn area is the true one.
BORDER_PX = 0.48

# Width below which what is drawn is too wide all the same [px].
NARROW_PX = 1.2


def fill_faces(
    p: Array, order: Array, shape: tuple[int, int], least_px: float, *, exact: bool = False
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


def rays_to_faces(
    faces: Faces, seen: Array, where: Array, patch: ImagePatch, camera: CameraIntrinsics, R: Array, t: Array
) -> tuple[Array, Array, Array, Array]:
    """Face, normalised coordinates and depth of drawn pixels ``where`` (flat indices), all (N,).

    Parameters
    ----------
    camera : a pinhole. R, t : camera from target.
    """
    face = np.take(seen.ravel(), where) - 1
    # a remainder costs ten times what this does
    y = where // seen.shape[1]
    x = where - y * seen.shape[1]
    u, v = (a.astype(np.float32) for a in patch.rays(camera))
    u, v = np.take(u, x), np.take(v, y)
    # a plane n.X = d in the camera's frame has the inverse depth n.ray / d
    n_c = faces.normals @ R.T
    d_c = faces.offset + n_c @ t
    inverse = (n_c / np.where(np.abs(d_c) > 1e-9, d_c, 1e-9)[:, None]).astype(np.float32)
    near = np.take(inverse[:, 0], face) * u + np.take(inverse[:, 1], face) * v + np.take(inverse[:, 2], face)
    return face, u, v, 1.0 / np.maximum(near, np.float32(0.2 / max(t[2], 1e-3)))
