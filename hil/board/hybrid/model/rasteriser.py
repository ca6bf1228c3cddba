"""Rendering of the target as faces of unknown brightness, for alignment on the whole image rather than on edges.

The pose determines the visible face of each pixel. A face's brightness is the mean of its pixels, so the Sun direction
is not needed. The residual is the image difference; its derivative by the pose is non-zero where faces meet.
"""

from __future__ import annotations

from typing import Tuple

import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.faces import Faces
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.geometry.native_faces import native_faces
from flyaround.hil.board.hybrid.model.image_formation import pinhole_view
from flyaround.hil.board.hybrid.native.interface import contiguous
from flyaround.hil.board.hybrid.native.library import library

Array = np.ndarray

# Minimum area of a face [rendered px^2]; smaller ones are skipped, so that their neighbours show.
MIN_FACE_PX = 0.5


def order_faces(faces: Faces, C_m: Array) -> Array:
    """Return the faces visible from the camera centre ``C_m`` (3,), back to front.

    Raises
    ------
    MemoryError
        If the library is out of memory.
    """
    out = np.empty(len(native_faces(faces).values["members"]), np.int64)
    n = library().fly_order_faces(native_faces(faces), contiguous(C_m, "float64", (3,)), out)
    if n < 0:
        raise MemoryError("out of memory while sorting faces")
    return out[:n]


def draw_faces(
    faces: Faces, order: Array, camera: CameraIntrinsics, R: Array, t: Array, patch: ImagePatch
) -> Array:
    """Return the visible face of each rendered pixel (h * fine, w * fine), int32: face index + 1, or 0 for none.

    Parameters
    ----------
    faces : Faces
        Faces of the target.
    order : (P,) array
        Faces to draw, back to front.
    camera : CameraIntrinsics
        Pinhole camera.
    R : (3, 3) array
        Rotation, camera from target.
    t : (3,) array
        Target position, camera frame [m].
    patch : ImagePatch
        Patch to render.
    """
    h, w = (side * patch.fine for side in patch.gray.shape)
    visible_face, order = np.zeros((h, w), np.int32), contiguous(order, "int64")
    R, t = contiguous(R, "float64", (3, 3)), contiguous(t, "float64", (3,))
    view = pinhole_view(camera, patch)
    library().fly_draw_faces(
        native_faces(faces), order, len(order), R, t, view, MIN_FACE_PX, patch.exact, visible_face, h, w
    )
    return visible_face


def fill_faces(
    p: Array, order: Array, shape: Tuple[int, int], least_px: float, *, exact: bool = False
) -> Array:
    """Fill convex polygons back to front, and return the index + 1 of the polygon visible in each pixel.

    Parameters
    ----------
    p : (P, 4, 2) array
        Polygon corners [px].
    order : (P,) array
        Index of each polygon.
    shape : tuple of int
        Rows and columns.
    least_px : float
        Minimum area of a polygon that is filled [px^2].
    exact : bool
        Preserve the area of polygons narrower than a pixel.
    """
    visible_face, order = np.zeros(shape, np.int32), contiguous(order, "int64")
    p = contiguous(p, "float64", (len(order), 4, 2))
    library().fly_fill_faces(p, order, len(order), least_px, exact, visible_face, *shape)
    return visible_face
