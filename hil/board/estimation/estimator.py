"""Base class of the estimators: rejects unusable images and never raises because of an image."""

from __future__ import annotations

from typing import Any, Optional, Sequence

import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.record import StageRecord, Trace
from flyaround.hil.board.estimation.result import PoseResult
from flyaround.hil.board.estimation.target_model import BoardModel

# Smallest side of an image that is searched [px]. Smaller ones hold too few edges.
MIN_SIDE_PX = 64


class Estimator:
    """Pose estimation method; subclasses define ``method`` and ``_estimate``.

    Parameters
    ----------
    model : BoardModel
        Model of the target.
    camera : CameraIntrinsics
        Intrinsics of every image.
    """

    method = ""

    # True if the answer depends on earlier frames.
    keeps_state = False

    # True if the method uses the direction to the Sun.
    takes_sun = False

    def __init__(self, model: BoardModel, camera: CameraIntrinsics) -> None:
        self.model, self.camera = model, camera

    def estimate(
        self,
        image: Any,  # noqa: ANN401 - unvalidated: a faulty link may deliver anything
        trace: Optional[Trace] = None,
        t_s: Optional[float] = None,  # noqa: ARG002 - used by tracking methods
        sun_camera: Optional[Sequence[float]] = None,
    ) -> PoseResult:
        """Return the pose in ``image``, or a decline with its reason; never raises on a bad image.

        Parameters
        ----------
        image : object
            Image (H, W), uint8 or uint16, of the camera's size.
        trace : Trace, optional
            Receives the intermediate results of each stage, for debug images. If it holds ``every_stage``, stages that
            the pose does not need run as well.
        t_s : float, optional
            Time of mid-exposure [s]; used by tracking methods.
        sun_camera : sequence of float, optional
            Unit vector to the Sun in the camera frame; None if it is unknown.

        Returns
        -------
        PoseResult
            Pose in the camera frame [m], decision, reason and times [ms].
        """
        reason = unusable(image, self.camera)
        if reason:
            return PoseResult(False, reason, None, None, 0.0, method=self.method)
        frame = StageRecord(image, trace, None if sun_camera is None else np.array(sun_camera, float))
        try:
            return self._estimate(frame)
        except Exception as error:  # noqa: BLE001 - the board must go on to the next frame, whatever this image caused
            return self._declined(frame, f"internal: {error!r}"[:200])

    def _declined(self, frame: StageRecord, reason: str) -> PoseResult:
        """Return a result without a pose."""
        return PoseResult(False, reason, None, None, 0.0, frame.stages_ms, frame.counts, method=self.method)

    def _estimate(self, frame: StageRecord) -> PoseResult:
        raise NotImplementedError


def unusable(image: Any, camera: CameraIntrinsics) -> str:  # noqa: ANN401 - see Estimator.estimate
    """Return the reason why an image cannot be used; empty if it can."""
    if not isinstance(image, np.ndarray) or image.size == 0:
        return "no picture"
    if image.ndim != 2:
        return "not a single-channel picture"
    if image.dtype not in (np.uint8, np.uint16):
        return f"pixels must be uint8 or uint16, not {image.dtype}"
    if image.shape != (camera.height_px, camera.width_px):
        return f"picture is {image.shape[1]} x {image.shape[0]}, the camera {camera.width_px} x {camera.height_px}"
    if min(image.shape) < MIN_SIDE_PX:
        return "picture is too small"
    if int(image.max()) == int(image.min()):
        return "picture is constant"
    return ""
