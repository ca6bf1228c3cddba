"""Faces rasterised on an image patch, in C."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Tuple

import numpy as np

from flyaround.hil.board.svd.native.arrays import checked_pointer, contiguous, pointer

if TYPE_CHECKING:
    from flyaround.hil.board.svd.geometry.camera import CameraIntrinsics
    from flyaround.hil.board.svd.geometry.faces import Faces
    from flyaround.hil.board.svd.geometry.image_patch import ImagePatch

Array = np.ndarray

_POINTERS = ("corners", "normals", "offset", "middles", "plane", "children", "first", "members")


class _Faces(ctypes.Structure):
    """face_mesh.h: struct faces."""

    _fields_ = [
        *((name, ctypes.c_void_p) for name in _POINTERS),
        ("faces", ctypes.c_int64),
        ("nodes", ctypes.c_int64),
    ]


class _View(ctypes.Structure):
    """face_mesh.h: struct view."""

    _fields_ = [(name, ctypes.c_double) for name in ("fx", "fy", "cx", "cy", "x0", "y0", "across", "down")]


def pinhole_view(camera: CameraIntrinsics, patch: ImagePatch) -> ctypes.Structure:
    """What a patch shows of a pinhole's picture: struct view, kept for the next pose."""
    of, struct = patch.kept.get("view", (None, None))
    if of is not camera:
        c, (across, down) = camera, patch.scale
        struct = _View(c.fx_px, c.fy_px, c.cx_px, c.cy_px, patch.x0, patch.y0, across, down)
        patch.kept["view"] = camera, struct
    return struct


@dataclass(frozen=True, eq=False)
class PackedFaces:
    """Faces as C takes them: made once for each craft.

    Parameters
    ----------
    arrays : what ``pointers`` names, kept alive. members : how many faces its nodes hold in all.
    """

    arrays: Tuple[Array, ...]
    pointers: Any
    members: int

    @staticmethod
    def of(faces: Faces) -> PackedFaces:
        """The faces, kept for the next call."""
        struct = faces.kept.get("packed")
        if struct is None:
            struct = faces.kept["packed"] = PackedFaces._of(faces)
        return struct

    @staticmethod
    def _of(faces: Faces) -> PackedFaces:
        number = [len(m) for m in faces.members]
        arrays = (
            *(
                contiguous(a, "float64")
                for a in (faces.corners, faces.normals, faces.offset, faces.middles, faces.plane)
            ),
            _one_parent(faces.children),
            contiguous(np.concatenate([[0], np.cumsum(number)]), "int64"),
            contiguous(np.concatenate(faces.members), "int64"),
        )
        at = [a.__array_interface__["data"][0] for a in arrays]
        return PackedFaces(arrays, _Faces(*at, len(faces.corners), len(faces.children)), int(sum(number)))


def _one_parent(children: Array) -> Array:
    """(N, 2) int64 with each child under the first node that names it: a file may name one twice."""
    out = contiguous(children, "int64").copy()
    taken = set()
    for entry in range(out.size):
        child = int(out.flat[entry])
        if child >= 0 and child in taken:
            out.flat[entry] = -1
        taken.add(child)
    return out


def order_faces(library: ctypes.CDLL, faces: Faces, C_m: Array) -> Array:
    """As ``rasteriser.order_faces``."""
    packed = PackedFaces.of(faces)
    C, out = contiguous(C_m, "float64"), np.empty(packed.members, np.int64)
    run = library.fly_order_faces
    run.restype = ctypes.c_int64
    n = run(
        ctypes.byref(packed.pointers),
        ctypes.c_void_p(checked_pointer(C, "float64", (3,))),
        ctypes.c_void_p(checked_pointer(out, "int64")),
    )
    if n < 0:
        raise MemoryError("no memory to order the faces")
    return out[:n]


def draw_faces(
    library: ctypes.CDLL,
    faces: Faces,
    some: Array,
    camera: CameraIntrinsics,
    R: Array,
    t: Array,
    patch: ImagePatch,
    least_px: float = 0.5,
) -> Array:
    """As ``rasteriser.draw_faces``, of a pinhole."""
    h, w = (side * patch.fine for side in patch.gray.shape)
    seen, some = np.zeros((h, w), np.int32), contiguous(some, "int64")
    R, t = contiguous(R, "float64"), contiguous(t, "float64")
    library.fly_draw_faces(
        ctypes.byref(PackedFaces.of(faces).pointers),
        ctypes.c_void_p(checked_pointer(some, "int64")),
        ctypes.c_int64(len(some)),
        ctypes.c_void_p(checked_pointer(R, "float64", (3, 3))),
        ctypes.c_void_p(checked_pointer(t, "float64", (3,))),
        ctypes.byref(pinhole_view(camera, patch)),
        ctypes.c_double(least_px),
        ctypes.c_int(patch.exact),
        ctypes.c_void_p(pointer(seen)),
        ctypes.c_int64(h),
        ctypes.c_int64(w),
    )
    return seen


def fill_faces(
    library: ctypes.CDLL,
    p: Array,
    some: Array,
    shape: Tuple[int, int],
    least_px: float,
    *,
    exact: bool = False,
) -> Array:
    """As ``rasteriser.fill_faces``."""
    seen, p, some = np.zeros(shape, np.int32), contiguous(p, "float64"), contiguous(some, "int64")
    library.fly_fill_faces(
        ctypes.c_void_p(checked_pointer(p, "float64", (len(some), 4, 2))),
        ctypes.c_void_p(checked_pointer(some, "int64")),
        ctypes.c_int64(len(some)),
        ctypes.c_double(least_px),
        ctypes.c_int(exact),
        ctypes.c_void_p(checked_pointer(seen, "int32")),
        ctypes.c_int64(shape[0]),
        ctypes.c_int64(shape[1]),
    )
    return seen
