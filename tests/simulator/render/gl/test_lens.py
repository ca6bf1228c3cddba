"""Distorted images: edges, textures, Earth and stars lie where the camera model projects them."""

from dataclasses import replace

import cv2
import msgspec
import numpy as np
import pytest

from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.camera.lens.distortion import Distortion
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.world.frames.rotation import matrix_from_quat

pytestmark = pytest.mark.gl

LENSES = {
    "brown": Camera(
        width_px=320,
        height_px=240,
        fx_px=300.0,
        fy_px=303.0,
        cx_px=158.0,
        cy_px=121.0,
        distortion=Distortion("brown_conrady", (-0.25, 0.08, 0.001, -0.002, 0.0)),
    ),
    "fisheye": Camera(
        width_px=320,
        height_px=240,
        fx_px=160.0,
        fy_px=161.6,
        cx_px=158.0,
        cy_px=121.0,
        distortion=Distortion("kannala_brandt", (0.05, -0.02, 0.004, -0.001)),
    ),
}


def on_plate(camera, pixels, half, R, t):
    """Which rays through pixels (..., 2) meet a square plate of the target's plane z = 0, before the camera."""
    ray = camera.rays(pixels)
    with np.errstate(all="ignore"):
        along = (R[:, 2] @ t) / (ray @ R[:, 2])
        place = (ray * along[..., None] - t) @ R
        return (along > 0) & (np.abs(place[..., :2]) < half).all(axis=-1)


@pytest.mark.parametrize(("quality", "rms"), [("default", 0.009), ("high", 0.003)])
@pytest.mark.parametrize("lens", LENSES)
def test_straight_edges_bend_as_the_camera_projects_them(renderer, draw_kit, lens, quality, rms):
    camera, errors = LENSES[lens], []
    half = 5 * np.tan(camera.half_angle_rad()) * 0.4
    target = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), half)], [draw_kit.white()])
    inside = (np.arange(24) + 0.5) / 24 - 0.5
    rays_px = np.stack(np.meshgrid(inside, inside), axis=-1)
    for turn in ((0.2, 0.3, 0.5), (0.0, 0.0, 0.1), (-0.3, 0.1, 1.0)):
        scene = draw_kit.scene(target, t_m=(0.3, -0.2, 5.0), rotvec_rad=turn, camera=camera, quality=quality)
        coverage = renderer.render(scene, target, labels=True).coverage
        y, x = np.nonzero((coverage > 0) & (coverage < 1))
        pixels = np.stack([x, y], axis=-1)[:, None, None] + rays_px
        R, t = matrix_from_quat(scene.q_camera_from_target_wxyz), np.asarray(scene.t_camera_from_target_m)
        errors.append(coverage[y, x] - on_plate(camera, pixels, half, R, t).mean(axis=(1, 2)))
    errors = np.concatenate(errors)
    # areas as exact as without a lens; straight pieces lie up to 0.02 px on the inner side of a bent edge
    assert len(errors) > 1000
    assert np.sqrt((errors**2).mean()) < rms
    assert abs(errors.mean()) < 0.002
    # the edges are bent by many pixels, or this would prove nothing
    straight = replace(camera, distortion=Distortion())
    assert np.abs(camera.project([[half, half, 5.0]]) - straight.project([[half, half, 5.0]])).max() > 4


@pytest.mark.parametrize("high", [False, True])
@pytest.mark.parametrize(
    ("t_m", "rotvec_rad"),
    [
        ((4.0, 0.5, 1.0), (0.0, 1.2, 0.0)),  # a corner is behind the camera's plane
        ((1.0, 0.3, 0.4), (0.1, 0.2, 0.3)),  # all around the image's edge, very near
        ((3.0, 1.0, -0.2), (0.2, -1.3, 0.4)),  # its middle is behind
        ((0.0, 0.0, -2.0), (0.0, 0.0, 0.0)),  # all of it is
    ],
)
def test_what_is_beside_and_behind_a_fisheye_is_drawn_where_its_rays_meet_it(
    renderer, draw_kit, t_m, rotvec_rad, high
):
    # 80 degrees off the axis in the corners
    lens = Distortion("kannala_brandt", (0.02, -0.01, 0.0, 0.0))
    camera = Camera(
        width_px=320, height_px=240, fx_px=143.0, fy_px=143.0, cx_px=159.5, cy_px=119.5, distortion=lens
    )
    assert camera.half_angle_rad() > 1.37
    target = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 2.0)], [draw_kit.white()])
    quality = "high" if high else "default"
    scene = draw_kit.scene(target, t_m=t_m, rotvec_rad=rotvec_rad, camera=camera, quality=quality)
    drawn = renderer.render(scene, target, labels=True)
    R, t = matrix_from_quat(scene.q_camera_from_target_wxyz), np.asarray(scene.t_camera_from_target_m)
    pixels = np.stack(np.meshgrid(np.arange(320.0), np.arange(240.0)), axis=-1)
    met = on_plate(camera, pixels, 2.0, R, t)
    near = cv2.dilate(met.astype(np.uint8), np.ones((3, 3))) != cv2.erode(
        met.astype(np.uint8), np.ones((3, 3))
    )
    ray = camera.rays(pixels)
    with np.errstate(all="ignore"):
        z = (R[:, 2] @ t) / (ray @ R[:, 2]) * ray[..., 2]
    near |= ~(z > 0.02)  # the near plane cuts what is closer
    assert met.any() == (t_m[2] > -1)
    assert np.array_equal(np.isfinite(drawn.depth_m)[~near], met[~near])
    assert np.array_equal(drawn.coverage[~near] > 0.5, met[~near])
    inner = met & ~near
    assert drawn.depth_m[inner] == pytest.approx(z[inner], rel=2e-3)


@pytest.mark.parametrize("lens", LENSES)
def test_the_limb_and_the_sun_lie_where_the_camera_projects_them(renderer, draw_kit, lens):
    camera = LENSES[lens]
    target = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.01)], [draw_kit.white()])
    direction = np.array([0.3, -0.2, 1.0])
    scene = draw_kit.scene(
        target,
        t_m=(0.0, 0.0, 90.0),
        camera=camera,
        sun_camera=direction,
        off_nadir_deg=150.0,
        environment=msgspec.structs.replace(draw_kit.nothing, sun=True),
    )
    image = renderer.render(scene, target).radiance
    y, x = np.mgrid[: camera.height_px, : camera.width_px]
    found = np.array([(image * x).sum(), (image * y).sum()]) / image.sum()
    assert np.abs(found - camera.project(scene.sun_direction_camera)).max() < 0.05
    # the disc's whole light: irradiance through the solid angles of its pixels
    flux = (image * camera.pixel_solid_angle_sr(np.stack([x, y], -1))).sum()
    assert flux == pytest.approx(450.0, rel=0.3)
    earth = draw_kit.scene(
        target,
        t_m=(0.0, 0.0, 90.0),
        camera=camera,
        sun_camera=(0.0, -0.5, 1.0),
        off_nadir_deg=66.0,
        environment=msgspec.structs.replace(draw_kit.nothing, earth=True),
    )
    bright = renderer.render(earth, target).radiance > 0
    rays = camera.rays(np.stack([x, y], -1).astype(float)) @ matrix_from_quat(earth.q_camera_from_eci_wxyz)
    r = np.asarray(earth.r_camera_eci_m) / [6378137.0, 6378137.0, 6356752.3]
    d = rays / [6378137.0, 6378137.0, 6356752.3]
    a, b, c = (d * d).sum(-1), d @ r, r @ r - 1
    ground = (b * b - a * c > 0) & (b < 0)
    assert 0.05 < ground.mean() < 0.95
    # all but the limb's own pixels agree; what lies in the dark of night is black, so only one way is asked
    wrong = bright & ~cv2.dilate(ground.astype(np.uint8), np.ones((3, 3))).astype(bool)
    assert not wrong.any()
    assert (bright & ground).sum() > 0.5 * ground.sum()


@pytest.mark.parametrize("quality", ["default", "high"])
def test_what_a_renderer_drew_through_another_lens_does_not_matter(draw_kit, quality):
    # a plate before a wall: its shadow is drawn by a program of its own
    parts = [
        draw_kit.plate("wall", "white", (0, 0, 0), 0.4),
        draw_kit.plate("plate", "white", (-0.3, 0, -0.2), 0.1),
    ]
    target = draw_kit.target(parts, [draw_kit.white()])
    scenes = [
        draw_kit.scene(target, camera=camera, t_m=(0, 0, 2.6), sun_camera=(-1, 0, -1), quality=quality)
        for camera in (draw_kit.camera, draw_kit.lens_camera)
    ]
    first = []
    for scene in scenes:
        with Renderer() as renderer:
            first.append(renderer.render(scene, target).radiance)
    for order in ((0, 1), (1, 0)):
        with Renderer() as renderer:
            for k in order:
                np.testing.assert_array_equal(renderer.render(scenes[k], target).radiance, first[k])
