"""Cells of the screen: what a kind of cell promises holds at every pixel of it."""

import numpy as np
import pytest

from simulator.camera.model import Camera
from simulator.render.cells import earth_cells
from simulator.render.earthview import earth_view
from simulator.render.projection import directions
from simulator.render.view import build_view
from simulator.scene.atmosphere import earth_atmosphere
from simulator.scene.state import Environment, TargetRef
from simulator.scene.viewpoint import scene_above

CAMERA = Camera(width_px=480, height_px=320, fx_px=700.0, fy_px=700.0, cx_px=239.5, cy_px=159.5)


@pytest.mark.parametrize("off_nadir_deg", [58.0, 64.0, 70.0])
def test_no_pixel_of_a_cell_of_air_meets_the_ground(off_nadir_deg):
    scene = scene_above(
        "2026-03-20T10:00:00Z",
        (20.0, 5.0, 700.0),
        off_nadir_deg=off_nadir_deg,
        target=TargetRef(name="none", sha256="0" * 64),
        environment=Environment(moon=False),
        bands="mono",
        camera=CAMERA,
    )
    earth = earth_view(build_view(scene), CAMERA, earth_atmosphere("mono"))
    cells = earth_cells(earth, CAMERA, None, scene.epoch_utc)
    d = directions(CAMERA, np.arange(480.0), np.arange(320.0), earth.earth_from_camera)
    ground = earth.camera @ earth.camera - (d @ earth.camera) ** 2 < 1
    of_air = np.zeros_like(ground)
    for kind, centers in cells.centers_px.items():
        for x, y in centers + 0.5 - cells.size_px / 2 if kind.air else ():
            of_air[round(y) : round(y) + cells.size_px, round(x) : round(x) + cells.size_px] = True
    assert of_air.any()
    assert ground.any()
    assert not np.any(of_air & ground)
