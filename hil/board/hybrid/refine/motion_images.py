"""Derivative of the synthetic view with respect to the pose, non-zero at borders between groups of faces."""

from __future__ import annotations

import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.faces import Faces
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.geometry.shading import Shading
from flyaround.hil.board.hybrid.native.interface import STRUCTURES, Structure, contiguous
from flyaround.hil.board.hybrid.native.library import library

Array = np.ndarray


def motion_images(
    shading: Shading, faces: Faces, patch: ImagePatch, camera: CameraIntrinsics, R: Array, t: Array
) -> Array:
    """Return the derivative (6, h, w) of the synthetic view by rotation about the target's origin and translation.

    Camera axes, float32. The border between two groups moves with the nearer face.

    Parameters
    ----------
    shading : Shading
        Synthetic view.
    faces : Faces
        Faces of the target.
    patch : ImagePatch
        Patch of the view.
    camera : CameraIntrinsics
        Pinhole camera (see ``ImagePatch.rays``).
    R : (3, 3) array
        Attitude, camera from target.
    t : (3,) array
        Position of the target, camera axes [m].

    Raises
    ------
    MemoryError
        If the library is out of memory.
    """
    (h, w), f = patch.gray.shape, patch.fine
    out = np.empty((6, h, w), np.float32)
    moving = pose_motion(shading, faces, patch, camera, R, t)
    group = contiguous(shading.group, "uint8", (h * f, w * f))
    if library().fly_image_jacobian(moving, group, h, w, f, out) < 0:
        raise MemoryError("no memory for the derivatives of a picture")
    return out


def pose_motion(
    shading: Shading, faces: Faces, patch: ImagePatch, camera: CameraIntrinsics, R: Array, t: Array
) -> Structure:
    """Return a synthetic view and its pose in the layout of the native library; parameters as in ``motion_images``."""
    (h, w), f, n, (across, down) = patch.gray.shape, patch.fine, len(faces.corners), patch.scale
    level = np.zeros(256)
    level[: len(shading.level)] = shading.level
    return STRUCTURES["pose_motion"](
        seen=contiguous(shading.visible_face, "int32", (h * f, w * f)),
        level=level,
        behind=None
        if shading.background_offset is None
        else contiguous(shading.background_offset, "float32", (h, w)),
        normal=contiguous(faces.normals, "float64", (n, 3)),
        offset=contiguous(faces.offset, "float64", (n,)),
        faces=n,
        R=contiguous(R, "float64", (3, 3)),
        t=contiguous(t, "float64", (3,)),
        # same coordinates as ``ImagePatch.rays``
        u=(0.5 / across - 0.5 + patch.x0 - camera.cx_px) / camera.fx_px,
        v=(0.5 / down - 0.5 + patch.y0 - camera.cy_px) / camera.fy_px,
        step_u=1.0 / (across * camera.fx_px),
        step_v=1.0 / (down * camera.fy_px),
    )
