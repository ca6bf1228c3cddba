"""Answer to one image: the estimator's result as a POSE message, or a decline if the estimator raises."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Any, Callable, Dict, Iterable, Optional, Protocol, Tuple

import numpy as np

from flyaround.hil.board.encoding import linear_picture
from flyaround.hil.link.clock import now_ns
from flyaround.hil.link.packets.messages import PoseMessage
from flyaround.hil.link.packets.pixels import Image

logger = logging.getLogger(__name__)

# Largest covariance element that is sent. Larger ones carry no information, and single precision overflows at 3.4e38.
MAX_COVARIANCE = 1e30


class Estimate(Protocol):
    """Protocol of an estimator's result, such as ``flyaround.hil.board.svd.PoseResult``."""

    @property
    def accepted(self) -> bool:
        """True if the estimator accepts its pose."""

    @property
    def reason(self) -> str:
        """Reason for the decision; empty if there is nothing to report."""

    @property
    def q_camera_from_target_wxyz(self) -> Optional[Iterable[float]]:
        """Unit quaternion (4,), scalar first, camera from target; None without a pose."""

    @property
    def t_camera_from_target_m(self) -> Optional[Iterable[float]]:
        """Target position (3,) in the camera frame [m]; None without a pose."""

    @property
    def confidence(self) -> float:
        """Confidence, 0 to 1."""

    @property
    def stages_ms(self) -> Dict[str, float]:
        """Duration of each stage, in order [ms]."""


class BoardEstimator(Protocol):
    """Protocol of an estimator that the agent runs on each frame."""

    def estimate(self, image: Any) -> Estimate:  # noqa: ANN401 - (H, W) uint8; an estimator may take more
        """Return the pose of the target in an (H, W) image.

        An estimator with a true attribute ``keeps_state`` tracks the target across frames; it also receives ``t_s``,
        the time of mid-exposure [s]. One with a true attribute ``takes_sun`` also receives ``sun_camera``, the unit
        vector to the Sun in the camera frame, if the host sends it. A result may have an attribute ``covariance``,
        (6, 6), of the rotation [rad] and translation [m] errors in camera axes.

        Returns
        -------
        Estimate
            Pose of the target in the camera frame, or the reason why there is none.
        """


@dataclass(frozen=True)
class FrameContext:
    """Metadata of an image.

    Parameters
    ----------
    frame_id : int
        Identifier of the frame.
    t_s : float
        Time of mid-exposure [s], for an estimator that tracks the target.
    receive_ns : int
        Time at which the image was complete, monotonic clock [ns].
    start_ns : int
        Time at which the estimator started, same clock [ns].
    sun_camera : (3,) tuple, optional
        Unit vector to the Sun in the camera frame, if the host sends it.
    takes_fields : bool
        True if the host accepts optional fields in the answer.
    """

    frame_id: int
    t_s: float
    receive_ns: int
    start_ns: int
    sun_camera: Optional[Tuple[float, float, float]] = None
    takes_fields: bool = False


def estimated_pose(
    estimator: BoardEstimator, image: Image, context: FrameContext, encoding: str = "linear"
) -> PoseMessage:
    """Return the answer to an image, a decline if the estimator raises or its result cannot be sent.

    Parameters
    ----------
    estimator : BoardEstimator
        Estimator to call.
    image : array
        Image, as received.
    context : FrameContext
        Time, camera and other properties of the image.
    encoding : str
        Transfer function of the pixels; the estimator receives linear ones.
    """
    try:
        result = _estimate(estimator, linear_picture(image, encoding), context)
        end_ns = now_ns()
        pose = PoseMessage(
            context.frame_id,
            bool(result.accepted),
            str(result.reason),
            _numbers(result.q_camera_from_target_wxyz, 4, "quaternion"),
            _numbers(result.t_camera_from_target_m, 3, "position"),
            float(result.confidence),
            tuple((name, float(ms)) for name, ms in result.stages_ms.items()),
            context.receive_ns,
            context.start_ns,
            end_ns,
            _upper_triangle(getattr(result, "covariance", None)) if context.takes_fields else None,
        )
        pose.encode()  # raises if an accepted pose is missing or not finite
        return pose
    except Exception as error:  # noqa: BLE001 - an estimator may raise anything; the next frame is served anyway
        logger.warning("frame %d: the estimator failed: %r", context.frame_id, error)
        return PoseMessage(
            context.frame_id,
            accepted=False,
            reason=f"the estimator failed: {type(error).__name__}: {error}",
            receive_ns=context.receive_ns,
            start_ns=context.start_ns,
            end_ns=now_ns(),
        )


def _estimate(estimator: BoardEstimator, image: Image, context: FrameContext) -> Estimate:
    estimate: Callable[..., Estimate] = estimator.estimate
    optional: Dict[str, Any] = {}
    if getattr(estimator, "keeps_state", False):
        optional["t_s"] = context.t_s
    if context.sun_camera is not None and getattr(estimator, "takes_sun", False):
        optional["sun_camera"] = context.sun_camera
    return estimate(image, **optional)


def _upper_triangle(covariance: Any) -> Optional[Tuple[float, ...]]:  # noqa: ANN401 - (6, 6) numbers, or None
    """Return the 21 elements of the upper triangle; None if there is no covariance, or one that cannot be sent."""
    if covariance is None:
        return None
    triangle = _array(covariance, (6, 6), "covariance")[np.triu_indices(6)]
    return tuple(triangle.tolist()) if np.all(np.abs(triangle) < MAX_COVARIANCE) else None


def _numbers(values: Any, count: int, name: str) -> Any:  # noqa: ANN401 - a tuple of ``count`` numbers, or None
    # OpenCV's translations are columns
    return None if values is None else tuple(_array(np.ravel(values), (count,), name).tolist())


def _array(values: Any, shape: Tuple[int, ...], name: str) -> np.ndarray:  # noqa: ANN401 - any sequence of numbers
    """Return an estimator's numbers as an array; raise ValueError if their shape is another."""
    array = np.asarray(values, float)
    if array.shape != shape:
        raise ValueError(f"the {name} has shape {array.shape}, not {shape}")
    return array
