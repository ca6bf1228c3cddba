"""What every method does around its own stages: refuses unusable pictures and never raises on one."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Dict, Optional, Tuple

import numpy as np

from flyaround.hil.board.svd.decide.confidence import ACCEPT_AT, Evidence, confidence, decide
from flyaround.hil.board.svd.geometry.camera import CameraIntrinsics
from flyaround.hil.board.svd.hypotheses.ambiguity import Alternative
from flyaround.hil.board.svd.hypotheses.hypothesis import PoseFit
from flyaround.hil.board.svd.image.observation import Observation, Trace
from flyaround.hil.board.svd.model.target_model import BoardModel
from flyaround.hil.board.svd.native.library import library

Array = np.ndarray

# A frame smaller than this shows no craft [px].
SMALLEST_FRAME_PX = 64


@dataclass(frozen=True, eq=False)
class PoseResult:
    """What the estimator says of one picture.

    Parameters
    ----------
    accepted : whether the pose may be used. reason : why not, else empty.
    q_camera_from_target_wxyz, t_camera_from_target_m : best pose, ``x_camera = R(q) x_target + t``; None when
        there is none. A declined result still carries its best pose.
    confidence : 0..1. stages_ms : time of each stage in order. counts : what each stage found.
    evidence : what the decision was made from; None when no pose was found.
    covariance : (6, 6) of turn [rad] and shift [m], camera axes. alternatives : distinct poses, best first.
    method : its name.
    """

    accepted: bool
    reason: str
    q_camera_from_target_wxyz: Optional[Array]
    t_camera_from_target_m: Optional[Array]
    confidence: float
    stages_ms: Dict[str, float] = field(default_factory=dict)
    counts: Dict[str, int] = field(default_factory=dict)
    evidence: Optional[Evidence] = None
    covariance: Optional[Array] = None
    alternatives: Tuple[Alternative, ...] = ()
    method: str = ""


class Estimator:
    """A method of pose estimation; subclasses give ``method`` and ``_estimate``.

    Parameters
    ----------
    model : the target. camera : the intrinsics of every picture.

    Raises
    ------
    KernelError
        If the method needs the compiled library, which cannot be used here.
    """

    method = ""

    # Whether a frame's answer depends on the frames before it.
    keeps_state = False

    # Whether it computes with the compiled library.
    needs_library = False

    def __init__(self, model: BoardModel, camera: CameraIntrinsics) -> None:
        if self.needs_library:
            # loaded here, not while a frame waits
            library()
        self.model, self.camera = model, camera

    def estimate(
        self,
        image: Any,  # noqa: ANN401 - whatever a broken link may hand over
        trace: Optional[Trace] = None,
        t_s: Optional[float] = None,  # noqa: ARG002 - for methods that follow a target
    ) -> PoseResult:
        """The pose in ``image``, or a decline with its reason; never raises on a bad picture.

        Parameters
        ----------
        image : (H, W) uint8 or uint16, the camera's size.
        trace : receives what each stage found, for debug pictures; where it holds ``every_stage``, stages that the
            pose did not need run too.
        t_s : time of mid-exposure [s]; only a method that follows the target looks at it.
        """
        reason = unusable(image, self.camera)
        if reason:
            return PoseResult(False, reason, None, None, 0.0, method=self.method)
        frame = Observation(image, trace)
        try:
            return self._estimate(frame)
        except Exception as error:  # noqa: BLE001 - a board must go on to the next frame whatever this one held
            return self._declined(frame, f"internal: {error!r}"[:200])

    def _declined(self, frame: Observation, reason: str) -> PoseResult:
        """No pose."""
        return PoseResult(False, reason, None, None, 0.0, frame.stages_ms, frame.counts, method=self.method)

    def _estimate(self, frame: Observation) -> PoseResult:
        raise NotImplementedError


def decided(
    frame: Observation,
    pose: PoseFit,
    evidence: Evidence,
    alternatives: Tuple[Alternative, ...],
    accept_at: float = ACCEPT_AT,
    method: str = "",
) -> PoseResult:
    """A pose, and whether its evidence makes it to be accepted."""
    reason = decide(evidence, accept_at)
    frame.mark("decision")
    return PoseResult(
        not reason,
        reason,
        pose.q,
        pose.t,
        confidence(evidence),
        frame.stages_ms,
        frame.counts,
        evidence,
        pose.covariance,
        alternatives,
        method,
    )


def reconsidered(result: PoseResult, evidence: Evidence, accept_at: float = ACCEPT_AT) -> PoseResult:
    """The same pose decided anew, by more evidence."""
    reason, sure = decide(evidence, accept_at), confidence(evidence)
    return replace(result, accepted=not reason, reason=reason, confidence=sure, evidence=evidence)


def unusable(image: Any, camera: CameraIntrinsics) -> str:  # noqa: ANN401 - see Estimator.estimate
    """Why a picture cannot be used, else empty."""
    if not isinstance(image, np.ndarray) or image.size == 0:
        return "no picture"
    if image.ndim != 2:
        return "not a single-channel picture"
    if image.dtype not in (np.uint8, np.uint16):
        return f"pixels must be uint8 or uint16, not {image.dtype}"
    if image.shape != (camera.height_px, camera.width_px):
        return f"picture is {image.shape[1]} x {image.shape[0]}, the camera {camera.width_px} x {camera.height_px}"
    if min(image.shape) < SMALLEST_FRAME_PX:
        return "picture is too small"
    if int(image.max()) == int(image.min()):
        return "picture is constant"
    return ""
