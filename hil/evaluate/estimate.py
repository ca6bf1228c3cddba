"""Pose estimation on one image, from a file or an array, with camera and target by name or as objects."""

from __future__ import annotations

import functools
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.method_names import HYBRID
from flyaround.hil.evaluate.added_estimators import any_estimator
from flyaround.hil.evaluate.greyscale import grey
from flyaround.hil.evaluate.method_choice import MethodChoice, board_model
from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.dataset.formats.native import read_png
from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.targets.model import Target

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from flyaround.hil.board.estimation import Estimator, PoseResult

_MAX_IN_USE = 4  # cached estimators per process: each takes seconds to make and tens of megabytes


def estimate(
    image: NDArray[np.unsignedinteger] | str | Path,
    camera: Camera | str | Path,
    target: Target | str | Path = "tango",
    *,
    method: str = HYBRID,
    sun_camera: Sequence[float] | None = None,
) -> PoseResult:
    """Return the pose of a target in one image, as `flyaround estimate` does.

    The first call for a target and a camera prepares an estimator, which takes seconds; it is cached.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) array, str or Path
        Image of the camera's size, uint8 or uint16, or its file. Colour is converted to grey.
    camera : Camera, str or Path
        Camera of the image: an object, the name of a built-in camera, or a file.
    target : Target, str or Path, optional
        Target in the image: an object, a name from `list_targets`, or a target file.
    method : str, optional
        ``hybrid``, or another of ``flyaround.hil.board.method_names.ALL_METHODS``; ``net:FILE`` is a network from
        `flyaround train`.
    sun_camera : sequence of float, optional
        Unit vector to the Sun in the camera frame, as ``sun_direction_camera`` of a truth record. If it is None,
        ``hybrid`` estimates it; other methods ignore it.

    Returns
    -------
    PoseResult
        ``accepted``, ``reason`` for a decline, ``q_camera_from_target_wxyz``, ``t_camera_from_target_m`` [m],
        ``confidence``, ``covariance``, ``stages_ms``. A declined result still carries its best pose, if any.

    Raises
    ------
    UserError
        If the image cannot be read or does not have the camera's size, a name is unknown, or ``sun_camera`` is not a
        unit vector.
    """
    # a thousandth admits four printed digits
    if sun_camera is not None and (len(sun_camera) != 3 or not abs(np.linalg.norm(sun_camera) - 1) <= 1e-3):
        raise UserError(
            f"sun_camera {tuple(sun_camera)} is not a unit vector: give three numbers of length 1"
        )
    craft = target if isinstance(target, Target) else load_target(target)
    intrinsics = camera if isinstance(camera, Camera) else load_camera(camera)
    source = "the picture" if isinstance(image, np.ndarray) else str(image)
    pixels = image if isinstance(image, np.ndarray) else read_png(Path(image))
    checked = checked_picture(pixels, intrinsics, source)
    # an estimator that keeps state between images is not cached
    find = _make_estimator if MethodChoice(method).in_order else _cached_estimator
    estimator = find(_Craft(craft.name, craft.sha256, craft), intrinsics, method)
    return estimator.estimate(checked, sun_camera=sun_camera)


def checked_picture(
    image: NDArray[np.unsignedinteger], camera: Camera, source: str
) -> NDArray[np.unsignedinteger]:
    """Check an image and convert it to linear grey, as the estimators expect it.

    Returns
    -------
    (H, W) array
        Image of the same type; the given one if it is grey and linear already.

    Raises
    ------
    UserError
        If its pixels are not uint8 or uint16, or its size is not the camera's; ``source`` names it in the message.
    """
    if image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] != 3):
        raise UserError(
            f"{source} is an array of shape {image.shape}: give (height, width), or with 3 channels"
        )
    if image.dtype not in (np.uint8, np.uint16):
        raise UserError(f"{source} holds {image.dtype} pixels: give uint8 or uint16")
    if camera.pixel_encoding != "linear" and image.dtype != np.uint8:
        raise UserError(
            f"{source} has 16 bits, but the camera's encoding {camera.pixel_encoding} has 8: "
            "give 8-bit pixels, or a camera with encoding linear"
        )
    if image.shape[:2] != (camera.height_px, camera.width_px):
        raise UserError(
            f"{source} is {image.shape[1]} x {image.shape[0]} pixels, the camera {camera.width_px} x "
            f"{camera.height_px}: give the camera that took it (--camera)"
        )
    return grey(image, camera.pixel_encoding)


@dataclass(frozen=True)
class _Craft:
    """Target as a cache key: targets of equal name and hash are equal."""

    name: str
    sha256: str
    target: Target = field(compare=False)


def _make_estimator(craft: _Craft, camera: Camera, method: str) -> Estimator:
    try:
        intrinsics = CameraIntrinsics.from_dict(msgspec.to_builtins(camera))
        return any_estimator(board_model(craft.target), intrinsics, MethodChoice(method))
    except BoardModelError as error:
        raise UserError(str(error)) from error


@functools.lru_cache(maxsize=_MAX_IN_USE)
def _cached_estimator(craft: _Craft, camera: Camera, method: str) -> Estimator:
    return _make_estimator(craft, camera, method)
