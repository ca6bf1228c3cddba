"""Rays of distorting lenses in the table of the shaders."""

from pathlib import Path

import numpy as np
import pytest

from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.render.gl.lens_rays import ray_table

CAMERAS = Path(__file__).parents[4] / "assets" / "cameras"


@pytest.mark.parametrize("name", ["fisheye-140", "speedplus"])
def test_rays_of_the_table_project_onto_their_pixels(name):
    camera = load_camera(CAMERAS / f"{name}.json")
    rows, columns = np.mgrid[0 : camera.height_px : 7, 0 : camera.width_px : 7]
    rays = ray_table(camera)[1:-1, 1:-1][rows, columns, :2].astype(float)
    pixels = np.stack([columns, rows], axis=-1).astype(float)
    inside = np.isfinite(camera.unproject(pixels)).all(axis=-1)
    projected = camera.project(np.concatenate([rays, np.ones((*rays.shape[:2], 1))], axis=-1))
    assert np.abs(projected - pixels)[inside].max() < 1e-4
