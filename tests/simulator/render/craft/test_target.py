"""The target in the image: position, radiance, shadows, labels."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.scene.illumination.bands import sun_irradiance_w_m2
from flyaround.simulator.targets.model import Material
from flyaround.simulator.world.frames.rotation import matrix_from_quat

pytestmark = pytest.mark.gl
BLACK = Material(name="black", base_color=(0.0, 0.0, 0.0), roughness=1.0)


def _expected_radiance(albedo, roughness, n, v, s, irradiance):
    """Lambert under a dielectric GGX coat, written again from the papers (see shaders/craft/brdf.glsl)."""
    h = (v + s) / np.linalg.norm(v + s)
    n_l, n_v, n_h, v_h = n @ s, n @ v, n @ h, v @ h
    alpha2 = (roughness**2) ** 2
    d = alpha2 / (np.pi * ((n_h**2) * (alpha2 - 1) + 1) ** 2)

    def smith(c):
        return (-1 + np.sqrt(1 + alpha2 * (1 - c * c) / c**2)) / 2

    g = 1 / (1 + smith(n_l) + smith(n_v))
    f = 0.04 + 0.96 * (1 - v_h) ** 5
    return irradiance * n_l * ((1 - f) * albedo / np.pi + f * d * g / (4 * n_l * n_v))


@pytest.mark.parametrize(("albedo", "angle_deg"), [(0.8, 0.0), (0.5, 40.0), (0.2, 70.0)])
def test_radiance_of_a_rough_plate_matches_the_brdf(renderer, draw_kit, albedo, angle_deg):
    target = draw_kit.target(
        [draw_kit.plate("p", "white", (0, 0, 0), 0.5)], [draw_kit.white(base_color=(albedo,) * 3)]
    )
    a = np.radians(angle_deg)
    scene = draw_kit.scene(target, sun_camera=(np.sin(a), 0, -np.cos(a)))
    image = renderer.render(scene, target).radiance
    x, y = 170, 100
    v = -np.array([(x - 161.3) / 600, (y - 118.6) / 590, 1.0])
    v /= np.linalg.norm(v)
    s = np.array(scene.sun_direction_camera)
    irradiance = sun_irradiance_w_m2("mono", np.linalg.norm(scene.r_sun_eci_m))[0]
    expected = _expected_radiance(albedo, 1.0, np.array([0, 0, -1.0]), v, s, irradiance)
    assert image[y, x] == pytest.approx(expected, rel=0.01)
    # the diffuse part alone is Lambert's within what the coat takes and gives
    assert image[y, x] == pytest.approx(albedo * irradiance * np.cos(a) / np.pi, rel=0.06)


def test_rgb_radiance_uses_the_irradiance_of_each_band(renderer, draw_kit):
    colour = Material(name="white", base_color=(0.6, 0.3, 0.1), roughness=1.0)
    target = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.5)], [colour])
    scene = draw_kit.scene(target, bands="rgb")
    pixel = renderer.render(scene, target).radiance[118, 161]
    irradiance = sun_irradiance_w_m2("rgb", np.linalg.norm(scene.r_sun_eci_m))
    n = np.array([0, 0, -1.0])
    expected = [
        _expected_radiance(c, 1.0, n, n, n, e) for c, e in zip((0.6, 0.3, 0.1), irradiance, strict=True)
    ]
    assert pixel == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(
    ("quality", "rms_px", "largest_px"),
    [("draft", 0.002, 0.01), ("default", 0.002, 0.01), ("high", 0.01, 0.05)],
)
def test_straight_edges_are_located_to_subpixel_accuracy(renderer, draw_kit, quality, rms_px, largest_px):
    # before any optics, over every slope
    errors = []
    turns = (0.0, 3.0, 10.0, 14.0, 26.6, 33.7, 45.0, 56.3, 63.4, 76.0, 84.0, 89.0)
    for angle_deg in (*turns, *(-turn for turn in turns[1:])):
        errors += _edge_errors(renderer, draw_kit, angle_deg, quality)
    assert np.sqrt(np.mean(np.square(errors))) <= rms_px
    assert np.abs(errors).max() <= largest_px
    assert abs(np.mean(errors)) <= 0.005


def _edge_errors(renderer, draw_kit, angle_deg, quality):
    """Position of a plate's edge in every row (or column) by its coverage, less the true one [px]."""
    target = draw_kit.target([draw_kit.plate("p", "white", (0.6, 0, 0), 0.6)], [draw_kit.white()])
    scene = draw_kit.scene(
        target, rotvec_rad=(0, 0, np.radians(angle_deg)), t_m=(0.02, 0.01, 5), quality=quality
    )
    coverage = renderer.render(scene, target, labels=True).coverage.astype(float)
    a, b = scene.camera.project(scene.camera_from_target.apply([(0, -0.4, 0), (0, 0.4, 0)]))
    if abs(b[1] - a[1]) > abs(b[0] - a[0]):
        along, across, image = 1, 0, coverage
    else:
        along, across, image = 0, 1, coverage.T
    low, high = sorted((a[along], b[along]))
    lines = np.arange(int(np.ceil(low)), int(high))
    true = a[across] + (lines - a[along]) * (b[across] - a[across]) / (b[along] - a[along])
    errors = []
    for line, position in zip(lines, true, strict=True):
        x0 = int(position) - 8
        window = image[line, x0 : x0 + 17]
        rising = window[-1] > window[0]
        # the plate's share of the window tells where its edge crosses it
        edge = x0 + 16.5 - window.sum() if rising else x0 - 0.5 + window.sum()
        errors.append(edge - position)
    return errors


def test_coverage_of_a_thin_rod_is_its_area(renderer, draw_kit):
    width_m = 0.003  # 0.36 pixels wide at 5 m
    rod = draw_kit.quad(
        "rod",
        "white",
        [(-width_m / 2, -0.5, 0), (-width_m / 2, 0.5, 0), (width_m / 2, 0.5, 0), (width_m / 2, -0.5, 0)],
    )
    target = draw_kit.target([rod], [draw_kit.white()])
    for turn in (0.05, 0.4, 1.2):  # none along the lattice: docs/adr/0003
        scene = draw_kit.scene(target, rotvec_rad=(0, 0, turn))
        coverage = renderer.render(scene, target, labels=True).coverage
        corners = scene.camera.project(scene.camera_from_target.apply(rod.positions_m))
        x, y = corners.T
        area = 0.5 * abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1)))
        assert coverage.sum() == pytest.approx(area, rel=0.02)


def test_shadow_falls_where_geometry_says(renderer, draw_kit):
    # a small square 0.3 m in front of a wall, the Sun 45 degrees to the left: the shadow is 0.3 m to the right
    parts = [
        draw_kit.plate("wall", "white", (0, 0, 0), 0.8),
        draw_kit.plate("blind", "black", (-0.2, 0, -0.3), 0.1),
    ]
    target = draw_kit.target(parts, [draw_kit.white(), BLACK])
    scene = draw_kit.scene(target, sun_camera=(-1, 0, -1), quality="high")
    image = renderer.render(scene, target).radiance.astype(float)
    lit = image[118, 230]
    for edge_x, step in ((0.0, -1), (0.2, 1)):
        u, v = scene.camera.project([edge_x, 0.0, 5.0])
        x0 = round(u) - 8
        profile = np.clip(image[round(v), x0 : x0 + 17] / lit, 0, 1)
        dark = (1 - profile).sum()
        edge = x0 + 16.5 - dark if step < 0 else x0 - 0.5 + dark
        assert abs(edge - u) < 0.7  # 6 mm; the penumbra is 4 mm wide
    # a wall's own face is not freckled: no acne
    patch = image[40:80, 100:220]
    assert patch.std() / patch.mean() < 0.01


def test_only_earthshine_in_eclipse(renderer, draw_kit):
    target = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.5)], [draw_kit.white()])
    dark = draw_kit.scene(target, sun_visible_fraction=0.0)
    assert renderer.render(dark, target).radiance.max() == 0.0
    half = renderer.render(replace(dark, sun_visible_fraction=0.5), target).radiance.max()
    full = renderer.render(replace(dark, sun_visible_fraction=1.0), target).radiance.max()
    assert half == pytest.approx(full / 2, rel=1e-5)
    # looking up from below at a plate that faces a sunlit Earth
    shine = draw_kit.scene(
        target,
        off_nadir_deg=180.0,
        sun_camera=(0, 0, 1),
        environment=msgspec.structs.replace(draw_kit.nothing, earthshine=True, clouds=True),
        sun_visible_fraction=0.0,
    )
    value = renderer.render(shine, target).radiance[118, 161]
    irradiance = sun_irradiance_w_m2("mono", np.linalg.norm(shine.r_sun_eci_m))[0]
    # under the tropical Atlantic at noon, mostly sea, filling most of the sky, a plate of 0.5
    assert 0.08 < value / (0.5 * irradiance / np.pi) < 0.25


def test_labels_agree_with_geometry(renderer, draw_kit):
    target = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.4)], [draw_kit.white()])
    scene = draw_kit.scene(target, rotvec_rad=(0.5, -0.3, 0.2), t_m=(0.1, 0.1, 4.0))
    seen = renderer.render(scene, target, labels=True)
    assert seen.silhouette_inside == 1.0
    y, x = np.nonzero(seen.coverage > 0.99)
    n = matrix_from_quat(scene.q_camera_from_target_wxyz)[:, 2]
    rays = np.stack([(x - 161.3) / 600, (y - 118.6) / 590, np.ones(len(x))], axis=1)
    z = (n @ scene.t_camera_from_target_m) / (rays @ n)
    assert seen.depth_m[y, x] == pytest.approx(z, rel=2e-6)
    assert np.isnan(seen.depth_m[seen.coverage == 0]).all()
    assert renderer.render(scene, target).coverage is None


def test_silhouette_fraction_of_a_cropped_target(renderer, draw_kit):
    target = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.5)], [draw_kit.white()])
    edge = draw_kit.scene(target).camera
    x = (-0.5 - edge.cx_px) / edge.fx_px * 5.0  # the image's left edge at 5 m
    seen = renderer.render(draw_kit.scene(target, t_m=(x + 0.25, 0, 5)), target, labels=True)
    assert seen.silhouette_inside == pytest.approx(0.75, abs=0.01)
    gone = renderer.render(draw_kit.scene(target, t_m=(x - 2, 0, 5)), target, labels=True)
    assert gone.silhouette_inside == 0.0
    assert not gone.radiance.any()
    behind = renderer.render(draw_kit.scene(target, t_m=(0, 0, -5)), target, labels=True)
    assert behind.silhouette_inside == 0.0


def test_the_wrong_target_is_refused(renderer, draw_kit):
    one = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.5)], [draw_kit.white()])
    two = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.6)], [draw_kit.white()])
    with pytest.raises(UserError, match="use the same version"):
        renderer.render(draw_kit.scene(one), two)


def test_a_part_without_its_material_is_refused(renderer, draw_kit):
    broken = draw_kit.target([draw_kit.plate("p", "gold", (0, 0, 0), 0.5)], [draw_kit.white()])
    with pytest.raises(UserError, match="gold"):
        renderer.render(draw_kit.scene(broken), broken)


@pytest.mark.parametrize(
    ("distance_m", "half_m", "altitude_m"),
    [
        (0.1, 0.03, 500e3),
        (3.0, 0.4, 35_786e3),
        (60.0, 5.0, 500e3),
        (60e3, 2000.0, 384_400e3),
        (60e3, 3.0, 500e3),
    ],
)
def test_micrometres_move_the_image_smoothly_near_and_far(renderer, draw_kit, distance_m, half_m, altitude_m):
    # from a hand's breadth to 60 km, in low, geostationary and the Moon's orbit: no jitter, no flicker, no steps
    target = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), half_m)], [draw_kit.white()])
    step_m = max(1e-6, 1e-7 * distance_m)
    images = [
        renderer.render(
            draw_kit.scene(
                target, rotvec_rad=(0.3, 0.2, 0.1), t_m=(k * step_m, 0, distance_m), altitude_m=altitude_m
            ),
            target,
        ).radiance.astype(float)
        for k in range(4)
    ]
    brightest = images[0].max()
    assert brightest > 0
    step = np.abs(np.diff(np.stack(images), axis=0)) / brightest
    moved_px = step_m * 600.0 / distance_m
    # an edge's pixel changes by its motion, in steps of 1/256 of a sample's distance to which the rasteriser rounds;
    # the few whose corner enters or leaves them, by a sample at most
    assert (step > 3 * moved_px + 3e-3).sum() <= 3
    assert step.max() < 0.15


def test_renderers_of_one_process_do_not_disturb_each_other(renderer, draw_kit):
    from flyaround.simulator.render.renderer import Renderer

    target = draw_kit.target([draw_kit.plate("plate", "white", (0, 0, 0), 0.3)], [draw_kit.white()])
    scene = draw_kit.scene(target, t_m=(0, 0, 4.0))
    alone = renderer.render(scene, target).radiance
    with Renderer() as other:
        beside = other.render(scene, target).radiance
        again = renderer.render(scene, target).radiance
    after = renderer.render(scene, target).radiance
    for picture in (beside, again, after):
        np.testing.assert_array_equal(picture, alone)
