"""Distant insulation: facets smaller than a pixel add to the roughness and do not flicker."""

from dataclasses import replace

import numpy as np
import pytest

pytestmark = pytest.mark.gl


def blanket(renderer, draw_kit, focal_px, shift_m=0.0):
    """Picture of 1.6 m of crinkled foil 30 m away."""
    foil = draw_kit.white(name="foil", base_color=(0.9, 0.7, 0.3), metallic=1.0, roughness=0.35, crinkle=0.5)
    target = draw_kit.target([draw_kit.plate("sheet", "foil", (0, 0, 0), 1.0)], [foil])
    size = round(focal_px * 1.6 / 30.0)
    middle = size / 2 - 0.5
    camera = replace(
        draw_kit.camera,
        width_px=size,
        height_px=size,
        fx_px=focal_px,
        fy_px=focal_px,
        cx_px=middle,
        cy_px=middle,
    )
    scene = draw_kit.scene(target, camera=camera, t_m=(shift_m, 0, 30.0), sun_camera=(-0.3, -0.2, -1))
    return renderer.render(scene, target).radiance.astype(float)


def test_a_far_blanket_is_the_mean_of_its_facets(renderer, draw_kit):
    # 50 mm a pixel, 2 to 130 mm a facet; and each pixel's mean of 12 times 12 finer ones, few of which glint
    far, fine = blanket(renderer, draw_kit, 600.0), blanket(renderer, draw_kit, 7200.0)
    means = fine.reshape(32, 12, 32, 12).mean(axis=(1, 3))
    assert far.mean() == pytest.approx(means.mean(), rel=0.1)
    assert np.abs(far - means).mean() < 0.65 * means.mean()


def test_facets_below_a_pixel_do_not_flicker(renderer, draw_kit):
    far, moved = (blanket(renderer, draw_kit, 600.0, shift) for shift in (0.0, 0.025))  # half a pixel
    assert np.abs(moved - far).mean() < 0.45 * far.mean()
