"""Interreflection between neighbouring parts: low relief, and colour bleeding."""

from dataclasses import replace

import numpy as np
import pytest

from flyaround.simulator.scene.illumination.bands import sun_irradiance_w_m2
from flyaround.simulator.scene.illumination.irradiance import dark_field, uniform_field
from flyaround.simulator.world.frames.rotation import quat_from_matrix

pytestmark = pytest.mark.gl


def slabs(draw_kit):
    """Dark slabs, 1 mm proud of a bright plate, 1.4 mm apart: cells on a solar panel."""
    parts = [draw_kit.plate("sheet", "sheet", (0, 0, 0), 0.5)]
    top, half, pitch = -0.001, 0.0193, 0.04
    for k in range(5):
        x0, x1, y = (k - 2) * pitch - half, (k - 2) * pitch + half, 0.1
        parts += [
            draw_kit.quad(f"top{k}", "cell", [(x0, -y, top), (x0, y, top), (x1, y, top), (x1, -y, top)]),
            draw_kit.quad(f"left{k}", "cell", [(x0, -y, 0), (x0, y, 0), (x0, y, top), (x0, -y, top)]),
            draw_kit.quad(f"right{k}", "cell", [(x1, y, 0), (x1, -y, 0), (x1, -y, top), (x1, y, top)]),
        ]
    sheet = draw_kit.white(name="sheet")
    return draw_kit.target(parts, [sheet, replace(sheet, name="cell", base_color=(0.02, 0.02, 0.02))])


@pytest.mark.parametrize("sun", [(-0.5, -0.3, -0.9), (0.4, 0.5, -0.9)])
def test_gaps_between_cells_are_as_bright_from_afar_as_from_near(renderer, draw_kit, sun):
    target, size = slabs(draw_kit), 48

    def mean(times):
        camera = draw_kit.camera.__class__(
            width_px=size * times,
            height_px=size * times,
            fx_px=1450.0 * times,
            fy_px=1450.0 * times,
            cx_px=(size * times - 1) / 2,
            cy_px=(size * times - 1) / 2,
        )
        scene = draw_kit.scene(
            target, t_m=(0, 0, 6.0), rotvec_rad=(0.1, 0.2, 0.3), sun_camera=sun, camera=camera, quality="high"
        )
        image = renderer.render(scene, target).radiance
        middle = slice(size * times // 2 - 12 * times, size * times // 2 + 12 * times)
        return float(image[middle, middle].mean())

    # pixels three times as wide as a gap against pixels a third of one
    assert mean(1) == pytest.approx(mean(10), rel=0.06)


def corner(draw_kit, floor="white", wall="white"):
    """A floor and a wall of one metre that meet at a right angle, both seen from within it."""
    parts = [
        draw_kit.quad("floor", floor, [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]),
        draw_kit.quad("wall", wall, [(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)]),
    ]
    white = draw_kit.white()
    black = replace(white, name="black", base_color=(0.0, 0.0, 0.0))
    return draw_kit.target(parts, [white, black])


def wall_light(renderer, draw_kit, target, heights_m, sky=None):
    """Radiance of the wall half way along it, at some heights; under a sky instead of the Sun where one is given."""
    sun = float(sky is None)
    # the camera looks along -x from a place before the wall: image x is the target's y, down is -z
    R = np.array([[0, 1.0, 0], [0, 0, -1.0], [-1.0, 0, 0]])
    t = -R @ np.array([6.0, 0.5, 0.5])
    scene = draw_kit.scene(target, t_m=t, sun_camera=R @ np.array([0.0, 0.0, 1.0]))
    scene = replace(scene, q_camera_from_target_wxyz=quat_from_matrix(R), sun_visible_fraction=sun)
    seen = renderer.render(scene, target, sky=sky or dark_field(1)).radiance
    pixels = [draw_kit.camera.project(R @ np.array([0.0, 0.5, h]) + t) for h in heights_m]
    return np.array([seen[round(float(y)), round(float(x))] for x, y in pixels], float), scene


def test_a_wall_is_lit_by_a_sunlit_floor_as_form_factors_say(renderer, draw_kit):
    heights = np.array([0.12, 0.3, 0.6])
    lit, scene = wall_light(renderer, draw_kit, corner(draw_kit), heights)
    # every piece of the floor by itself
    x, y = np.meshgrid((np.arange(200) + 0.5) / 200, (np.arange(200) + 0.5) / 200 - 0.5)
    factor = np.array([(x * h / (np.pi * (x * x + y * y + h * h) ** 2)).sum() / x.size for h in heights])
    sun = sun_irradiance_w_m2("mono", float(np.linalg.norm(scene.r_sun_eci_m)))[0]
    # the floor returns by paint and gloss; of the wall the camera sees the paint, its gloss mirrors the empty sky
    share = (0.5 + 0.5 * (0.04 + 0.96 / 21)) * 0.5 * 0.95
    assert lit == pytest.approx(share * sun * factor / np.pi, rel=0.15)


def test_black_floor_reflects_almost_no_light_to_a_wall(renderer, draw_kit):
    white, _ = wall_light(renderer, draw_kit, corner(draw_kit), [0.2])
    black, _ = wall_light(renderer, draw_kit, corner(draw_kit, floor="black"), [0.2])
    assert black[0] < 0.2 * white[0]


def test_an_open_corner_sees_half_of_an_even_sky(renderer, draw_kit):
    target = corner(draw_kit, floor="black")
    sky = uniform_field(np.array([10.0]))
    open_wall = draw_kit.target([target.parts[1]], target.materials)
    low, _ = wall_light(renderer, draw_kit, target, [0.03], sky=sky)
    alone, _ = wall_light(renderer, draw_kit, open_wall, [0.03], sky=sky)
    assert low[0] / alone[0] == pytest.approx(0.55, abs=0.07)
