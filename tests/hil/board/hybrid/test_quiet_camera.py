"""A detector of 12 bits and hardly any noise: what the model does not draw is no evidence against a right pose."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.hybrid.estimator import PoseEstimator
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.hil.evaluate.pose_errors import frame_errors
from flyaround.simulator.frame import take_frame
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.render.renderer import Renderer

RECIPE = """
schema = "flyaround.recipe"
version = 1
base = "eval-black"
title = "Space by an IMX174"
[sensor]
preset = "imx174"
[sensor.auto_exposure]
level = 0.6
share = 0.95
"""
FRAMES = (7, 10, 16, 21, 22)
"""All right and none accepted while residuals were held against the noise alone."""


@pytest.mark.gl
def test_right_poses_of_a_quiet_camera_are_accepted(renderer: Renderer, tmp_path: Path) -> None:
    path = tmp_path / "quiet.toml"
    path.write_text(RECIPE)
    plan = plan_recipe(path, max(FRAMES) + 1, seed=8101)
    c = plan.camera
    camera = CameraIntrinsics(c.width_px, c.height_px, c.fx_px, c.fy_px, c.cx_px, c.cy_px)
    estimator = PoseEstimator(board_model(plan.target), camera)
    accepted, turns = 0, []
    for k in FRAMES:
        frame = take_frame(renderer, plan.scene(k), plan.target)
        assert frame.image.dtype == np.uint16
        result = estimator.estimate(frame.image)
        accepted += result.accepted
        q, t = result.q_camera_from_target_wxyz, result.t_camera_from_target_m
        assert q is not None
        assert t is not None
        scene = frame.scene
        turns.append(frame_errors(scene.q_camera_from_target_wxyz, scene.t_camera_from_target_m, q, t)[2])
    assert accepted >= 4
    assert max(turns) < 1.0
