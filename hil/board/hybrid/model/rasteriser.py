"""The craft drawn as faces of unknown brightness, for alignment on the whole picture rather than on edges.

Which face is seen in which pixel follows from the pose; how bright each face is, the picture itself tells (the mean
of its pixels), so nothing needs to be known of the Sun. What remains is a difference of pictures, and its
derivative by the pose lives where faces meet.
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
    """Faces that look at the camera centre ``C_m`` (3,), the farthest first."""
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
    """(h * fine, w * fine) int32: number of the face seen + 1, 0 where there is none.

    Parameters
    ----------
    order : faces to draw, the farthest first. camera : a pinhole. least_px : smaller ones are left to their neighbours
        [drawn px^2].
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
    """Convex polygons ``p`` (P, 4, 2) filled one over the other with their number in ``order`` + 1.

    Parameters
    ----------
    exact : whether those narrower than a pixel get their true area.
    """
    seen, order = np.zeros(shape, np.int32), contiguous(order, "int64")
    p = contiguous(p, "float64", (len(order), 4, 2))
    library().fly_fill_faces(p, order, len(order), least_px, exact, seen, *shape)
    return seen
