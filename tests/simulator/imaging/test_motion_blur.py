"""Smear along a flow against the mean over the exposure that it stands for."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.imaging.exposure import GAUSS_LIMITS_PX, INSTANT_SPACING_PX, instants_of
from flyaround.simulator.imaging.image_motion import background_px
from flyaround.simulator.imaging.motion_blur import motion_blur
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.world.constants import EARTH_RADIUS_M
from flyaround.simulator.world.frames.rotation import quat_from_matrix


@pytest.mark.parametrize("bands", [None, 3])
def test_a_turning_picture_is_smeared_as_its_instants_are(bands):
    angle, size = 0.005, 120
    center = np.array([60.0, -240.0])

    def at(turned):
        x, y = np.meshgrid(*(np.arange(size) - c for c in center))
        u, v = (
            np.cos(turned) * x + np.sin(turned) * y,
            np.cos(turned) * y - np.sin(turned) * x,
        )
        light = 1 + 0.5 * np.sin(0.7 * u + 0.3) * np.cos(0.5 * v)
        return light if bands is None else np.stack([light, 2 * light, light**2], axis=-1)

    def ways(pixels):
        return angle * (pixels - center) @ np.array([[0.0, 1.0], [-1.0, 0.0]])

    got = motion_blur(at(0.0).astype(np.float32), ways)
    expected = np.mean([at(angle * ((k + 0.5) / 64 - 0.5)) for k in range(64)], axis=0)
    inner = (slice(4, -4),) * 2  # beyond the border nothing is known
    error = (got - expected)[inner]
    assert got.dtype == np.float32
    assert got.shape == expected.shape
    assert np.sqrt(np.mean(error**2)) < 3e-3 * expected.mean()
    # and the smear is there: without it the error is several times as large
    still = (at(0.0) - expected)[inner]
    assert np.sqrt(np.mean(error**2)) < 0.2 * np.sqrt(np.mean(still**2))


def test_instants_smear_every_contrast_as_the_whole_way_does():
    frequency = np.linspace(0, 0.5, 101)  # per pixel, up to Nyquist's
    for motion in (0.3, 0.7, *GAUSS_LIMITS_PX, 4.0, 9.7, 40.0):
        moments = instants_of(motion, 2.0)
        place = motion * np.array(moments.times_s) / 2.0
        seen = np.array(moments.weights) @ np.cos(2 * np.pi * frequency * place[:, None])
        error = np.sinc(frequency) * np.abs(seen - np.sinc(frequency * motion))
        assert sum(moments.weights) == pytest.approx(1)
        assert error.max() < (0.02 if motion <= GAUSS_LIMITS_PX[-1] else 0.05)
        assert len(moments) <= max(np.ceil(motion / INSTANT_SPACING_PX), 2) + 1


def test_ground_passes_at_the_speed_over_the_height():
    """500 km over the equator, looking down, 70 m on: f 70 / 500e3 px straight below, and less towards the limb."""
    camera = Camera(width_px=400, height_px=300, fx_px=4e4, fy_px=4e4, cx_px=199.5, cy_px=149.5)
    down = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
    here = np.array([EARTH_RADIUS_M + 500e3, 0.0, 0.0])
    scene = replace(
        plan_recipe("eval-earth", 1, seed=3).scene(0),
        camera=camera,
        r_camera_eci_m=vec3(here),
        q_camera_from_eci_wxyz=quat(quat_from_matrix(down)),
    )
    assert scene.environment.earth
    then = replace(scene, r_camera_eci_m=vec3(here + np.array([0.0, 70.0, 0.0])))
    pixels = np.array([[199.5, 149.5], [20.0, 280.0]])
    assert background_px(scene, scene, pixels) == pytest.approx(pixels, abs=1e-6)
    ways = background_px(scene, then, pixels) - pixels
    assert ways[0] == pytest.approx((-4e4 * 70 / 500e3, 0.0), abs=1e-3)
    # half a degree off the nadir the ground is 30 m lower
    assert ways[1] == pytest.approx((-4e4 * 70 / 500e3, 0.0), abs=2e-2)
    empty = replace(scene, environment=msgspec.structs.replace(scene.environment, earth=False))
    assert background_px(empty, replace(then, environment=empty.environment), pixels) == pytest.approx(pixels)
