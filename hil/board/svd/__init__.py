"""The Sharma-Ventura-D'Amico pose estimator. numpy and OpenCV only, Python >= 3.9."""

from __future__ import annotations

from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.svd.base import Estimator, PoseResult
from flyaround.hil.board.svd.estimator import PoseEstimator
from flyaround.hil.board.svd.geometry.camera import CameraIntrinsics
from flyaround.hil.board.svd.hypotheses.ambiguity import Alternative
from flyaround.hil.board.svd.methods import METHODS, make_estimator
from flyaround.hil.board.svd.model.target_model import BoardModel

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
