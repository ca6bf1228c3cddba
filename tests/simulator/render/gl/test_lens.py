"""The lens in the picture: edges, textures, Earth and stars lie where the camera's own projection puts them."""

from dataclasses import replace

import cv2
import msgspec
import numpy as np
import pytest

from simulator.camera.lens.camera_model import Camera
from simulator.camera.lens.distortion import Distortion
from simulator.render.gl.lens_rays import ray_table
from simulator.render.gl.tessellation import outputs
from simulator.world.frames.rotation import matrix_from_quat

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


def edge_errors_px(coverage, camera, corners_camera):
    """Signed distance of a square's drawn edges from their projection, at points along them."""
    errors = []
    for a, b in zip(corners_camera, np.roll(corners_camera, -1, 0), strict=True):
        pixels = camera.project(a + (b - a) * np.linspace(0.05, 0.95, 300)[:, None])
        along = np.gradient(pixels, axis=0)
        normal = np.stack([along[:, 1], -along[:, 0]], -1) / np.linalg.norm(along, axis=1)[:, None]
        pixels, normal = (
            v[camera.contains(pixels + 4) & camera.contains(pixels - 4)] for v in (pixels, normal)
        )
        if not len(pixels):
            continue
        u = np.linspace(-2, 2, 41)
        at = (pixels[:, None] + normal[:, None] * u[:, None]).astype(np.float32)
        profile = cv2.remap(coverage, at[..., 0], at[..., 1], cv2.INTER_LINEAR)
        errors.append(profile.mean(axis=1) * 4 - 2)
    return np.concatenate(errors)


@pytest.mark.parametrize("lens", LENSES)
def test_straight_edges_bend_as_the_camera_projects_them(renderer, draw_kit, lens):
    camera, errors = LENSES[lens], []
    half = 5 * np.tan(camera.half_angle_rad()) * 0.4
    target = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), half)], [draw_kit.white()])
    corners = np.array([(-half, -half, 0), (-half, half, 0), (half, half, 0), (half, -half, 0)])
    for turn in ((0.2, 0.3, 0.5), (0.0, 0.0, 0.1), (-0.3, 0.1, 1.0)):
        scene = draw_kit.scene(target, t_m=(0.3, -0.2, 5.0), rotvec_rad=turn, camera=camera, quality="high")
        coverage = renderer.render(scene, target, labels=True).coverage
        R = matrix_from_quat(scene.q_camera_from_target_wxyz)
        errors.append(edge_errors_px(coverage, camera, corners @ R.T + scene.t_camera_from_target_m))
    errors = np.concatenate(errors)
    # 37 samples a pixel scatter an edge by 0.025 px; the lens may add 0.01 of its own, everywhere alike
    assert np.sqrt((errors**2).mean()) < 0.03
    assert abs(errors.mean()) < 0.01
    # the edges are bent by many pixels, or this would prove nothing
    straight = replace(camera, distortion=Distortion())
    assert np.abs(camera.project([[half, half, 5.0]]) - straight.project([[half, half, 5.0]])).max() > 4


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


@pytest.mark.parametrize("lens", LENSES)
def test_the_table_of_rays_is_the_lens_undone(lens):
    camera = LENSES[lens]
    table = ray_table(camera)
    pixels = np.random.default_rng(0).integers([-1, -1], [321, 241], (400, 2))
    xy = camera.unproject(pixels.astype(float))
    assert np.abs(table[pixels[:, 1] + 1, pixels[:, 0] + 1, :2] - xy).max() * camera.fx_px < 1e-3


def test_outputs_of_branches_left_out_are_not_handed_on():
    source = "#define A 1\n#define B 0\n#if A\nout vec2 v_a;\n#else\nout vec3 v_b;\n#endif\n#if B\nflat out uint v_c;\n"
    assert outputs(source + "#endif\n#ifdef C\nout float v_d;\n#endif\n") == [("", "vec2", "v_a")]
