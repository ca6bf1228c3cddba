"""Brightness of faces and how well a drawn craft explains the picture, by the C kernels: levels.c, score.c."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Optional, Tuple

import numpy as np

from hil.board.svd.kernels.library import address, laid
from hil.board.svd.kernels.pictures import gauss
from hil.board.svd.kernels.pictures import shown as shown_by

if TYPE_CHECKING:
    from hil.board.svd.shade import Canvas, Faces

Array = np.ndarray


def shade(
    library: ctypes.CDLL,
    faces: Faces,
    seen: Array,
    canvas: Canvas,
    dark: Optional[Array],
    *,
    empty: bool,
) -> Optional[Tuple[Array, ...]]:
    """As ``levels.shade`` up to what is saturated and what is behind.

    Parameters
    ----------
    empty : whether the background's share of each pixel is asked for.

    Returns
    -------
    Groups (H, W), their level (n,), the picture (h, w), groups at middles (h, w), area (n,), pixels well inside a
    group (h, w), the background's share of each (h, w), else empty, and the background's mean value (1,); None where
    a byte holds too few groups.
    """
    (h, w), f, n = canvas.gray.shape, canvas.fine, faces.groups + 1
    seen, gray, labels = laid(seen, "int32"), laid(canvas.gray, "float32"), laid(faces.labels, "uint16")
    light = None if dark is None else laid(dark, "bool")
    group, centre, core = (
        np.empty((h * f, w * f), np.uint8),
        np.empty((h, w), np.uint8),
        np.empty((h, w), bool),
    )
    picture, share = np.empty((h, w), np.float32), np.empty((h, w) if empty else (0, 0), np.float32)
    level, area, ground = np.empty(256), np.empty(256, np.int64), np.empty(1)
    run, at = library.fly_shade, ctypes.c_void_p
    run.restype = ctypes.c_int64
    n = run(
        at(address(seen, "int32", group.shape)),
        None if light is None else at(address(light, "bool", group.shape)),
        at(address(labels, "uint16", (len(faces.corners) + 1,))),
        ctypes.c_int64(len(faces.corners)),
        ctypes.c_int64(n),
        at(address(gray, "float32")),
        ctypes.c_int64(h),
        ctypes.c_int64(w),
        ctypes.c_int64(f),
        ctypes.c_double(canvas.sigma),
        shown_by(canvas.response).at,
        *(at(a.__array_interface__["data"][0]) for a in (group, centre, core, picture, level, area, ground)),
        at(share.__array_interface__["data"][0]) if empty else None,
    )
    if n < 0:
        raise MemoryError("no memory to find the brightness of faces")
    return (group, level[:n], picture, centre, area[:n], core, share, ground) if n else None


def behind(
    library: ctypes.CDLL,
    canvas: Canvas,
    made: Tuple[Array, ...],
    blur_px: float,
) -> Array:
    """(h, w) what the background differs from its level by, which is added to the picture that ``made`` holds.

    Parameters
    ----------
    made : of ``shade``, the background's share with it. blur_px : of means of 4 x 4 pixels.
    """
    _, level, picture, centre, _, core, empty, shown = made
    h, w = canvas.gray.shape
    gray, out = laid(canvas.gray, "float32"), np.empty((h, w), np.float32)
    run, at = library.fly_behind, ctypes.c_void_p
    run.restype = ctypes.c_int64
    done = run(
        at(address(gray, "float32", (h, w))),
        at(address(core, "bool", (h, w))),
        at(address(centre, "uint8", (h, w))),
        ctypes.c_int64(h),
        ctypes.c_int64(w),
        ctypes.c_double(float(shown[0])),
        ctypes.c_double(float(level[0])),
        shown_by(canvas.response).at,
        gauss(blur_px).at,
        at(address(empty, "float32", (h, w))),
        at(address(out, "float32")),
        at(address(picture, "float32", (h, w))),
    )
    if done < 0:
        raise MemoryError("no memory for the background about the craft")
    return out


def explained(
    library: ctypes.CDLL,
    picture: Array,
    group: Array,
    canvas: Canvas,
    blurs_px: Tuple[float, float, float],
    noise: float,
    bound: float,
    none: Optional[Array],
    covered: float,
) -> float:
    """Bounded squared deviations from the drawn ``picture`` summed, as in ``photometric.explained``.

    Parameters
    ----------
    group : (H, W) bytes. blurs_px : of the optics, the score, and what is covered. none : (h, w) deviations without
        the craft, which hold where no more than ``covered`` of a pixel is.
    """
    h, w = canvas.gray.shape
    gray = laid(canvas.blurred(blurs_px[1]), "float32")
    picture = laid(picture, "float32")
    bare = None if none is None else laid(none, "float32")
    optics, score, cover = (gauss(b).at for b in blurs_px)
    run, at = library.fly_explained, ctypes.c_void_p
    run.restype = ctypes.c_double
    out = run(
        at(address(picture, "float32", (h, w))),
        at(address(group, "uint8", (h * canvas.fine, w * canvas.fine))),
        ctypes.c_int64(h),
        ctypes.c_int64(w),
        ctypes.c_int64(canvas.fine),
        optics,
        shown_by(canvas.response).at,
        at(address(gray, "float32", (h, w))),
        score,
        ctypes.c_double(noise),
        ctypes.c_double(bound),
        None if bare is None else at(address(bare, "float32", (h, w))),
        cover,
        ctypes.c_double(covered),
    )
    if out < 0:
        raise MemoryError("no memory to compare a drawn craft with the picture")
    return float(out)
