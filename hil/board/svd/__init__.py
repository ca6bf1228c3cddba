"""The Sharma-Ventura-D'Amico pose estimator. numpy and OpenCV only, Python >= 3.9."""

from __future__ import annotations

from hil.board.svd.estimator import METHODS, PoseEstimator
from hil.board.svd.frame import PoseResult
from hil.board.svd.model import BoardModel, BoardModelError, CameraIntrinsics

__all__ = ["METHODS", "BoardModel", "BoardModelError", "CameraIntrinsics", "PoseEstimator", "PoseResult"]
