"""Top-of-atmosphere reflectance of land, snow, sea and clouds, and night lights, against measurements."""

import re
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from flyaround.simulator.celestial.city_lights import MAX_LIGHT, night_texture
from flyaround.simulator.celestial.detail_noise import detail_texture
from flyaround.simulator.render.gl.mipmaps import mipmap_chain
from flyaround.simulator.render.gl.programs import read_source
from flyaround.simulator.scene.environments import Environment
from flyaround.simulator.scene.state import TargetRef
from flyaround.simulator.scene.viewpoint import scene_above
from flyaround.simulator.targets.library import load_target
from tools.validation.rendering.surfaces import (
    CITIES,
    KINDS,
    SUN_DEG,
    camera,
    city_radiance,
    reflectance,
    scene_under,
)

pytestmark = pytest.mark.gl
CLEAR = Environment(clouds=False, stars=False, planets=False, moon=False)
# nadir reflectance of a cloud over darkness, asymmetry 0.85, no absorption, by PythonicDISORT 1.8 with 32 streams:
# optical depth, and the Sun 20, 45, 65 deg from the zenith
CLOUDS = {
    8: (0.333, 0.378, 0.391),
    16: (0.574, 0.586, 0.552),
    32: (0.783, 0.764, 0.688),
    64: (0.928, 0.887, 0.783),
}


def glsl(name, file="earth/surface.glsl"):
    """A function of the shaders of one line's return, in Python: its arguments are arrays."""
    text = read_source(file)
    arguments, body = re.search(rf"float {name}\((.*?)\) \{{\n(.*?)\n\}}", text, re.DOTALL).groups()
    lines = [re.sub(r"^\s*(float )?|;$", "", line) for line in body.splitlines()]
    names = [argument.split()[-1] for argument in arguments.split(", ")]

    def function(*values):
        known = dict(zip(names, values, strict=True)) | {"min": np.minimum, "max": np.maximum}
        for line in lines:
            exec(line.replace("return", "result ="), {"abs": np.abs, "exp": np.exp}, known)  # noqa: S102 - our own shader
        return known["result"]

    return function


@pytest.mark.parametrize("quality", ["default", "high"])
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_surfaces_reflect_above_the_air_what_is_measured(renderer, kind, quality):
    for sun_deg, published in zip(SUN_DEG, kind.published, strict=True):
        assert reflectance(renderer, kind, sun_deg, quality=quality)[0] == pytest.approx(published, rel=0.10)


def test_the_desert_is_as_red_as_libya_4(renderer):
    # red, green, blue at the top of the air (Mishra et al. 2014)
    drawn = reflectance(renderer, KINDS[0], 45.0, bands="rgb")
    assert drawn == pytest.approx([0.45, 0.34, 0.24], rel=0.15)


def test_clouds_are_as_bright_as_discrete_ordinates_have_them():
    cloud = glsl("cloud_reflectance")
    for depth, published in CLOUDS.items():
        for sun_deg, exact in zip(SUN_DEG, published, strict=True):
            mu, scaled = np.cos(np.radians(sun_deg)), 0.15 * depth
            thin = 12 / 49 * (1 + 2 * mu) * 3
            # at 0.15 of the way from the edge to the middle the depth is the scaled one
            drawn = thin / (1 + mu) * cloud(0.15, scaled / 0.15**2, 0.0, thin)
            # thin clouds return more towards the Sun than this phase function has it, by a glory and a rainbow
            assert drawn == pytest.approx(exact, rel=0.12, abs=0.065 if depth < 16 else 0.0)


def test_air_adds_little_to_a_glint(renderer):
    # a low Sun's, far brighter than any ground: what air throws back and aside is of ground that shines all around
    ref, light = TargetRef(name="tango", sha256=load_target("tango").sha256), {}
    for air in (True, False):
        world = msgspec.structs.replace(CLEAR, atmosphere=air)
        view = {"azimuth_deg": 275.0, "off_nadir_deg": 60.0, "camera": camera(100.0), "target": ref}
        scene = scene_above("2026-06-20T15:10:00Z", (37.5, 29.0, 420.0), environment=world, **view)
        light[air] = renderer.render(scene, load_target("tango")).radiance.astype(float)
    bright = light[False][..., 2] > np.quantile(light[False][..., 2], 0.9)
    shares = np.median(light[True][bright] / light[False][bright], axis=0)
    assert np.all(shares < [0.84, 0.75, 0.68])
    assert shares[0] > shares[2]  # reddened


@pytest.mark.parametrize("seen", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("level", [0, 2])
def test_gusts_and_swell_keep_the_sea_s_mean_slope(level, seen):
    detail = detail_texture()[:: 2**level, :: 2**level] / 255
    puffs, regions = detail[..., 0].ravel(), detail[..., 3].ravel()
    rng = np.random.default_rng(3)
    calm = glsl("sea_calm")(rng.permutation(regions), *(rng.permutation(puffs) for _ in range(4)), seen)
    # the variance is Cox & Munk's (1954) times exp(-calm)
    assert np.exp(-calm).mean() == pytest.approx(1.0, abs=0.01)
    assert 0.2 < calm.std() < 0.5


@pytest.mark.parametrize("b", [0.08, 0.3, 0.5])
def test_smaller_clouds_leave_as_much_under_cloud(b):
    rng = np.random.default_rng(4)
    puffs, smaller = rng.random((2, 200_000))
    even = np.sort(glsl("even_sum")((1 - b) * puffs + b * smaller, b))
    assert even == pytest.approx(np.linspace(0, 1, len(even)), abs=0.01)


def test_streets_conserve_the_light_of_a_cell():
    chain = mipmap_chain(night_texture(), globe=False)
    size, at = len(chain.image) // 2, 0
    levels = [chain.image[..., 1:3]]
    while size >= 32:
        levels.append(chain.smaller[at : at + 4 * size * size].reshape(size, size, 4)[..., 1:3])
        at, size = at + 4 * size * size, size // 2
    for level in levels:
        assert level.mean(axis=(0, 1)) * (MAX_LIGHT / 255) == pytest.approx([1.0, 1.0], abs=0.05)


@pytest.mark.parametrize("city", CITIES)
def test_cities_send_as_much_light_whatever_a_pixel_is_wide(renderer, city):
    scene = scene_under(CITIES[city], "2026-08-15T00:00:00Z", 150.0, CLEAR, width_km=400.0)
    # pixels of 6 and of 25 km
    near, far = (
        renderer.render(replace(scene, camera=camera(400.0, size)), load_target("tango")).radiance.mean()
        for size in (64, 16)
    )
    assert far == pytest.approx(near, rel=0.1)


@pytest.mark.parametrize("quality", ["default", "high"])
@pytest.mark.parametrize("city", CITIES)
def test_cities_are_as_bright_as_viirs_has_them(renderer, city, quality):
    assert 25 < city_radiance(renderer, CITIES[city], quality=quality) < 60
    # no lava: a few times the mean of the brightest texel of 5 km
    assert city_radiance(renderer, CITIES[city], 3.0, quality=quality) < 300


def test_lamps_are_sodium_and_white(renderer):
    tango, colours = load_target("tango"), []
    for place in CITIES.values():
        scene = scene_under(
            place, "2026-08-15T00:00:00Z", 150.0, CLEAR, width_km=50.0, bands="rgb", quality="high"
        )
        light = renderer.render(scene, tango).radiance.astype(float).reshape(-1, 3)
        colours.append(light[light.sum(axis=1) > np.quantile(light.sum(axis=1), 0.8)])
    red, _, blue = np.concatenate(colours).T
    low, high = np.quantile(blue / red, [0.05, 0.95])
    # 2000 K and 4000 K, a black body's, through the air: 0.05 and 0.54
    assert low < 0.2
    assert high > 0.4


def test_the_unlit_craft_hides_the_lights(renderer):
    tango = load_target("tango")
    scene = scene_under(CITIES["Paris"], "2026-08-15T00:00:00Z", 150.0, CLEAR, width_km=30.0, quality="high")
    dark = replace(
        scene,
        environment=msgspec.structs.replace(CLEAR, earthshine=False),
        t_camera_from_target_m=(0.0, 0.0, 40.0),
        sun_visible_fraction=0.0,
    )
    drawn = renderer.render(dark, tango, labels=True)
    craft = drawn.coverage > 0.999
    assert craft.sum() > 20
    assert drawn.radiance[craft].max() < 1e-3 * np.median(drawn.radiance[drawn.coverage == 0])
