"""Radiometric gains of faces, and how well a synthetic view explains the image, in C."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Optional, Tuple

import numpy as np

from flyaround.hil.board.svd.native.arrays import checked_pointer, contiguous, pointer
from flyaround.hil.board.svd.native.photometric.image_formation import NativeStruct, gaussian, response_tables

if TYPE_CHECKING:
    from flyaround.hil.board.svd.geometry.faces import Faces
    from flyaround.hil.board.svd.geometry.image_patch import ImagePatch
    from flyaround.hil.board.svd.geometry.shading import Shading

Array = np.ndarray


def shade(
    library: ctypes.CDLL,
    faces: Faces,
    seen: Array,
    patch: ImagePatch,
    dark: Optional[Array],
) -> Tuple[Array, ...]:
    """As ``face_gains._shaded``.

    Returns
    -------
    ``NotImplemented`` where a byte holds too few groups.
    """
    empty = patch.textured
    (h, w), f = patch.gray.shape, patch.fine
    seen, light = contiguous(seen, "int32"), None if dark is None else contiguous(dark, "bool")
    group, centre, core = (
        np.empty((h * f, w * f), np.uint8),
        np.empty((h, w), np.uint8),
        np.empty((h, w), bool),
    )
    picture, share = np.empty((h, w), np.float32), np.empty((h, w) if empty else (0, 0), np.float32)
    level, area, ground = np.empty(256), np.empty(256, np.int64), np.empty(1)
    run, at = library.fly_face_gains, ctypes.c_void_p
    run.restype = ctypes.c_int64
    n = run(
        at(checked_pointer(seen, "int32", group.shape)),
        None if light is None else at(checked_pointer(light, "bool", group.shape)),
        *_of_craft(faces, patch).at,
        at(pointer(group)),
        at(pointer(centre)),
        at(pointer(core)),
        at(pointer(picture)),
        at(pointer(level)),
        at(pointer(area)),
        at(pointer(ground)),
        at(pointer(share)) if empty else None,
    )
    if n < 0:
        raise MemoryError("no memory to find the brightness of faces")
    return (group, level[:n], picture, centre, area[:n], core, share, ground) if n else NotImplemented


def _of_craft(faces: Faces, patch: ImagePatch) -> NativeStruct:
    """Arguments of ``shade`` that hang on target and patch alone, kept for the next pose."""
    of, struct = patch.kept.get("shade", (None, None))
    if of is not faces:
        (h, w), n = patch.gray.shape, len(faces.corners)
        arrays, response = (
            (contiguous(faces.labels, "uint16"), contiguous(patch.gray, "float32")),
            response_tables(patch.response),
        )
        struct = NativeStruct(
            (
                ctypes.c_void_p(checked_pointer(arrays[0], "uint16", (n + 1,))),
                ctypes.c_int64(n),
                ctypes.c_int64(faces.groups + 1),
                ctypes.c_void_p(checked_pointer(arrays[1], "float32")),
                *(ctypes.c_int64(side) for side in (h, w, patch.fine)),
                ctypes.c_double(patch.sigma),
                response.at,
            ),
            # others' responses may have taken this one's place where it is kept
            (*arrays, *response.arrays),
        )
        patch.kept["shade"] = faces, struct
    return struct


def with_background(
    library: ctypes.CDLL,
    patch: ImagePatch,
    made: Tuple[Array, ...],
    blur_px: float,
) -> Tuple[Array, Array]:
    """As ``face_gains._with_background``, of groups that a byte holds; the view that is given becomes the new one."""
    _, level, picture, centre, core, empty, shown = made
    h, w = patch.gray.shape
    gray, out = contiguous(patch.gray, "float32"), np.empty((h, w), np.float32)
    run, at = library.fly_background, ctypes.c_void_p
    run.restype = ctypes.c_int64
    done = run(
        at(checked_pointer(gray, "float32", (h, w))),
        at(checked_pointer(core, "bool", (h, w))),
        at(checked_pointer(centre, "uint8", (h, w))),
        ctypes.c_int64(h),
        ctypes.c_int64(w),
        ctypes.c_double(float(shown[0])),
        ctypes.c_double(float(level[0])),
        response_tables(patch.response).at,
        gaussian(blur_px).at,
        at(checked_pointer(empty, "float32", (h, w))),
        at(checked_pointer(out, "float32")),
        at(checked_pointer(picture, "float32", (h, w))),
    )
    if done < 0:
        raise MemoryError("no memory for the background about the craft")
    return out, picture


def unexplained(
    library: ctypes.CDLL,
    shading: Shading,
    patch: ImagePatch,
    noise: float,
    none: Array,
    blurs_px: Tuple[float, float, float],
    bound: float,
    covered: float,
) -> float:
    """As ``photometric._unexplained``, of groups that a byte holds; what holds for all poses is kept with the patch."""
    if "comparison" not in patch.kept:
        bare = none if patch.textured else None
        patch.kept["comparison"] = _comparison(patch, blurs_px, noise, bound, bare, covered)
    constants, picture, group = patch.kept["comparison"], shading.picture, shading.group
    h, w = patch.gray.shape
    picture = contiguous(picture, "float32")
    run, at = library.fly_photometric_cost, ctypes.c_void_p
    run.restype = ctypes.c_double
    out = run(
        at(checked_pointer(picture, "float32", (h, w))),
        at(checked_pointer(group, "uint8", (h * patch.fine, w * patch.fine))),
        *constants.at,
    )
    if out < 0:
        raise MemoryError("no memory to compare a drawn craft with the picture")
    return float(out)


def _comparison(
    patch: ImagePatch,
    blurs_px: Tuple[float, float, float],
    noise: float,
    bound: float,
    none: Optional[Array],
    covered: float,
) -> NativeStruct:
    """Arguments of ``unexplained`` that hang on the patch alone.

    Parameters
    ----------
    blurs_px : of the optics, the score, and what is covered. none : (h, w) deviations without the craft, which hold
        where no more than ``covered`` of a pixel is.
    """
    h, w = patch.gray.shape
    gray = contiguous(patch.blurred(blurs_px[1]), "float32")
    bare = None if none is None else contiguous(none, "float32")
    optics, score, cover = (gaussian(b) for b in blurs_px)
    response, at = response_tables(patch.response), ctypes.c_void_p
    constants = (
        *(ctypes.c_int64(side) for side in (h, w, patch.fine)),
        optics.at,
        response.at,
        at(checked_pointer(gray, "float32", (h, w))),
        score.at,
        ctypes.c_double(noise),
        ctypes.c_double(bound),
        None if bare is None else at(checked_pointer(bare, "float32", (h, w))),
        cover.at,
        ctypes.c_double(covered),
    )
    # the blurs' weights and the response's tables live as long as the patch, too
    arrays = *optics.arrays, *score.arrays, *cover.arrays, *response.arrays, gray
    return NativeStruct(constants, arrays if bare is None else (*arrays, bare))
