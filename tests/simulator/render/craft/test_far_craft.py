"""A distant target: the radiance of a pixel is the mean of many smaller pixels."""

from dataclasses import replace

import numpy as np
import pytest

from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.targets.library import load_target

pytestmark = pytest.mark.gl
WIDTH_PX, FINER, FOCAL_PX = 32, 10, 820.0


def camera(finer):
    """The middle of a longer camera's image, on so many times as many pixels each way."""
    middle = (WIDTH_PX * finer - 1) / 2
    return Camera(
        width_px=WIDTH_PX * finer,
        height_px=WIDTH_PX * finer,
        fx_px=FOCAL_PX * finer,
        fy_px=FOCAL_PX * finer,
        cx_px=middle,
        cy_px=middle,
    )


def test_pixels_of_a_far_craft_have_the_light_of_all_their_small_faces(renderer, draw_kit):
    """Brackets, bevels and cells of a craft of 20 pixels are smaller than a pixel, and face the Sun or do not."""
    target = load_target("tango")
    fluxes, errors = [], []
    for range_m in (57.0, 56.0, 53.1, 48.0):
        scene = draw_kit.scene(
            target,
            t_m=(0.02, -0.01, range_m),
            rotvec_rad=(1.9, 0.35, 0.8),
            sun_camera=(-0.5, -0.45, -1.0),
            camera=camera(1),
        )
        seen = renderer.render(scene, target).radiance.astype(float)
        finer = renderer.render(replace(scene, camera=camera(FINER)), target).radiance.astype(float)
        truth = finer.reshape(WIDTH_PX, FINER, WIDTH_PX, FINER).mean(axis=(1, 3))
        errors.append(float(np.sqrt(np.mean((seen - truth) ** 2)) / truth[truth > 0].mean()))
        fluxes.append(float(seen.sum() / truth.sum()))
    # with four surfaces to a pixel 0.10 and four per cent
    assert np.mean(errors) < 0.07
    assert np.std(fluxes) < 0.025
