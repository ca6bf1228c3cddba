"""Light between neighbouring parts: low relief, and the colour of what parts give each other."""

from dataclasses import replace

import pytest

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


def test_parts_give_each_other_the_light_of_what_they_see_of_each_other(renderer, draw_kit):
    floor = draw_kit.quad("floor", "dark", [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    wall = draw_kit.quad("wall", "dark", [(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)])
    outside = draw_kit.quad("back", "bright", [(0, 0, -0.1), (0, 1, -0.1), (1, 1, -0.1), (1, 0, -0.1)])
    dark = draw_kit.white(name="dark", base_color=(0.1, 0.1, 0.1))
    target = draw_kit.target(
        [floor, wall, outside], [dark, replace(dark, name="bright", base_color=(0.9, 0.9, 0.9))]
    )
    # into the corner the dark walls shine, never the bright back
    color = renderer._target_passes()._load(target).bounce_color
    assert color == pytest.approx([0.1] * 3, abs=0.04)
