"""Light on the target: energy conservation, the Earth's radiance field, occlusion and interreflection."""

import numpy as np
import pytest

from flyaround.simulator.celestial.earth_albedo import albedo_map, albedo_of_day
from flyaround.simulator.geometry.directions import spherical_fibonacci
from flyaround.simulator.scene.illumination.bands import sun_irradiance_w_m2
from flyaround.simulator.scene.illumination.irradiance import (
    IrradianceField,
    basis,
    field_of_samples,
    globe_shine,
    moon_shine,
    uniform_field,
)
from flyaround.simulator.targets.model import Part
from flyaround.simulator.world.bodies.earth import EARTH

pytestmark = pytest.mark.gl


def ball(draw_kit, **material):
    """A fine sphere of 0.5 m at the origin with exact normals."""
    around, down = 96, 48
    a, b = np.meshgrid(np.linspace(0, 2 * np.pi, around + 1), np.linspace(0, np.pi, down + 1))
    n = np.stack([np.sin(b) * np.cos(a), np.sin(b) * np.sin(a), np.cos(b)], axis=-1).reshape(-1, 3)
    row, column = (q.ravel() for q in np.meshgrid(np.arange(down), np.arange(around), indexing="ij"))
    first = row * (around + 1) + column
    below = first + around + 1
    triangles = np.concatenate(
        [np.stack([first, below, below + 1], axis=1), np.stack([first, below + 1, first + 1], axis=1)]
    )
    part = Part(
        name="ball",
        material="white",
        positions_m=(0.5 * n).astype(np.float32),
        normals=n.astype(np.float32),
        triangles=triangles,
    )
    return draw_kit.target([part], [draw_kit.white(**material)])


@pytest.mark.parametrize(
    "material",
    [
        {"base_color": (1.0, 1.0, 1.0), "metallic": 1.0, "roughness": 0.2},
        {"base_color": (1.0, 1.0, 1.0), "metallic": 1.0, "roughness": 0.9},
        {"base_color": (1.0, 1.0, 1.0), "metallic": 0.0, "roughness": 0.6},
    ],
)
def test_white_body_in_a_white_furnace_is_invisible(renderer, draw_kit, material):
    target = ball(draw_kit, **material)
    scene = draw_kit.scene(target, t_m=(0, 0, 4.0), sun_visible_fraction=0.0)
    seen = renderer.render(scene, target, labels=True, sky=uniform_field([3.0]))
    inside = seen.radiance[seen.coverage > 0.999]
    assert len(inside) > 10_000
    assert np.abs(inside / 3.0 - 1).max() < 0.01


@pytest.mark.parametrize(("roughness", "off_deg"), [(0.4, 20.0), (0.7, 50.0), (1.0, 0.0)])
def test_rough_white_metal_returns_all_sunlight(renderer, draw_kit, roughness, off_deg):
    # what a plate sends to the camera, over every direction of the Sun, is by reciprocity what it reflects of one
    target = draw_kit.target(
        [draw_kit.plate("p", "white", (0, 0, 0), 0.5)],
        [draw_kit.white(base_color=(1.0, 1.0, 1.0), metallic=1.0, roughness=roughness)],
    )
    turn = np.radians(off_deg)
    total, weight, count = 0.0, 0.0, 240
    small = draw_kit.camera.__class__(width_px=9, height_px=9, fx_px=600.0, fy_px=600.0, cx_px=4.0, cy_px=4.0)
    for sun in spherical_fibonacci(count, 0.0):
        # hemisphere around the plate's normal, which is -z before the turn
        c, s = np.cos(turn), np.sin(turn)
        towards = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ (sun * (1, 1, -1))
        scene = draw_kit.scene(target, rotvec_rad=(0, turn, 0), sun_camera=towards, camera=small)
        total += float(renderer.render(scene, target).radiance[4, 4])
        weight = sun_irradiance_w_m2("mono", np.linalg.norm(scene.r_sun_eci_m))[0]
    assert total * 2 * np.pi / count / weight == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("radius_deg", [20.0, 65.0, 90.0])
def test_irradiance_of_an_even_disc_on_plates(radius_deg):
    rim = np.cos(np.radians(radius_deg))
    directions = spherical_fibonacci(20_000, rim)
    angle = 2 * np.pi * (1 - rim) / len(directions)
    light = field_of_samples(directions, np.ones((len(directions), 1)), angle, rim, np.array([0, 0, 1.0]))
    normals = spherical_fibonacci(500)
    exact = np.clip(normals @ directions.T, 0, None).sum(axis=1) * angle
    error = (basis(normals, light.axis) @ light.irradiance_w_m2)[:, 0] - exact
    assert np.abs(error).max() < (0.01 if radius_deg > 60 else 0.03) * exact.max()
    # the disc's radiance everywhere on it
    assert np.column_stack([directions, np.ones(len(directions))]) @ light.radiance_w_m2_sr[
        0
    ] == pytest.approx(1.0, abs=0.02)


def test_earthshine_follows_the_lit_and_cloudy_part_of_the_earth():
    zenith, sun = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    even = np.full((1, 1), 0.3, np.float32)
    place = zenith * 7.0e6
    half = globe_shine(place, sun, np.eye(3), np.array([1000.0]), even, EARTH.mean_radius_m)
    towards_day, towards_night = (
        basis(np.array([d]), half.axis) @ half.irradiance_w_m2 for d in ((-0.6, 0.8, 0), (-0.6, -0.8, 0))
    )
    assert towards_day[0, 0] > 3 * towards_night[0, 0] > 0
    # over the subsolar point of an even Earth: below its albedo times the view factor, for it darkens to the rim
    noon = globe_shine(place, zenith, np.eye(3), np.array([1000.0]), even, EARTH.mean_radius_m)
    down = (basis(-zenith[None], noon.axis) @ noon.irradiance_w_m2)[0, 0]
    factor = (6_371_008.8 / 7.0e6) ** 2
    assert 0.75 * 300 * factor < down < 300 * factor
    clouded, clear = albedo_map(clouds=True), albedo_map(clouds=False)
    weight = np.cos(np.linspace(-np.pi / 2, np.pi / 2, 129)[1::2])[:, None]
    assert (clouded * weight).sum() / weight.sum() / clouded.shape[1] == pytest.approx(0.3, abs=1e-3)
    sahara, pacific = clear[22, 69], clear[36, 12]
    assert sahara > 2.5 * pacific
    assert clear[2:6].mean() > 2 * pacific or clear[-4:-1].mean() > 2 * pacific  # ice


def test_earthshine_depends_on_seasonal_ice():
    march, september = (
        albedo_of_day(f"2026-{day}T12:00:00Z", clouds=True, ice=True) for day in ("03-10", "09-15")
    )
    weddell, okhotsk = np.s_[54:56, 46:52], np.s_[11:13, 115:118]  # 62-67 S, 50-34 W; 53-59 N, 143-151 E
    assert september[weddell].mean() > 1.15 * march[weddell].mean()
    assert march[okhotsk].mean() > 1.1 * september[okhotsk].mean()
    weight = np.cos(np.linspace(-np.pi / 2, np.pi / 2, 129)[1::2])[:, None]
    for albedo in (march, september):
        assert (albedo * weight).sum() / weight.sum() / albedo.shape[1] == pytest.approx(0.3, abs=1e-3)
    assert np.all(
        albedo_of_day("2026-03-10T00:00:00Z", clouds=False, ice=True) >= albedo_map(clouds=False) - 1e-6
    )


def test_moonshine_of_a_full_moon_is_a_third_of_a_lux():
    sun = np.array([-1.0, 0.0, 0.0])
    lux, east, north = np.array([133_000.0]), np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
    full = moon_shine(3.844e8 * east, sun, np.eye(3), lux, east)
    assert (basis(east, east) @ full)[0] == pytest.approx(0.33, rel=0.15)
    half = moon_shine(3.844e8 * north, sun, np.eye(3), lux, north)
    assert (basis(north, north) @ half)[0] < 0.15 * 0.33


def test_a_wall_takes_its_share_of_the_sky_from_the_floor_and_gives_light_back(renderer, draw_kit):
    # floor in the camera's face, a wall at x = 0.5 towards the camera
    floor = draw_kit.plate("floor", "black", (0, 0, 0), 0.5)
    wall = draw_kit.quad(
        "wall", "black", [(0.5, -0.5, 0), (0.5, -0.5, -1.0), (0.5, 0.5, -1.0), (0.5, 0.5, 0)]
    )
    thick = draw_kit.quad(
        "back", "black", [(0.51, -0.5, 0), (0.51, 0.5, 0), (0.51, 0.5, -1.0), (0.51, -0.5, -1.0)]
    )
    dim = draw_kit.white(name="black", base_color=(0.02, 0.02, 0.02))
    target = draw_kit.target([floor, wall, thick], [dim])
    scene = draw_kit.scene(target, t_m=(-0.3, 0, 4.0), sun_visible_fraction=0.0)
    image = renderer.render(scene, target, sky=uniform_field([1.0])).radiance

    def at(x):
        u, v = scene.camera.project([x - 0.3, 0.0, 4.0])
        return image[round(v), round(u)]

    def hidden(distance, height=1.0, half_width=0.5):
        # view factor from a spot to a rectangle that stands at a distance: Howell, catalogue of factors, B-5
        y, z = np.meshgrid(
            (np.arange(200) + 0.5) / 200 * 2 * half_width - half_width, (np.arange(200) + 0.5) / 200
        )
        z = z * height
        r2 = distance**2 + y**2 + z**2
        return float((z * distance / (np.pi * r2**2)).mean() * 2 * half_width * height)

    open_spot = at(-0.4) / (1 - hidden(0.9))
    for x in (0.4, 0.25, 0.0):
        assert at(x) / open_spot == pytest.approx(1 - hidden(0.5 - x), abs=0.06)


def test_irradiance_of_any_field_is_its_polynomial_of_the_normal(renderer, draw_kit):
    """The shader against its twin on the CPU, on every normal of a ball; what reflections would add is left out."""
    target = ball(draw_kit, base_color=(0.5, 0.5, 0.5), metallic=0.0, roughness=1.0)
    scene = draw_kit.scene(target, t_m=(0.0, 0.0, 4.0), sun_visible_fraction=0.0)
    axis = np.array([0.48, -0.64, -0.6])
    field = np.array([3.0, 0.4, -0.3, 0.5, 0.35, -0.45, 0.25, 0.15, -0.3, 0.5])[:, None]

    def drawn(coefficients):
        light = IrradianceField(coefficients, np.zeros((1, 4)), -2.0, axis)
        seen = renderer.render(scene, target, labels=True, sky=light)
        return seen.radiance.astype(float), seen.coverage > 0.999

    even, inside = drawn(np.eye(10)[:, :1])
    y, x = np.nonzero(inside)
    # where each pixel's ray meets the ball
    ray = np.stack([(x - 161.3) / 600, (y - 118.6) / 590, np.ones(len(x))], axis=1)
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    along = 4.0 * ray[:, 2]
    left = 0.25 - (16.0 - along**2)
    clear = left > 0.02  # at the rim a pixel sees many normals
    n = (ray * (along - np.sqrt(np.maximum(left, 0)))[:, None] - [0.0, 0.0, 4.0])[clear] / 0.5
    wanted = (basis(n, axis) @ field)[:, 0]
    ratio = (drawn(field)[0][inside] / even[inside])[clear]
    assert wanted.min() > 1.0
    assert np.ptp(wanted) > 1.0
    # flat facets of 4 deg with their corners' normals, sampled within the pixel
    assert np.abs(ratio - wanted).max() < 0.03
