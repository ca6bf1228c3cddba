"""Pose by a network that sees the whole image: position and range regressed, attitude classified.

References
----------
Proenca & Gao (2020), Deep learning for spacecraft pose estimation from photorealistic rendering, ICRA.
"""

from __future__ import annotations

import logging
from typing import Tuple

import numpy as np

from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.estimator import Estimator
from flyaround.hil.board.estimation.record import StageRecord
from flyaround.hil.board.estimation.result import PoseResult
from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.estimation.vectors import swing
from flyaround.hil.board.net.attitude_classes import mean_attitude, softmax
from flyaround.hil.board.net.network_camera import PictureReducer, standardise
from flyaround.hil.board.net.network_file import NetworkFile

Array = np.ndarray

logger = logging.getLogger(__name__)

# Minimum probability of the best neighbourhood of attitudes at which a pose is accepted. A higher one declines more
# right poses, a lower one accepts more wrong ones.
MIN_PROBABILITY = 0.5

# Bound of the standardised logarithm of the range.
MAX_LOG_RANGE = 7.0


class NetworkEstimator(Estimator):
    """Estimator that evaluates a trained network on each image.

    Parameters
    ----------
    network : NetworkFile
        Trained network.
    model : BoardModel
        Model of the target.
    camera : CameraIntrinsics
        Intrinsics of every image.

    Raises
    ------
    BoardModelError
        If the network was trained on another target.
    """

    def __init__(self, network: NetworkFile, model: BoardModel, camera: CameraIntrinsics) -> None:
        super().__init__(model, camera)
        if _craft(model.name) != _craft(network.target):
            raise BoardModelError(
                f"network {network.name} was trained on {network.target}, but the target is {model.name}: "
                "name another network or target"
            )
        if model.sha256 != network.sha256:
            logger.info("network %s was trained on another version of %s", network.name, model.name)
        self.method = f"net:{network.name}"
        self.network = network
        self._reduce = PictureReducer.prepare(network.camera, camera)

    def _estimate(self, frame: StageRecord) -> PoseResult:
        picture = standardise(self._reduce(frame.image))
        frame.mark("reduce")
        position_output, attitude = self.network.run(picture)
        frame.mark("network")
        if not (np.isfinite(position_output).all() and np.isfinite(attitude).all()):
            return self._declined(frame, "the network's answer is not finite")
        t, direction = position_from_output(position_output, self.network)
        probability = softmax(attitude)
        relative, confidence = mean_attitude(probability)
        q = quat.normalise(quat.multiply(quat.from_matrix(swing(direction)), relative))
        frame.keep("attitude shares", probability)
        frame.mark("pose")
        reason = "" if confidence >= MIN_PROBABILITY else "several attitudes are equally likely"
        times, counts, covariance = frame.stages_ms, frame.counts, self._covariance(t)
        return PoseResult(
            not reason, reason, q, t, confidence, times, counts, covariance=covariance, method=self.method
        )

    def _covariance(self, t: Array) -> Array:
        """Return the covariance (6, 6) of rotation [rad] and translation [m], camera axes, from the held-out errors."""
        e, range_m = self.network.errors, float(np.linalg.norm(t))
        across, along = (e.across_share * range_m) ** 2, (e.along_share * range_m) ** 2
        return np.diag([e.turn_rad**2] * 3 + [across, across, along])


def position_from_output(output: Array, network: NetworkFile) -> Tuple[Array, Array]:
    """Return the position (3,) of the model's origin in the camera frame [m], and the unit vector to it.

    Parameters
    ----------
    output : (3,) array
        Position output of the network: x/z and y/z in half fields of view, and the standardised logarithm of the range.
    network : NetworkFile
        Trained network.
    """
    ray = np.append(output[:2] * network.camera.half_view, 1.0)
    direction = ray / np.linalg.norm(ray)
    log_range = network.log_range_mean + network.log_range_scale * float(
        np.clip(output[2], -MAX_LOG_RANGE, MAX_LOG_RANGE)
    )
    return np.exp(log_range) * direction, direction


def _craft(name: str) -> str:
    """Return a target's name without its level of detail."""
    return name.split("@", maxsplit=1)[0]
