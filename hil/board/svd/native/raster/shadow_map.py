"""Shadow map of the target, cast shadows, and the search for the Sun, in C."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any, Optional, Tuple

import numpy as np

from flyaround.hil.board.svd.native.arrays import checked_pointer, contiguous
from flyaround.hil.board.svd.native.raster.rasteriser import (
    PackedFaces,
    fill_faces,
    order_faces,
    pinhole_view,
)

if TYPE_CHECKING:
    from flyaround.hil.board.svd.geometry.camera import CameraIntrinsics
    from flyaround.hil.board.svd.geometry.faces import Faces
    from flyaround.hil.board.svd.geometry.image_patch import ImagePatch
    from flyaround.hil.board.svd.geometry.shading import Shading

Array = np.ndarray

# Fewer points on the craft say nothing of shadows.
LEAST_POINTS = 40


class _Sun(ctypes.Structure):
    """shadow_map.h: struct sun."""

    _fields_ = [
        *((name, ctypes.c_void_p) for name in ("axes", "at", "height", "seen")),
        ("side", ctypes.c_int64),
        ("bytes", ctypes.c_int64),
    ]


class _Table(ctypes.Structure):
    """shadow_map.h: struct sun_table."""

    _fields_ = [
        *((name, ctypes.c_void_p) for name in ("frames", "origin", "pitch", "height")),
        ("directions", ctypes.c_int64),
        ("side", ctypes.c_int64),
    ]


class _SunImage(ctypes.Structure):
    """shadow_map.h: struct sun_image."""

    _fields_ = [
        *((name, ctypes.c_void_p) for name in ("seen", "centre", "good", "gray", "group")),
        *((name, ctypes.c_int64) for name in ("h", "w", "fine", "groups", "labels", "bytes")),
        ("darkest", ctypes.c_float),
    ]


def polygons(
    library: ctypes.CDLL, faces: Faces, order: Array, frame: Array, n: int
) -> Tuple[Array, Array, float]:
    """Faces ``order`` on the Sun's picture: (P, 4, 2) polygons [px], its origin (2,) and pitch [m].

    Parameters
    ----------
    frame : (3, 3) axes of the picture and the direction to the Sun. n : its side [px].
    """
    p, out = np.empty((len(order), 4, 2)), np.empty(3)
    library.fly_shadow_map_polygons(
        ctypes.byref(PackedFaces.of(faces).pointers),
        ctypes.c_void_p(checked_pointer(order, "int64")),
        ctypes.c_int64(len(order)),
        ctypes.c_void_p(checked_pointer(frame, "float64", (3, 3))),
        ctypes.c_int64(n),
        ctypes.c_void_p(checked_pointer(p, "float64")),
        ctypes.c_void_p(checked_pointer(out, "float64")),
    )
    return p, out[:2].copy(), float(out[2])


def heights(
    library: ctypes.CDLL, faces: Faces, frame: Array, origin: Array, pitch_m: float, seen: Array
) -> Array:
    """(n, n) float32 heights [m] of what the Sun sees (n, n) int32."""
    at, out = np.array([*origin, pitch_m]), np.empty(seen.shape, np.float32)
    failed = library.fly_shadow_map_heights(
        ctypes.byref(PackedFaces.of(faces).pointers),
        ctypes.c_void_p(checked_pointer(frame, "float64", (3, 3))),
        ctypes.c_void_p(checked_pointer(at, "float64", (3,))),
        ctypes.c_void_p(checked_pointer(seen, "int32", (len(seen), len(seen)))),
        ctypes.c_int64(len(seen)),
        ctypes.c_void_p(checked_pointer(out, "float32")),
    )
    _checked(failed)
    return out


def seen_from_the_sun(
    library: ctypes.CDLL, faces: Faces, s: Array, axes: Array, n: int
) -> Tuple[Array, float, Array, Array]:
    """As ``shadow_map._seen_from_the_sun``."""
    some, frame = order_faces(library, faces, s * 1e6), np.vstack([axes, s])
    p, origin, pitch = polygons(library, faces, some, frame, n)
    seen = fill_faces(library, p, some, (n, n), 0.5)
    return origin, pitch, heights(library, faces, frame, origin, pitch, seen), seen


def shadows(
    library: ctypes.CDLL,
    sun: Any,  # noqa: ANN401 - ShadowMap
    faces: Faces,
    seen: Array,
    patch: ImagePatch,
    camera: CameraIntrinsics,
    R: Array,
    t: Array,
) -> Array:
    """As ``ShadowMap.shadows``."""
    R, t, dark = contiguous(R, "float64"), contiguous(t, "float64"), np.zeros(seen.shape, bool)
    failed = library.fly_shadows(
        ctypes.byref(PackedFaces.of(faces).pointers),
        ctypes.byref(sun.packed[0]),
        ctypes.byref(pinhole_view(camera, patch)),
        ctypes.c_void_p(checked_pointer(R, "float64", (3, 3))),
        ctypes.c_void_p(checked_pointer(t, "float64", (3,))),
        ctypes.c_void_p(checked_pointer(seen, "int32")),
        ctypes.c_int64(seen.shape[0]),
        ctypes.c_int64(seen.shape[1]),
        ctypes.c_void_p(checked_pointer(dark, "bool")),
    )
    _checked(failed)
    return dark


def packed_sun(
    frame: Array, origin: Array, pitch_m: float, height: Array, seen: Array
) -> Tuple[Any, Tuple[Array, ...]]:
    """A shadow map as C takes it, and what keeps its arrays alive.

    Parameters
    ----------
    frame : (3, 3) axes of the map and the direction to the Sun. origin, pitch_m, height, seen : as of ``ShadowMap``.
    """
    n = len(height)
    at = np.array([*origin, pitch_m])
    kind = "uint16" if seen.dtype == np.uint16 else "int32"
    struct = _Sun(
        checked_pointer(frame, "float64", (3, 3)),
        checked_pointer(at, "float64", (3,)),
        checked_pointer(height, "float32", (n, n)),
        checked_pointer(seen, kind, (n, n)),
        n,
        seen.itemsize,
    )
    return struct, (frame, at, height, seen)


def packed_table(
    frames: Array, origin: Array, pitch_m: Array, height: Array
) -> Tuple[Any, Tuple[Array, ...]]:
    """Shadow maps as C takes them, and what keeps their arrays alive; the arrays are those of ``ShadowMapTable``."""
    arrays = (
        contiguous(frames, "float64"),
        contiguous(origin, "float64"),
        contiguous(pitch_m, "float64"),
        contiguous(height, "float32"),
    )
    at = [a.__array_interface__["data"][0] for a in arrays]
    return _Table(*at, len(height), height.shape[1]), arrays


def sun_costs(
    library: ctypes.CDLL,
    table: Any,  # noqa: ANN401 - ShadowMapTable
    faces: Faces,
    shading: Shading,
    patch: ImagePatch,
    camera: CameraIntrinsics,
    R: Array,
    t: Array,
    some: Array,
    pixels: int,
    darkest: float,
    dim: float,
) -> Optional[Array]:
    """(S,) what each of the directions ``some`` (S,) leaves unexplained; None where too little is seen.

    Parameters
    ----------
    table : of ``packed_table``. darkest : least of the patch. dim : brightness that is as good as none.
    others as in ``ShadowMapTable.find``.
    """
    good = shading.area > 0
    good[0] = False
    h, w = patch.gray.shape
    gray, group, some = (
        contiguous(patch.gray, "float32"),
        contiguous(faces.group, "int64"),
        contiguous(some, "int64"),
    )
    kind = "uint8" if shading.centre.dtype == np.uint8 else "uint16"
    centre = contiguous(shading.centre, kind)
    picture = _SunImage(
        checked_pointer(shading.seen, "int32", (h * patch.fine, w * patch.fine)),
        checked_pointer(centre, kind, (h, w)),
        checked_pointer(good, "bool"),
        checked_pointer(gray, "float32"),
        checked_pointer(group, "int64"),
        h,
        w,
        patch.fine,
        faces.groups,
        len(good),
        centre.itemsize,
        darkest,
    )
    R, t, out = contiguous(R, "float64"), contiguous(t, "float64"), np.empty(len(some))
    run = library.fly_sun_costs
    run.restype = ctypes.c_int64
    points = run(
        ctypes.byref(PackedFaces.of(faces).pointers),
        ctypes.byref(table.packed[0]),
        ctypes.byref(picture),
        ctypes.byref(pinhole_view(camera, patch)),
        ctypes.c_void_p(checked_pointer(R, "float64", (3, 3))),
        ctypes.c_void_p(checked_pointer(t, "float64", (3,))),
        ctypes.c_double(dim),
        ctypes.c_int64(pixels),
        ctypes.c_void_p(checked_pointer(some, "int64")),
        ctypes.c_int64(len(some)),
        ctypes.c_void_p(checked_pointer(out, "float64")),
    )
    _checked(-1 if points < 0 else 0)
    return out if points >= LEAST_POINTS else None


def mean_pixel(library: ctypes.CDLL, seen: Array) -> Array:
    """(2,) mean column and row of the pixels of ``seen`` (h, w) that show the craft; NaN where none does."""
    out = np.empty(2)
    run = library.fly_mean_pixel
    run.restype = ctypes.c_int64
    n = run(
        ctypes.c_void_p(checked_pointer(seen, "int32")),
        ctypes.c_int64(seen.shape[0]),
        ctypes.c_int64(seen.shape[1]),
        ctypes.c_void_p(checked_pointer(out, "float64")),
    )
    return out if n else np.full(2, np.nan)


def _checked(failed: int) -> None:
    if failed:
        raise MemoryError("no memory for the Sun's pictures")
