"""Pose estimation in the console's estimator process: requests, answers, and cached estimators."""

from __future__ import annotations

import contextlib
import os
from dataclasses import dataclass, field
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any, Self

import cv2
import msgspec
import numpy as np

from flyaround.gui.texts import texts
from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.method_names import NETWORK
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.plugins import plugins

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.runtime.arrays import ByteArray, Quat, Vec3
    from flyaround.simulator.runtime.progress import ProgressLine
    from flyaround.simulator.scene.state import TargetRef

STAGE_QUALITY = 88  # JPEG quality of a stage's picture
KEPT_ESTIMATORS = 4
_NAMES = "its process", "its program", "the target", "a model of it", "tables", "a first pose"
STEPS = tuple(f"{name}, {k} of {len(_NAMES)}" for k, name in enumerate(_NAMES, 1))
"""Steps until a method's first estimate, as people read them."""
NICENESS = 5
"""Niceness of this process, so that window and renderer have priority."""


@dataclass(frozen=True, kw_only=True, eq=False)
class EstimateRequest:
    """Request to estimate the pose in one image.

    Parameters
    ----------
    method : str
        Name of the method.
    camera : Camera
        Camera of the image.
    target : TargetRef
        Name and hash of the craft.
    image : (H, W) or (H, W, 3) array
        Digital numbers.
    t_s : float
        Time of mid-exposure, for methods that track.
    stages : bool
        True to return pictures of the method's stages.
    """

    method: str
    camera: Camera
    target: TargetRef
    image: NDArray[np.unsignedinteger]
    t_s: float
    stages: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """The estimated pose.

    Parameters
    ----------
    accepted : bool
        True if the method accepts its pose.
    reason : str
        Reason of a decline.
    q_camera_from_target_wxyz : Quat or None
        Attitude; None without a pose.
    t_camera_from_target_m : Vec3 or None
        Position [m]; None without a pose.
    confidence : float
        The method's own confidence in the pose, 0..1.
    stages_ms : dict of str to float
        Time of each stage [ms].
    network : str, optional
        Keypoint network that took part: ``own`` (trained for this craft), ``shipped`` or ``none``; empty for methods
        that have none.
    stages : dict of str to ByteArray, optional
        Picture of each stage as a JPEG file, by its name.
    """

    accepted: bool
    reason: str
    q_camera_from_target_wxyz: Quat | None
    t_camera_from_target_m: Vec3 | None
    confidence: float
    stages_ms: dict[str, float]
    network: str = ""
    stages: dict[str, ByteArray] = field(default_factory=dict)


class EstimatorCache:
    """Cache of estimators, each created when its method, camera and craft are first requested.

    Parameters
    ----------
    progress : ProgressLine
        Line to which the steps of creating one are written.
    """

    info = "ready"

    def __init__(self, progress: ProgressLine) -> None:
        self._made = lru_cache(KEPT_ESTIMATORS)(self._make)
        self._progress = progress

    def __enter__(self) -> Self:
        with contextlib.suppress(OSError):
            os.nice(NICENESS)
        return self

    def __exit__(self, *_: object) -> None:
        self._made.cache_clear()

    def estimator(self, request: EstimateRequest) -> Any:  # noqa: ANN401 - any of them
        """Return the estimator of a request.

        Raises
        ------
        UserError
            If there is no such method.
        """
        return self._made(request.method, request.camera, request.target)

    def _make(self, method: str, camera: Camera, target_ref: TargetRef) -> Any:  # noqa: ANN401 - any of them
        self._progress.write(STEPS[1])
        from flyaround.hil.board.estimation import CameraIntrinsics  # noqa: PLC0415 - what only this process needs
        from flyaround.hil.evaluate.added_estimators import any_estimator, check_any_method  # noqa: PLC0415
        from flyaround.hil.evaluate.method_choice import MethodChoice, board_model  # noqa: PLC0415

        try:
            check_any_method(method)
            self._progress.write(STEPS[2])
            target = target_ref.drawn()
            self._progress.write(STEPS[3])
            model = board_model(target)
            self._progress.write(STEPS[4])
            lens = CameraIntrinsics.from_dict(msgspec.to_builtins(camera))
            estimator = any_estimator(model, lens, MethodChoice(method))
        except BoardModelError as error:
            raise UserError(f"the estimator cannot be made: {error}") from error
        self._progress.write(STEPS[5])
        return estimator


def estimate_picture(cache: EstimatorCache, request: EstimateRequest) -> Answer:
    """Estimate the pose in a picture, in the estimator's process."""
    from flyaround.hil.board.hybrid.debug.stage_pictures import stage_pictures  # noqa: PLC0415 - what only this process needs
    from flyaround.hil.evaluate.estimate import checked_picture  # noqa: PLC0415

    estimator = cache.estimator(request)
    image = checked_picture(request.image, request.camera, "the picture")
    trace: dict[str, Any] | None = {"every_stage": True} if request.stages else None
    result = estimator.estimate(image, trace, request.t_s)
    stages = {}
    if trace is not None:
        pictures = stage_pictures(image, trace, result, estimator.model, estimator.camera)
        stages = {name: _jpeg(picture) for name, picture in pictures.items()}
    q, t = result.q_camera_from_target_wxyz, result.t_camera_from_target_m
    return Answer(
        accepted=bool(result.accepted),
        reason=str(result.reason),
        q_camera_from_target_wxyz=None if q is None else (float(q[0]), float(q[1]), float(q[2]), float(q[3])),
        t_camera_from_target_m=None if t is None else (float(t[0]), float(t[1]), float(t[2])),
        confidence=float(result.confidence),
        stages_ms={k: float(v) for k, v in result.stages_ms.items()},
        network=_network(estimator),
        stages=stages,
    )


def _network(estimator: Any) -> str:  # noqa: ANN401 - any of them
    """Return the keypoint network that an estimator uses, as `Answer` names it."""
    # a tracker looks for the craft by another estimator
    setup: Any = getattr(getattr(estimator, "first", estimator), "setup", None)
    if not hasattr(setup, "learned"):
        return ""
    return "none" if setup.learned is None else "own" if estimator.model.network else "shipped"


def _jpeg(picture: ByteArray) -> ByteArray:
    ok, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, STAGE_QUALITY])
    if not ok:
        raise RuntimeError("a stage's picture could not be encoded")
    return np.asarray(data, np.uint8).reshape(-1)


def stage_text(name: str) -> tuple[str, str]:
    """Return title and hover text of a stage; other packages' stages have their own names."""
    title, tip = texts("stages").get(name, (name.replace("_", " ").capitalize(), ""))
    return title, tip


def method_title(method: str) -> str:
    """Return the name of a method for people; a network's is that of its file."""
    return f"network {method.removeprefix(NETWORK)}" if method.startswith(NETWORK) else method


@cache
def known_methods() -> tuple[str, ...]:
    """Return the methods that need no file: built-in ones, and those of other packages."""
    from flyaround.hil.board.method_names import METHODS  # noqa: PLC0415 - loads OpenCV, and most flights have no estimator

    return (*METHODS, *sorted(plugins("estimator")))
