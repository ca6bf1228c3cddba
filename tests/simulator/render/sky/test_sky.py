"""Earth, air, stars and Sun: position, radiance, and switches of the environment."""

from dataclasses import replace

import cv2
import msgspec
import numpy as np
import pytest

from flyaround.simulator.celestial.air_tables import air_tables
from flyaround.simulator.celestial.star_catalogue import star_irradiance_w_m2, stars
from flyaround.simulator.render.projection import PixelRect
from flyaround.simulator.render.sky.star_pass import StarPass
from flyaround.simulator.render.view import build_view
from flyaround.simulator.scene.environments import Environment
from flyaround.simulator.scene.illumination.atmosphere import (
    MultipleScattering,
    airglow_path,
    earth_atmosphere,
    mie_phase,
    path_light,
    rayleigh_phase,
)
from flyaround.simulator.scene.illumination.bands import sun_irradiance_w_m2
from flyaround.simulator.scene.illumination.planets import earth_velocity_c
from flyaround.simulator.world.frames.rotation import matrix_from_quat, quat_from_matrix

pytestmark = pytest.mark.gl
EQUATOR_M, POLE_M = 6_378_137.0, 6_356_752.314245
FAR = (0.0, 0.0, -50.0)  # the target behind the camera: an empty foreground


@pytest.fixture(scope="module")
def speck(draw_kit):
    return draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.5)], [draw_kit.white()])


def _rays(camera):
    y, x = np.mgrid[0 : camera.height_px, 0 : camera.width_px]
    d = np.stack(
        [(x - camera.cx_px) / camera.fx_px, (y - camera.cy_px) / camera.fy_px, np.ones(x.shape)], axis=-1
    )
    return d / np.linalg.norm(d, axis=-1, keepdims=True)


@pytest.mark.parametrize(("latitude_deg", "azimuth_deg"), [(0.0, 40.0), (50.0, 200.0), (85.0, 300.0)])
def test_limb_is_that_of_the_ellipsoid(renderer, draw_kit, speck, latitude_deg, azimuth_deg):
    environment = msgspec.structs.replace(draw_kit.nothing, earth=True)
    scene = draw_kit.scene(
        speck,
        t_m=FAR,
        latitude_deg=latitude_deg,
        azimuth_deg=azimuth_deg,
        off_nadir_deg=68.0,
        sun_camera=(0, -0.9, -1),
        environment=environment,
    )
    image = renderer.render(scene, speck).radiance.astype(float)
    R = matrix_from_quat(scene.q_camera_from_eci_wxyz)
    c = np.array(scene.r_camera_eci_m)
    Q = np.diag([EQUATOR_M**-2, EQUATOR_M**-2, POLE_M**-2])
    errors = []
    for x in range(4, 316, 6):
        column = image[:, x]
        first = int(np.flatnonzero(column > 0)[0])
        # the limb's pixel holds the share of the ground that its lower neighbours have whole
        edge = (
            first + 0.5 - column[first] / column[first + 1]
            if column[first + 1] > column[first]
            else first - 0.5
        )
        low, high = first - 3.0, first + 3.0
        for _ in range(40):
            middle = (low + high) / 2
            d = R.T @ np.array([(x - 161.3) / 600, (middle - 118.6) / 590, 1.0])
            hit = (d @ Q @ c) ** 2 - (d @ Q @ d) * (c @ Q @ c - 1) > 0
            low, high = (low, middle) if hit else (middle, high)
        errors.append(edge - high)
    errors = np.array(errors)
    assert abs(np.median(errors)) < 0.1
    assert np.sqrt(np.mean(errors**2)) < 0.22  # the ground's contrast from pixel to pixel counts too


@pytest.mark.parametrize("bands", ["mono", "rgb"])
def test_limb_glow_matches_the_double_precision_twin(renderer, draw_kit, speck, bands):
    environment = msgspec.structs.replace(draw_kit.nothing, earth=True, atmosphere=True)
    higher = MultipleScattering(np.asarray(air_tables(bands, 100e3).multiple, float), 100e3)
    for sun in ((0.3, -0.5, -1), (0.9, -0.1, 0.3), (0, 0.1, 1)):
        scene = draw_kit.scene(
            speck, t_m=FAR, off_nadir_deg=70.0, sun_camera=sun, environment=environment, bands=bands
        )
        image = renderer.render(scene, speck).radiance.astype(float).reshape(240, 320, -1)
        stretch = np.array([1, 1, EQUATOR_M / POLE_M])
        d = _rays(scene.camera) @ matrix_from_quat(scene.q_camera_from_eci_wxyz) * stretch
        d = (d / np.linalg.norm(d, axis=-1, keepdims=True))[::3, ::7].reshape(-1, 3)
        c, s = stretch * scene.r_camera_eci_m, stretch * scene.r_sun_eci_m
        s = s / np.linalg.norm(s)
        air = earth_atmosphere(bands)
        perigee = np.linalg.norm(np.cross(c, d), axis=1)
        sky = (perigee > air.radius_m + 500) & (perigee < air.top_m)
        light = path_light(air, c, d[sky], s, steps=96, multiple=higher)
        angle = d[sky] @ s
        expected = (
            light.rayleigh * rayleigh_phase(angle)[:, None]
            + light.mie * mie_phase(angle, air.mie_g)[:, None]
            + light.multiple
        )
        expected = expected * sun_irradiance_w_m2(bands, np.linalg.norm(scene.r_sun_eci_m))
        drawn = image[::3, ::7].reshape(-1, image.shape[-1])[sky]
        assert sky.sum() > 300
        error = np.sqrt(np.mean((drawn - expected) ** 2))
        # 45 dB below the brightest: the tables' interpolation, 24 steps against 96
        assert 20 * np.log10(expected.max() / error) > 45


@pytest.mark.parametrize("bands", ["mono", "rgb"])
def test_night_limb_shows_the_airglow_layer(renderer, draw_kit, speck, bands):
    """As bright as its path is long: 5.0e-7 W m-2 sr-1 straight up over 450 to 750 nm, 1.7e-7 in green."""
    glow = msgspec.structs.replace(draw_kit.nothing, earth=True, atmosphere=True, airglow=True)
    place = {"t_m": FAR, "off_nadir_deg": 70.0, "sun_camera": (0.0, 1.0, 0.2), "bands": bands}
    scene = draw_kit.scene(speck, **place, environment=glow)
    image = renderer.render(scene, speck).radiance.astype(float).reshape(240, 320, -1)
    stretch = np.array([1, 1, EQUATOR_M / POLE_M])
    d = _rays(scene.camera) @ matrix_from_quat(scene.q_camera_from_eci_wxyz) * stretch
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    perigee = np.linalg.norm(np.cross(stretch * scene.r_camera_eci_m, d), axis=-1)
    sky = (perigee > EQUATOR_M + 500) & (perigee < EQUATOR_M + 99e3)
    air = earth_atmosphere(bands)
    expected = (
        airglow_path(air, perigee[sky])[:, None] * {"mono": [5.0e-7], "rgb": [1.29e-7, 1.7e-7, 1.4e-7]}[bands]
    )
    # linear between the table's rows, 2 km apart there
    assert np.abs(image[sky] - expected).max() < 0.06 * expected.max()
    assert image[sky].mean() == pytest.approx(expected.mean(), rel=0.01)
    # in front of the ground there is one passage of the layer, above it two
    above = expected[perigee[sky] < EQUATOR_M + 20e3]
    assert np.all(image[perigee < EQUATOR_M - 5e3].max(axis=0) < 0.6 * above.min(axis=0))
    dark = replace(scene, environment=msgspec.structs.replace(glow, airglow=False))
    assert renderer.render(dark, speck).radiance.max() < 1e-12


def test_target_hides_the_earth(renderer, draw_kit, speck):
    environment = msgspec.structs.replace(draw_kit.nothing, earth=True, atmosphere=True)
    scene = draw_kit.scene(speck, sun_camera=(0.3, 0.2, -1), environment=environment)
    seen = renderer.render(scene, speck, labels=True)
    alone = renderer.render(replace(scene, environment=draw_kit.nothing), speck, labels=True)
    covered = seen.coverage == 1
    assert covered.sum() > 5000
    assert np.array_equal(seen.radiance[covered], alone.radiance[covered])
    empty = renderer.render(replace(scene, t_camera_from_target_m=FAR), speck).radiance
    open_sky = seen.coverage == 0
    assert np.array_equal(seen.radiance[open_sky], empty[open_sky])
    edge = (seen.coverage > 0) & (seen.coverage < 1)
    mixed = alone.radiance + (1 - seen.coverage) * empty
    assert seen.radiance[edge] == pytest.approx(mixed[edge], rel=1e-5)


def test_night_is_dark_but_for_cities(renderer, draw_kit, speck):
    lights = Environment(stars=False, sun=False, airglow=False)
    # above northern Italy, the Sun behind the Earth
    place = {"latitude_deg": 45.3, "longitude_deg": 9.5, "t_m": FAR, "sun_camera": (0.0, 0.0, 1.0)}
    night = renderer.render(draw_kit.scene(speck, **place, environment=lights), speck).radiance
    off = msgspec.structs.replace(lights, night_lights=False, moon=False)
    dark = renderer.render(draw_kit.scene(speck, **place, environment=off), speck).radiance
    place["sun_camera"] = (0.2, 0.1, -1.0)
    day = renderer.render(draw_kit.scene(speck, **place, environment=lights), speck).radiance
    day_off = renderer.render(draw_kit.scene(speck, **place, environment=off), speck).radiance
    assert dark.max() < 1e-9
    assert 1e-4 < night.max() < 1e-2
    assert day.min() > 1.0
    assert np.array_equal(day, day_off)


def test_each_switch_changes_its_own_layer(renderer, draw_kit, speck):
    full = Environment(stars=False, sun=False, earthshine=False)
    place = {"latitude_deg": -5.0, "longitude_deg": -33.0, "t_m": FAR, "sun_camera": (0.35, -0.1, -1.0)}

    def draw(**changes):
        return renderer.render(
            draw_kit.scene(speck, **place, environment=msgspec.structs.replace(full, **changes)), speck
        ).radiance

    base = draw()
    clear = draw(clouds=False)
    assert (base - clear).mean() > 1.0  # clouds brighten the sea
    dull = draw(ocean_glint=False)
    assert (base - dull).min() >= -1e-4  # rounding
    assert (base - dull).max() > 2.0
    assert np.array_equal(base, draw(night_lights=False))
    airless = draw(atmosphere=False, clouds=False, ocean_glint=False)
    assert np.median(airless) < 0.5 * np.median(
        draw(clouds=False, ocean_glint=False)
    )  # dark sea, bright haze
    assert not draw(earth=False).any()


def test_same_bytes_after_other_frames(renderer, draw_kit, speck):
    scene = draw_kit.scene(speck, environment=Environment(), off_nadir_deg=60.0, sun_camera=(0.3, -0.4, -1))
    first = renderer.render(scene, speck, labels=True)
    other = replace(scene, bands="rgb", environment=Environment(clouds=False), quality="draft")
    renderer.render(other, speck)
    small = replace(draw_kit.camera, width_px=64, height_px=48)
    renderer.render(
        draw_kit.scene(speck, camera=small, t_m=(0, 0, 1.0), environment=Environment()), speck, labels=True
    )
    again = renderer.render(scene, speck, labels=True)
    assert first.radiance.tobytes() == again.radiance.tobytes()
    assert first.coverage.tobytes() == again.coverage.tobytes()
    assert first.depth_m.tobytes() == again.depth_m.tobytes()


def _pointing(scene, direction_eci):
    """The same scene with the camera looking at a direction."""
    z = direction_eci / np.linalg.norm(direction_eci)
    x = np.cross([0.1, 0.2, 1.0], z)
    x /= np.linalg.norm(x)
    q = quat_from_matrix(np.stack([x, np.cross(z, x), z]))
    return replace(scene, q_camera_from_eci_wxyz=tuple(float(v) for v in q))


def test_star_position_and_brightness(renderer, draw_kit, speck):
    scene = draw_kit.scene(speck, t_m=FAR, environment=msgspec.structs.replace(draw_kit.nothing, stars=True))
    field = stars(scene.epoch_utc, "mono")
    # Vega, Hipparcos 91262: J2000 18h36m56.34s +38d47m01.3s, drifting 0.35 arcsec a year, V = 0.03
    ra, dec = np.radians([(18 + 36 / 60 + 56.34 / 3600) * 15, 38 + 47 / 60 + 1.3 / 3600])
    catalogue = np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])
    vega = int(np.argmax(catalogue @ field.directions))
    assert 5 < np.degrees(np.linalg.norm(field.directions[:, vega] - catalogue)) * 3600 < 15
    scene = _pointing(scene, field.directions[:, vega] + np.array([0.003, 0.002, 0.001]))
    image = renderer.render(scene, speck).radiance.astype(float)
    # seen from a moving Earth
    beta = earth_velocity_c(scene.epoch_utc) + np.array(scene.v_camera_eci_m_s) / 299_792_458.0
    seen = field.directions[:, vega] + beta
    shift = np.degrees(np.arccos(field.directions[:, vega] @ seen / np.linalg.norm(seen))) * 3600
    assert 5 < shift < 27  # 20.5 arcsec times the sine of the angle from the apex, 5 of the orbit
    d = build_view(scene).R_camera_from_eci @ (seen / np.linalg.norm(seen))
    u, v = scene.camera.project(d)
    x0, y0 = round(u) - 2, round(v) - 2
    patch = image[y0 : y0 + 5, x0 : x0 + 5]
    yy, xx = np.mgrid[y0 : y0 + 5, x0 : x0 + 5]
    assert (patch * xx).sum() / patch.sum() == pytest.approx(u, abs=0.01)
    assert (patch * yy).sum() / patch.sum() == pytest.approx(v, abs=0.01)
    solid_angle = d[2] ** 3 / (600.0 * 590.0)
    assert patch.sum() * solid_angle == pytest.approx(field.irradiance_w_m2[0, vega], rel=0.01)
    # its spectrum averaged over 450-750 nm: 3.05e-11 W m-2 nm-1 (Hayes 1985, IAU Symposium 111)
    assert field.irradiance_w_m2[0, vega] == pytest.approx(3.05e-11 * 300, rel=0.08)


@pytest.mark.parametrize("bands", ["mono", "rgb"])
def test_stars_drawn_and_added_when_the_picture_is_read_give_one_picture(
    renderer, draw_kit, monkeypatch, bands
):
    # a plate before a part of the stars, and among those added some whose pixels lie half beyond the border
    target = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.9)], [draw_kit.white()])
    scene = draw_kit.scene(
        target, environment=msgspec.structs.replace(draw_kit.nothing, stars=True), bands=bands
    )
    shared = renderer.render(scene, target).radiance
    stars = []

    def all_of_them(_self, pixels, images, _target):
        images.mark_drawn(PixelRect(0, 0, *images.size))
        stars.append(len(pixels))
        return np.ones(len(pixels), bool)

    monkeypatch.setattr(StarPass, "may_be_hidden", all_of_them)
    drawn = renderer.render(scene, target).radiance
    assert stars[0] > 0
    lit = np.count_nonzero(drawn)
    assert lit > 1000
    assert np.count_nonzero(shared) == lit
    # shaders know a star's place to a 32-bit float, 2^-16 of a pixel here
    beside = cv2.dilate(drawn, np.ones((3, 3)))
    assert np.all(np.abs(shared - drawn) <= 5e-5 * beside)


def test_star_of_solar_colour_has_the_solar_spectrum():
    sun = star_irradiance_w_m2(np.array([-26.64]), np.array([0.65]), "rgb")[0]
    assert sun == pytest.approx(sun_irradiance_w_m2("rgb", 149_597_870_700.0), rel=0.02)


def test_sun_disc_holds_the_suns_irradiance(renderer, draw_kit, speck):
    scene = draw_kit.scene(
        speck,
        t_m=FAR,
        off_nadir_deg=180,
        sun_camera=(0.02, 0.03, 1.0),
        environment=msgspec.structs.replace(draw_kit.nothing, sun=True),
    )
    image = renderer.render(scene, speck).radiance.astype(float)
    solid_angle = _rays(scene.camera)[..., 2] ** 3 / (600.0 * 590.0)
    irradiance = sun_irradiance_w_m2("mono", np.linalg.norm(scene.r_sun_eci_m))[0]
    assert (image * solid_angle).sum() == pytest.approx(irradiance, rel=0.02)
    assert image.max() > 65504  # more than a 16-bit float holds
    below = renderer.render(replace(scene, r_sun_eci_m=tuple(-np.array(scene.r_sun_eci_m))), speck).radiance
    assert not below.any()


def test_earth_hides_the_sun_and_stars(renderer, draw_kit, speck):
    environment = msgspec.structs.replace(draw_kit.nothing, earth=True, sun=True, stars=True)
    scene = draw_kit.scene(speck, t_m=FAR, sun_camera=(0.02, 0.03, 1.0), environment=environment)
    assert not renderer.render(scene, speck).radiance.any()
