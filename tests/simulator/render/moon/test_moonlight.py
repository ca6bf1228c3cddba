"""Moonlight on the Earth's night side against sunlight on the day side."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.scene.environments import Environment
from flyaround.simulator.scene.illumination.moonlight import moonlight_share
from flyaround.simulator.scene.state import TargetRef
from flyaround.simulator.scene.viewpoint import scene_above

pytestmark = pytest.mark.gl
CAMERA = Camera(width_px=96, height_px=64, fx_px=140.0, fy_px=140.0, cx_px=47.5, cy_px=31.5)
NO_AIR = Environment(atmosphere=False, night_lights=False, stars=False)


@pytest.fixture(scope="module")
def speck(draw_kit):
    return draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.5)], [draw_kit.white()])


def by_day_and_by_moonlight(speck, environment, bands="mono"):
    """One morning over the Aegean, and the same with a full Moon where the Sun was."""
    ref = TargetRef(name=speck.name, sha256=speck.sha256)
    day = scene_above("2026-06-20T08:30:00Z", (38.0, 24.0, 420.0), target=ref, camera=CAMERA, bands=bands,
        environment=environment, azimuth_deg=40.0, off_nadir_deg=30.0)  # fmt: skip
    sun = np.asarray(day.r_sun_eci_m)
    moon = sun / np.linalg.norm(sun) * 3.844e8
    night = replace(day, r_sun_eci_m=vec3(-sun), sun_visible_fraction=0.0)
    return day, night.with_body("moon", r_eci_m=vec3(moon))


@pytest.mark.parametrize("bands", ["mono", "rgb"])
def test_without_air_the_night_is_the_day_in_the_moons_light(renderer, speck, bands):
    day, night = by_day_and_by_moonlight(speck, NO_AIR, bands)
    sun = np.asarray(night.r_sun_eci_m)
    share = moonlight_share(np.asarray(night.body("moon").r_eci_m), sun / np.linalg.norm(sun))
    lit, moonlit = (renderer.render(scene, speck).radiance for scene in (day, night))
    assert share == pytest.approx(2.5e-6, rel=0.01)
    assert lit.min() > 0.1
    # clouds, their shadows, relief and glint are the same pattern
    assert np.abs(moonlit / (lit * share) - 1).max() < 0.02


@pytest.mark.parametrize("bands", ["mono", "rgb"])
def test_air_attenuates_moonlight_like_sunlight(renderer, speck, bands):
    day, night = by_day_and_by_moonlight(speck, msgspec.structs.replace(NO_AIR, atmosphere=True), bands)
    lit, moonlit = (renderer.render(scene, speck).radiance for scene in (day, night))
    if bands == "rgb":
        lit, moonlit = lit[..., 0], moonlit[..., 0]
    # the day has the air's own light besides, which is least in red and where clouds are brightest
    bright = lit > np.quantile(lit, 0.95)
    assert 0.65 < np.median(moonlit[bright] / lit[bright]) / 2.5e-6 < 1.0
    assert np.median(moonlit / lit) / 2.5e-6 < np.median(moonlit[bright] / lit[bright]) / 2.5e-6


def test_night_is_dark_at_new_moon_and_without_moon(renderer, speck):
    _, night = by_day_and_by_moonlight(speck, NO_AIR)
    new = night.with_body("moon", r_eci_m=vec3(-np.asarray(night.body("moon").r_eci_m)))
    none = replace(night, environment=msgspec.structs.replace(NO_AIR, moon=False))
    assert renderer.render(night, speck).radiance.mean() > 1e-5
    for scene in (new, none):
        assert renderer.render(scene, speck).radiance.max() < 1e-8


def test_the_day_is_the_same_with_and_without_a_moon_behind_the_earth(renderer, speck):
    day, _ = by_day_and_by_moonlight(
        speck, msgspec.structs.replace(NO_AIR, atmosphere=True, night_lights=True)
    )
    sun = np.asarray(day.r_sun_eci_m)
    behind = day.with_body("moon", r_eci_m=vec3(-sun / np.linalg.norm(sun) * 3.844e8))
    none = replace(behind, environment=msgspec.structs.replace(behind.environment, moon=False))
    assert np.array_equal(*(renderer.render(s, speck).radiance for s in (behind, none)))
