"""Common parts of all estimators: camera, target model, quaternions, stage record and result.

Needs numpy only, Python >= 3.9, and imports none of the methods.
"""

from __future__ import annotations

from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.estimator import Estimator
from flyaround.hil.board.estimation.result import Alternative, PoseResult
from flyaround.hil.board.estimation.target_model import BoardModel

__all__ = [
    "Alternative",
    "BoardModel",
    "BoardModelError",
    "CameraIntrinsics",
    "Estimator",
    "PoseResult",
]
