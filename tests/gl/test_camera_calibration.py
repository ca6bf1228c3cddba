"""OpenCV finds the simulated camera again from pictures of a board, as it would a real one."""

import numpy as np
import pytest

from simulator.recipe import plan_recipe
from simulator.validation.camera import MTF_GOAL
from simulator.validation.camera_calibration import LENSES, calibrate
from simulator.validation.camera_mtf import CASES, compare, drawn_edge

pytestmark = pytest.mark.gl


@pytest.mark.slow
@pytest.mark.parametrize("lens", LENSES)
def test_calibration_finds_every_parameter_within_three_of_its_own_sigmas(renderer, lens):
    result = calibrate(renderer, lens)
    assert result.rms_px <= 0.05
    assert result.corners >= 18 * 70
    assert np.abs(result.deviation).max() <= 3


def test_a_drawn_slanted_edge_has_the_psf_s_transfer_function(renderer):
    edge = drawn_edge(renderer)
    for case in CASES:
        found, ideal, used = compare(case, edge)
        assert np.abs(found - ideal).max() <= MTF_GOAL, case
        assert np.abs(found - used).max() <= MTF_GOAL / 2, case


@pytest.mark.parametrize("recipe", ["calibration", "calibration-chessboard"])
def test_boards_go_all_over_the_image_whole_and_tilted(recipe):
    for camera in (LENSES["pinhole"], LENSES["kannala_brandt"]):
        plan = plan_recipe(recipe, 9, seed=2)
        plan = type(plan)(**{**vars(plan), "camera": camera})
        points = np.concatenate([p.positions_m for p in plan.target.parts]).astype(float)
        centres, tilts = [], []
        for k in range(0, 9, 2):
            scene = plan.scene(k)
            pixels = camera.project(scene.camera_from_target.apply(points))
            assert camera.contains(pixels).all()
            centres.append(pixels.mean(axis=0) / [camera.width_px, camera.height_px])
            ray = np.array(scene.t_camera_from_target_m)
            tilts.append(np.degrees(np.arccos(-scene.camera_from_target.R[:, 2] @ ray / np.linalg.norm(ray))))
        assert np.ptp(centres, axis=0).min() > 0.15
        assert np.max(tilts) > 20
        assert np.max(tilts) <= 46
