"""Answer to one image: an estimator's result and the message made of it, whatever the estimator does."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from typing import Any, Callable, Dict, Iterable, Optional, Protocol, Tuple

from flyaround.hil.board.encoding import linear_picture
from flyaround.hil.link.clock import now_ns
from flyaround.hil.link.packets.messages import PoseMessage
from flyaround.hil.link.packets.pixels import Image

logger = logging.getLogger(__name__)

# a covariance beyond this is of an estimator that knows nothing; single precision ends at 3.4e38
LARGEST_NUMBER = 1e30


class Estimate(Protocol):
    """Result of an estimator, such as ``flyaround.hil.board.svd.PoseResult``."""

    @property
    def accepted(self) -> bool:
        """True if the estimator accepts its pose."""

    @property
    def reason(self) -> str:
        """Reason why it was accepted or declined."""

    @property
    def q_camera_from_target_wxyz(self) -> Optional[Iterable[float]]:
        """(4,) unit quaternion, or None."""

    @property
    def t_camera_from_target_m(self) -> Optional[Iterable[float]]:
        """(3,) [m], or None."""

    @property
    def confidence(self) -> float:
        """Confidence, 0 to 1."""

    @property
    def stages_ms(self) -> Dict[str, float]:
        """Duration of each stage, in order [ms]."""


class BoardEstimator(Protocol):
    """Estimator that the agent runs on each frame."""

    def estimate(self, image: Any) -> Estimate:  # noqa: ANN401 - (H, W) uint8; an estimator may take more
        """Return the pose of the target in an (H, W) image.

        One that follows the target from frame to frame has an attribute ``keeps_state`` that is true, and is given
        ``t_s``, the time of mid-exposure [s], as well. One that has an attribute ``takes_sun`` that is true is given
        ``sun_camera``, the unit vector to the Sun in the camera frame, with frames for which the host sends it.
        A result may have ``covariance``, (6, 6) of turn [rad] and shift [m] in camera axes.
        """


@dataclass(frozen=True)
class FrameContext:
    """Data of an image besides its pixels.

    Parameters
    ----------
    frame_id : int
        Its number.
    t_s : float
        Mid-exposure [s], for an estimator that follows the target.
    receive_ns : int
        The image was whole, on this machine's monotonic clock.
    start_ns : int
        The estimator began, on the same clock.
    sun_camera : (3,) tuple, optional
        Unit vector to the Sun in the camera frame, if the host sends it.
    takes_fields : bool
        True if the answer may have optional fields.
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
    """Return the answer to an image, a decline if the estimator fails.

    Parameters
    ----------
    encoding : str
        Transfer function of the image's numbers; the estimator is handed linear ones.
    """
    try:
        result = _estimate(estimator, linear_picture(image, encoding), context)
        end_ns = now_ns()
        pose = PoseMessage(
            context.frame_id,
            bool(result.accepted),
            str(result.reason),
            _numbers(result.q_camera_from_target_wxyz),
            _numbers(result.t_camera_from_target_m),
            float(result.confidence),
            tuple((name, float(ms)) for name, ms in result.stages_ms.items()),
            context.receive_ns,
            context.start_ns,
            end_ns,
            _upper_triangle(getattr(result, "covariance", None)) if context.takes_fields else None,
        )
        pose.encode()  # an accepted pose that is missing or not finite is found here
        return pose
    except Exception as error:  # noqa: BLE001 - whatever it raises, the next frame is another chance
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
    """Return the 21 numbers of a POSE's covariance; None for a covariance that is unusable."""
    if covariance is None:
        return None
    triangle = tuple(float(covariance[i][k]) for i in range(6) for k in range(i, 6))
    return triangle if all(math.isfinite(x) and abs(x) < LARGEST_NUMBER for x in triangle) else None


def _numbers(values: Any) -> Any:  # noqa: ANN401 - any sequence of numbers, or None
    return None if values is None else tuple(float(x) for x in values)
