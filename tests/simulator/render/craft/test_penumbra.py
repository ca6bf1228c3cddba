"""Width of penumbrae against the angular size of the Sun, within the reach of the shadow filter."""

from dataclasses import replace

import numpy as np
import pytest

from flyaround.simulator.targets.model import Material

pytestmark = pytest.mark.gl
SUN_RADIUS_RAD = 0.00465
BLACK = Material(name="black", base_color=(0.0, 0.0, 0.0), roughness=1.0)


def spread_m(renderer, draw_kit, height_m):
    """Standard deviation of a shadow's edge along a wall, of a plate so high above it; the Sun stands at 45 degrees."""
    parts = [
        draw_kit.plate("wall", "white", (0, 0, 0), 0.2),
        draw_kit.plate("plate", "black", (-height_m - 0.1, 0, -height_m), 0.1),
    ]
    target = draw_kit.target(parts, [draw_kit.white(), BLACK])
    camera = replace(draw_kit.camera, fx_px=4000.0, fy_px=4000.0)
    scene = draw_kit.scene(target, camera=camera, t_m=(0, 0, 2.6), sun_camera=(-1, 0, -1), quality="high")
    rows = renderer.render(scene, target).radiance.astype(float)[100:136, 100:222].mean(axis=0)
    rise = np.diff(rows) / (rows.max() - rows.min())
    x = np.arange(len(rise)) * 2.6 / camera.fx_px
    middle = (x * rise).sum() / rise.sum()
    return float(np.sqrt((((x - middle) ** 2) * rise).sum() / rise.sum()))


@pytest.mark.parametrize("height_m", [0.1, 0.15, 0.2])
def test_penumbra_width_is_edge_height_times_solar_diameter(renderer, draw_kit, height_m):
    # half the radius of the disc; its distance along the light and the wall's slant are sqrt(2) each
    wanted_m = SUN_RADIUS_RAD * height_m
    # the sharpest edge adds to it in squares
    assert 0.95 * wanted_m < spread_m(renderer, draw_kit, height_m) < np.hypot(1.1 * wanted_m, 0.35e-3)
