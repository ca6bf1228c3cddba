"""Motion of the camera by micrometres and microradians changes the image smoothly."""

from dataclasses import replace

import numpy as np
import pytest

from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.scene.environments import Environment
from flyaround.simulator.scene.state import TargetRef
from flyaround.simulator.scene.viewpoint import scene_above
from flyaround.simulator.world.frames.rotation import matrix_from_quat, quat_from_matrix, quat_from_rotvec

pytestmark = pytest.mark.gl
CAMERA = Camera(width_px=160, height_px=120, fx_px=300.0, fy_px=300.0, cx_px=79.5, cy_px=59.5)
NOON, FULL_MOON, NIGHT = "2026-03-20T12:00:00Z", "2026-03-30T16:00:00Z", "2026-03-20T00:00:00Z"
STEPS = 6
VIEWS = ("low orbit", "limb", "geostationary orbit", "Moon", "orbit of the Moon", "stars")


@pytest.fixture(scope="module")
def speck(draw_kit):
    return draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.5)], [draw_kit.white()])


@pytest.fixture(scope="module")
def view_of(speck):
    def scene(name):
        ref = TargetRef(name=speck.name, sha256=speck.sha256)

        def above(epoch, place, focal_px=300.0, **more):
            camera = replace(CAMERA, fx_px=focal_px, fy_px=focal_px)
            return scene_above(epoch, place, camera=camera, target=ref, bands="mono", **more)

        match name:
            case "low orbit":
                return above(NOON, (20.0, 5.0, 500.0), off_nadir_deg=20.0)
            case "limb":
                return above(NOON, (20.0, 5.0, 500.0), off_nadir_deg=64.0)
            case "geostationary orbit":
                return above(NOON, (0.0, 5.0, 35_786.0), focal_px=500.0)
            case "Moon":
                moon = above(FULL_MOON, (15.0, 20.0, 500.0), focal_px=8000.0, look_at="moon")
                return replace(moon, environment=Environment(earth=False, stars=False))
            case "stars":
                return above(NIGHT, (15.0, 5.0, 500.0), off_nadir_deg=150.0)
            case _:  # straight down from 100 km above the Moon's near side
                scene = above(FULL_MOON, (15.0, 20.0, 500.0), look_at="moon")
                down = matrix_from_quat(scene.q_camera_from_eci_wxyz)[2]
                r = np.asarray(scene.body("moon").r_eci_m) - 1_837_400.0 * down
                return replace(
                    scene, r_camera_eci_m=vec3(r), r_target_eci_m=vec3(r - 1000 * down), central_body="moon"
                )

    return scene


def moved(scene, right_m, turn_rad):
    """The scene seen from further right, turned to the right."""
    R = matrix_from_quat(scene.q_camera_from_eci_wxyz)
    way = R.T @ np.array([right_m, 0, 0])
    turned = matrix_from_quat(quat_from_rotvec(np.array([0, turn_rad, 0]))) @ R
    return replace(
        scene,
        r_camera_eci_m=vec3(np.asarray(scene.r_camera_eci_m) + way),
        r_target_eci_m=vec3(np.asarray(scene.r_target_eci_m) + way),
        q_camera_from_eci_wxyz=quat(quat_from_matrix(turned)),
    )


@pytest.mark.parametrize("quality", ["default", "high"])
@pytest.mark.parametrize("name", VIEWS)
def test_the_background_follows_the_camera_smoothly(renderer, speck, view_of, name, quality):
    scene = replace(view_of(name), quality=quality)
    focal_px = scene.camera.fx_px

    def drive(right_m, turn_px):
        pictures = [
            renderer.render(moved(scene, k * right_m, k * turn_px / focal_px), speck).radiance.astype(float)
            for k in range(STEPS)
        ]
        brightest = pictures[0].max() if name == "stars" else np.quantile(pictures[0], 0.999)
        return np.array(pictures) / brightest

    # micrometres: nothing flickers
    assert np.abs(np.diff(drive(1e-6, 0.0), axis=0)).max() < 2e-3
    # a step of 1/500, then of 1/50 pixel: a pixel changes by its motion, and by the 1/256 of a texel to which textures
    # are filtered (clouds sharpen that); and the picture goes there straight, not to and fro
    for turn_px in (0.002, 0.02):
        pictures = drive(0.0, turn_px)
        steps = np.abs(np.diff(pictures, axis=0))
        assert steps.max() < 3 * turn_px + 0.05
        assert (steps > 3 * turn_px + 0.01).mean() < 2e-3
        there = np.abs(pictures[-1] - pictures[0]).mean()
        assert there > 0
        assert steps.mean(axis=(1, 2)).sum() < 2 * there
        # no step stands out: nothing pops
        assert steps.mean(axis=(1, 2)).max() < 3 * steps.mean()


@pytest.mark.parametrize("quality", ["default", "high"])
def test_tiles_take_another_level_of_detail_unseen(renderer, speck, quality):
    # in this view a tile of broken cloud near Borneo changes its level within the motion
    scene = scene_above(
        "2026-09-10T04:00:00Z",
        (-3.0, 115.0, 420.0),
        camera=CAMERA,
        target=TargetRef(name=speck.name, sha256=speck.sha256),
        azimuth_deg=45.0,
        off_nadir_deg=45.0,
        bands="mono",
        quality=quality,
    )
    pictures = np.array(
        [
            renderer.render(moved(scene, 0.0, k * 0.02 / 300.0), speck).radiance.astype(float)
            for k in range(40)
        ]
    )
    steps = np.abs(np.diff(pictures, axis=0)) / np.quantile(pictures[0], 0.999)
    assert steps.max() < 3 * 0.02 + 0.05


def test_the_limb_of_the_moon_moves_by_parts_of_a_pixel(renderer, speck, view_of):
    scene = view_of("Moon")
    pictures = np.array(
        [
            renderer.render(moved(scene, 0.0, k * 0.1 / 8000.0), speck).radiance.astype(float)
            for k in range(11)
        ]
    )
    pictures /= np.quantile(pictures[0], 0.99)
    # a pixel's light on the limb comes or goes over about one pixel of motion, never in one step of a tenth
    step = np.abs(np.diff(pictures, axis=0))
    assert step.max() < 0.3
    assert np.abs(pictures[-1] - pictures[0]).max() > 0.5
