"""Ground near the poles, where the map's columns converge: a pixel is the mean of its parts."""

from dataclasses import replace

import numpy as np
import pytest

from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.scene.environments import Environment

pytestmark = pytest.mark.gl
WIDTH, HEIGHT, FINER = 160, 120, 8
GROUND = Environment(stars=False, moon=False, clouds=False, atmosphere=False, sea_ice=False)


@pytest.fixture(scope="module")
def plain():
    with Renderer(software_path=False) as renderer:
        yield renderer


# 74 N, 100 E is the Byrranga range, 80 N, 80 W the fjords of Ellesmere; a column of the map is 1.4 and 0.9 km there.
# Looked up a level coarser, for its narrow columns, the ground was blurred: 0.08, 0.17 and 0.16.
@pytest.mark.parametrize(
    ("latitude_deg", "longitude_deg", "altitude_km", "most"),
    [(74.0, 100.0, 1000.0, 0.065), (74.0, 100.0, 2000.0, 0.11), (80.0, -80.0, 1000.0, 0.065)],
)
def test_polar_ground_is_the_mean_of_finer_pixels(
    plain, draw_kit, latitude_deg, longitude_deg, altitude_km, most
):
    target = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.001)], [draw_kit.white()])
    pictures = []
    for k in (1, FINER):
        camera = Camera(
            width_px=WIDTH * k,
            height_px=HEIGHT * k,
            fx_px=600.0 * k,
            fy_px=600.0 * k,
            cx_px=WIDTH / 2 * k - 0.5,
            cy_px=HEIGHT / 2 * k - 0.5,
        )
        scene = draw_kit.scene(
            target,
            t_m=(0, 0, 4.0),
            camera=camera,
            latitude_deg=latitude_deg,
            longitude_deg=longitude_deg,
            altitude_m=altitude_km * 1e3,
            sun_camera=(0.3, -0.2, -1.0),
        )
        plain.make_current()
        drawn = plain.render(replace(scene, environment=GROUND), target).radiance.astype(float)
        pictures.append(drawn.reshape(HEIGHT, k, WIDTH, k).mean(axis=(1, 3)))
    one, parts = pictures
    beside = np.s_[: HEIGHT // 2 - 10]  # above the plate
    off = (one - parts)[beside] / parts[beside].mean()
    assert np.sqrt(np.mean(off**2)) < most
