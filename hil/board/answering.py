"""One picture's answer: what an estimator returns, and the message that it becomes, whatever the estimator does."""

from __future__ import annotations

import logging
from typing import Any, Callable, Dict, Iterable, Optional, Protocol

from flyaround.hil.link.clock import now_ns
from flyaround.hil.link.packets.messages import PoseMessage
from flyaround.hil.link.packets.pixels import Image

logger = logging.getLogger(__name__)


class Estimate(Protocol):
    """What an estimator returns; ``flyaround.hil.board.svd.PoseResult`` is one."""

    @property
    def accepted(self) -> bool:
        """Whether the estimator stands by the pose."""

    @property
    def reason(self) -> str:
        """Why it was accepted or declined."""

    @property
    def q_camera_from_target_wxyz(self) -> Optional[Iterable[float]]:
        """(4,) unit quaternion, or None."""

    @property
    def t_camera_from_target_m(self) -> Optional[Iterable[float]]:
        """(3,) [m], or None."""

    @property
    def confidence(self) -> float:
        """0 to 1."""

    @property
    def stages_ms(self) -> Dict[str, float]:
        """Duration of each stage, in order [ms]."""


class BoardEstimator(Protocol):
    """What the agent runs on each frame."""

    def estimate(self, image: Any) -> Estimate:  # noqa: ANN401 - (H, W) uint8; an estimator may take more
        """Pose of the target in an (H, W) image.

        One that follows the target from frame to frame has an attribute ``keeps_state`` that is true, and is given
        ``t_s``, the time of mid-exposure [s], as well.
        """


def estimated_pose(
    estimator: BoardEstimator, image: Image, frame_id: int, *, t_s: float, receive_ns: int, start_ns: int
) -> PoseMessage:
    """The answer to a picture; one that declines it where the estimator fails.

    Parameters
    ----------
    t_s : mid-exposure, for an estimator that follows the target.
    receive_ns, start_ns : when the picture was whole and the estimator began, on this machine's monotonic clock.
    """
    try:
        result = _look(estimator, image, t_s)
        end_ns = now_ns()
        pose = PoseMessage(
            frame_id,
            bool(result.accepted),
            str(result.reason),
            _numbers(result.q_camera_from_target_wxyz),
            _numbers(result.t_camera_from_target_m),
            float(result.confidence),
            tuple((name, float(ms)) for name, ms in result.stages_ms.items()),
            receive_ns,
            start_ns,
            end_ns,
        )
        pose.encode()  # an accepted pose that is missing or not finite is found here
        return pose
    except Exception as error:  # noqa: BLE001 - whatever it raises, the next frame is another chance
        logger.warning("frame %d: the estimator failed: %r", frame_id, error)
        return PoseMessage(
            frame_id,
            accepted=False,
            reason=f"the estimator failed: {type(error).__name__}: {error}",
            receive_ns=receive_ns,
            start_ns=start_ns,
            end_ns=now_ns(),
        )


def _look(estimator: BoardEstimator, image: Image, t_s: float) -> Estimate:
    if getattr(estimator, "keeps_state", False):
        estimate: Callable[..., Estimate] = estimator.estimate
        return estimate(image, t_s=t_s)
    return estimator.estimate(image)


def _numbers(values: Any) -> Any:  # noqa: ANN401 - any sequence of numbers, or None
    return None if values is None else tuple(float(x) for x in values)
