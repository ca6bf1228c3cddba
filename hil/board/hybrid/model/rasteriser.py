"""The craft drawn as faces of unknown brightness, for alignment on the whole image rather than on edges.

The pose determines which face each pixel shows; the brightness of a face is the mean of its pixels, so that the Sun
need not be known. The residual is a difference of images, and its derivative by the pose is non-zero where faces meet.
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


def order_faces(faces: Faces, C_m: Array) -> Array:
    """Return the faces that look at the camera centre ``C_m`` (3,), the farthest first."""
    out = np.empty(len(native_faces(faces).values["members"]), np.int64)
    n = library().fly_order_faces(native_faces(faces), contiguous(C_m, "float64", (3,)), out)
    if n < 0:
        raise MemoryError("no memory to order the faces")
    return out[:n]


def draw_faces(
    faces: Faces,
    order: Array,
    camera: CameraIntrinsics,
    R: Array,
    t: Array,
    patch: ImagePatch,
    least_px: float = 0.5,
) -> Array:
    """Return the number + 1 of the face that each drawn pixel shows (h * fine, w * fine), int32; 0 for none.

    Parameters
    ----------
    faces : Faces
        Faces of the target.
    order : (P,) array
        Faces to draw, the farthest first.
    camera : CameraIntrinsics
        A pinhole.
    R, t : (3, 3), (3,) array
        Camera from target.
    patch : ImagePatch
        Patch to draw on.
    least_px : float
        Least area of a face [drawn px^2]; smaller ones are left to their neighbours.
    """
    h, w = (side * patch.fine for side in patch.gray.shape)
    seen, order = np.zeros((h, w), np.int32), contiguous(order, "int64")
    R, t = contiguous(R, "float64", (3, 3)), contiguous(t, "float64", (3,))
    view = pinhole_view(camera, patch)
    library().fly_draw_faces(
        native_faces(faces), order, len(order), R, t, view, least_px, patch.exact, seen, h, w
    )
    return seen


def fill_faces(
    p: Array, order: Array, shape: Tuple[int, int], least_px: float, *, exact: bool = False
) -> Array:
    """Fill convex polygons one over the other, and return the number + 1 that each pixel shows.

    Parameters
    ----------
    p : (P, 4, 2) array
        Corners [px].
    order : (P,) array
        Number of each.
    shape : tuple of int
        Rows and columns.
    least_px : float
        Least area that is filled [px^2].
    exact : bool
        Give polygons narrower than a pixel their true area.
    """
    seen, order = np.zeros(shape, np.int32), contiguous(order, "int64")
    p = contiguous(p, "float64", (len(order), 4, 2))
    library().fly_fill_faces(p, order, len(order), least_px, exact, seen, *shape)
    return seen
