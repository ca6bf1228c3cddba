"""Derivatives of the synthetic view and the normal equations of a Gauss-Newton step, in C."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Tuple

import numpy as np

from flyaround.hil.board.svd.native.arrays import checked_pointer, contiguous, pointer
from flyaround.hil.board.svd.native.photometric.image_formation import NativeStruct, gaussian, response_tables

if TYPE_CHECKING:
    from flyaround.hil.board.svd.geometry.camera import CameraIntrinsics
    from flyaround.hil.board.svd.geometry.faces import Faces
    from flyaround.hil.board.svd.geometry.image_patch import ImagePatch
    from flyaround.hil.board.svd.geometry.shading import Shading

Array = np.ndarray

# Most groups with a brightness of their own (coverage.h), and a matrix with room for them.
MOST, ROOM = 63, (63 + 7) ** 2

# C returns two counts in one number, the second times this.
PACK = 1000


class _PoseMotion(ctypes.Structure):
    """image_jacobian.h: struct pose_motion."""

    _fields_ = [
        *((name, ctypes.c_void_p) for name in ("seen", "level", "behind", "normal", "offset")),
        ("faces", ctypes.c_int64),
        *((name, ctypes.c_void_p) for name in ("R", "t")),
        *((name, ctypes.c_double) for name in ("u", "v", "step_u", "step_v")),
    ]


def _pose_motion(
    shading: Shading, faces: Faces, patch: ImagePatch, camera: CameraIntrinsics, R: Array, t: Array
) -> NativeStruct:
    h, w = patch.gray.shape
    level = np.zeros(256)
    level[: len(shading.level)] = shading.level
    behind = None if shading.behind is None else contiguous(shading.behind, "float32")
    seen, R, t = contiguous(shading.seen, "int32"), contiguous(R, "float64"), contiguous(t, "float64")
    planes, rays = _of_craft(faces, patch, camera)
    struct = _PoseMotion(
        checked_pointer(seen, "int32", (h * patch.fine, w * patch.fine)),
        pointer(level),
        None if behind is None else checked_pointer(behind, "float32", (h, w)),
        *planes.at,
        checked_pointer(R, "float64", (3, 3)),
        checked_pointer(t, "float64", (3,)),
        *rays,
    )
    kept = (seen, level, R, t, *planes.arrays)
    return NativeStruct(ctypes.byref(struct), kept if behind is None else (*kept, behind))


def _of_craft(
    faces: Faces, patch: ImagePatch, camera: CameraIntrinsics
) -> Tuple[NativeStruct, Tuple[float, float, float, float]]:
    """Planes of a craft and rays of a patch as ``struct pose_motion`` has them, kept for the next pose."""
    of, constants = patch.kept.get("moving", ((None, None), None))
    if of[0] is not faces or of[1] is not camera:
        n, (across, down) = len(faces.corners), patch.scale
        arrays = contiguous(faces.normals, "float64"), contiguous(faces.offset, "float64")
        planes = checked_pointer(arrays[0], "float64", (n, 3)), checked_pointer(arrays[1], "float64", (n,)), n
        constants = (
            NativeStruct(planes, arrays),
            # as ``ImagePatch.rays``
            (
                (0.5 / across - 0.5 + patch.x0 - camera.cx_px) / camera.fx_px,
                (0.5 / down - 0.5 + patch.y0 - camera.cy_px) / camera.fy_px,
                1.0 / (across * camera.fx_px),
                1.0 / (down * camera.fy_px),
            ),
        )
        patch.kept["moving"] = (faces, camera), constants
    return constants


def motion_images(
    library: ctypes.CDLL,
    shading: Shading,
    faces: Faces,
    patch: ImagePatch,
    camera: CameraIntrinsics,
    R: Array,
    t: Array,
) -> Array:
    """As ``motion_images.motion_images``, of groups that a byte holds."""
    (h, w), f = patch.gray.shape, patch.fine
    out = np.empty((6, h, w), np.float32)
    moving = _pose_motion(shading, faces, patch, camera, R, t)
    run = library.fly_image_jacobian
    run.restype = ctypes.c_int64
    done = run(
        moving.at,
        ctypes.c_void_p(checked_pointer(shading.group, "uint8", (h * f, w * f))),
        ctypes.c_int64(h),
        ctypes.c_int64(w),
        ctypes.c_int64(f),
        ctypes.c_void_p(checked_pointer(out, "float32")),
    )
    if done < 0:
        raise MemoryError("no memory for the derivatives of a picture")
    return out


def normal_products(
    library: ctypes.CDLL,
    shading: Shading,
    faces: Faces,
    patch: ImagePatch,
    camera: CameraIntrinsics,
    R: Array,
    t: Array,
    blurs_px: Tuple[float, float, float],
    noise: float,
    slack: float,
    tukey: float,
    most: int,
) -> Tuple[Array, float, int]:
    """As ``photometric._gram``: products (K + 7, K + 7) of its weighted rows.

    Parameters
    ----------
    blurs_px : of the optics, of this step, and of both. noise : of the picture blurred so. slack : squared distance
        that borders may still be off [px^2]. tukey : squared bound in units of a residual's deviation. most : groups
        whose brightness is found.

    Returns
    -------
    The products, the sum of weights, and how many pixels count.
    """
    (h, w), f = patch.gray.shape, patch.fine
    out, total = np.empty(ROOM), np.zeros(1)
    gray, picture = contiguous(patch.blurred(blurs_px[1]), "float32"), contiguous(shading.picture, "float32")
    moving = _pose_motion(shading, faces, patch, camera, R, t)
    run, at = library.fly_normal_equations, ctypes.c_void_p
    run.restype = ctypes.c_int64
    packed = run(
        moving.at,
        at(checked_pointer(shading.group, "uint8", (h * f, w * f))),
        at(checked_pointer(shading.centre, "uint8", (h, w))),
        at(checked_pointer(picture, "float32", (h, w))),
        at(checked_pointer(gray, "float32", (h, w))),
        ctypes.c_int64(h),
        ctypes.c_int64(w),
        ctypes.c_int64(f),
        response_tables(patch.response).at,
        *(gaussian(b).at for b in blurs_px),
        ctypes.c_double(noise),
        ctypes.c_double(slack),
        ctypes.c_double(tukey),
        ctypes.c_int64(min(most, MOST - 1)),
        at(pointer(out)),
        at(pointer(total)),
    )
    if packed < 0:
        raise MemoryError("no memory for a step's normal equations")
    k, rows = packed % PACK + 7, packed // PACK
    return out[: k * k].reshape(k, k), float(total[0]), int(rows)
