"""The Sharma-Ventura-D'Amico pose estimator. numpy and OpenCV only, Python >= 3.9."""

from __future__ import annotations

from hil.board.errors import BoardModelError
from hil.board.svd.base import Estimator, PoseResult
from hil.board.svd.estimator import PoseEstimator
from hil.board.svd.geometry.camera import CameraIntrinsics
from hil.board.svd.hypotheses.ambiguity import Alternative
from hil.board.svd.methods import METHODS, make_estimator
from hil.board.svd.model.target_model import BoardModel

__all__ = [
    "METHODS",
    "Alternative",
    "BoardModel",
    "BoardModelError",
    "CameraIntrinsics",
    "Estimator",
    "PoseEstimator",
    "PoseResult",
    "make_estimator",
]
