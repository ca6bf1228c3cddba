"""OpenCV finds the simulated camera again from pictures of a board, as it would a real one."""

from dataclasses import replace

import cv2
import msgspec
import numpy as np
import pytest

from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.scene.environments import NOTHING
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.frames.rotation import matrix_from_quat, quat_from_matrix
from tools.validation.bare_scene import bare_scene, square_camera
from tools.validation.camera.calibration import LENSES, calibrate
from tools.validation.camera.mtf import CASES, compare, drawn_edge
from tools.validation.camera.report import MTF_GOAL

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


@pytest.mark.slow
def test_a_flat_board_sees_the_whole_sky_and_is_evenly_lit_by_it(renderer):
    board, distance_m = load_target("chessboard"), 20.0
    camera = square_camera(160, 160 * distance_m / 0.7)
    scene = bare_scene(board, camera, (0, 0, distance_m), (np.pi, 0, 0), sunlit=False, quality="high")
    # the camera looks up, so that the board looks down on the sunlit Earth
    R = np.diag([1.0, -1.0, -1.0]) @ matrix_from_quat(scene.q_camera_from_eci_wxyz)
    scene = replace(
        scene,
        q_camera_from_eci_wxyz=tuple(quat_from_matrix(R)),
        r_target_eci_m=tuple(np.array(scene.r_camera_eci_m) + R.T @ [0, 0, distance_m]),
        environment=msgspec.structs.replace(NOTHING, earthshine=True),
    )
    light = renderer.render(scene, board).radiance
    white = cv2.erode((light > 0.5 * light.max()).astype(np.uint8), np.ones((5, 5))) > 0
    assert white.sum() > 3000
    assert light[white].std() < 1e-3 * light[white].mean()


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
