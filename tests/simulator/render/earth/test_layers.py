"""The Earth's layers: months, relief, parallax of the clouds, presets."""

import ctypes

import cv2
import msgspec
import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

import flyaround.simulator.render.earth.earth_pass as passes
from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.celestial.earth_maps import COAST, DAY, decode_map
from flyaround.simulator.celestial.sea_ice import (
    EXTENT_NORTH,
    EXTENT_SOUTH,
    HEIGHT,
    WIDTH,
    extent_m2,
    sea_ice,
)
from flyaround.simulator.celestial.seasons import ANCHORS, HEIGHT_MAP, season
from flyaround.simulator.render.gl.library import gl_library
from flyaround.simulator.render.gl.mipmaps import mipmapped_texture
from flyaround.simulator.scene.environments import Environment
from flyaround.simulator.scene.illumination.bands import sun_irradiance_w_m2
from flyaround.simulator.scene.state import TargetRef
from flyaround.simulator.scene.viewpoint import place_itrs_m, scene_above
from flyaround.simulator.world.ephemeris.earth_orientation import q_itrs_from_eci
from flyaround.simulator.world.ephemeris.sun_moon import sun_eci_m
from flyaround.simulator.world.frames.rotation import matrix_from_quat
from flyaround.simulator.world.time.instant import Instant

pytestmark = pytest.mark.gl
CAMERA = Camera(width_px=96, height_px=64, fx_px=140.0, fy_px=140.0, cx_px=47.5, cy_px=31.5)
CLEAR = Environment(clouds=False, stars=False, moon=False)


@pytest.fixture(scope="module")
def speck(draw_kit):
    return draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.5)], [draw_kit.white()])


@pytest.fixture(scope="module")
def draw(renderer, speck):
    def run(epoch, place, environment=CLEAR, **more):
        more = {"bands": "mono", "camera": CAMERA} | more
        ref = TargetRef(name=speck.name, sha256=speck.sha256)
        scene = scene_above(epoch, place, target=ref, environment=environment, **more)
        return renderer.render(scene, speck).radiance

    return run


def test_dates_interpolate_between_months():
    for month, day in ANCHORS.items():
        for shift in (-20, 20):
            moment = np.datetime64("2027-01-01") + np.timedelta64(int(day - 1 + shift), "D")
            now = season(f"{moment}T00:00:00Z")
            assert 0 <= now.share <= 1
            assert (now.after if shift < 0 else now.before) == month or abs(ANCHORS[7] - ANCHORS[8]) > 20
    assert season("2026-12-31T00:00:00Z").before == 10
    assert season("2026-01-02T00:00:00Z").after == 1
    assert season("2026-01-02T00:00:00Z").share > 0.8


def test_snow_in_winter_and_the_same_place_in_summer(draw):
    # the steppe north of the Aral Sea near local noon; the Sun is three times lower in January
    place = (52.0, 65.0, 500.0)
    winter, summer = draw("2026-01-20T08:00:00Z", place), draw("2026-08-10T08:00:00Z", place)
    assert np.median(winter) > 1.2 * np.median(summer)
    never = msgspec.structs.replace(CLEAR, seasons=False)
    assert np.median(draw("2026-01-20T08:00:00Z", place, never)) < 0.6 * np.median(winter)
    assert (
        np.abs(draw("2026-08-15T08:00:00Z", place, never) / draw("2026-08-15T08:00:00Z", place) - 1).max()
        < 0.02
    )


@pytest.mark.parametrize("hour", ["06", "11", "16"])
def test_mountains_are_bright_on_the_side_of_the_sun(draw, hour):
    """East, south and west of the Alps: the slope of the ground by which light changes most falls towards the Sun."""
    epoch, place = f"2026-02-20T{hour}:30:00Z", (46.5, 10.0, 500.0)
    if hour == "06":
        epoch = "2026-05-20T06:00:00Z"
    bare = msgspec.structs.replace(CLEAR, atmosphere=False)
    light = draw(epoch, place, bare) / draw(epoch, place, msgspec.structs.replace(bare, relief=False))
    # north is up; both about the middle of the picture, where a pixel is 3.6 km and a map's texel 9.9 km
    height = decode_map(HEIGHT_MAP, cv2.IMREAD_GRAYSCALE, None).astype(float)
    texel_deg = 180 / height.shape[0]
    x, y = np.meshgrid(np.arange(96) - 47.5, 31.5 - np.arange(64))
    east_deg, north_deg = (k * 500 / 140 / 111.2 for k in (x / np.cos(np.radians(place[0])), y))
    column = ((place[1] + east_deg + 180) / texel_deg).astype(int)
    row = ((90 - place[0] - north_deg) / texel_deg).astype(int)
    falls = [-np.diff(height, axis=1, append=0)[row, column], np.diff(height, axis=0, append=0)[row, column]]
    moment = Instant.from_utc(epoch)
    sun = (
        place_itrs_m(*place)[1]
        @ matrix_from_quat(q_itrs_from_eci(moment))
        @ sun_eci_m(moment.tt1, moment.tt2)
    )
    brighter, *_ = np.linalg.lstsq(
        np.stack([f.ravel() for f in falls], axis=1), light.ravel() - light.mean(), rcond=None
    )
    assert brighter @ sun[:2] > 0.85 * np.linalg.norm(brighter) * np.linalg.norm(sun[:2])


@pytest.mark.parametrize("quality", ["default", "high"])
def test_clouds_lie_between_their_shadows_and_the_sun(draw, monkeypatch, quality):
    """From straight above: what grows darker as clouds rise from the ground has a cloud on the side of the Sun."""
    world = msgspec.structs.replace(CLEAR, atmosphere=False)
    camera = Camera(width_px=96, height_px=96, fx_px=800.0, fy_px=800.0, cx_px=47.5, cy_px=47.5)
    # the Sun in the east, to the right, and in the west
    for epoch, sunward in (("2026-03-20T05:40:00Z", 1), ("2026-03-20T14:50:00Z", -1)):
        images = []
        for clouds, height_km in ((False, 0.0), (True, 0.0), (True, 2.0)):
            monkeypatch.setattr(passes, "CLOUD_KM", height_km)
            # programs are kept by their environment: one switch more, of what is not in view, makes another
            seen = msgspec.structs.replace(world, clouds=clouds, planets=height_km == 0)
            images.append(draw(epoch, (14.0, 28.0, 500.0), seen, quality=quality, camera=camera))
        clear, low, high = images
        cloud, darker = low / clear, (low - high) / clear
        # a shadow is 5 km long, 8 pixels
        before, behind = (
            np.corrcoef(np.roll(cloud, k * sunward, axis=1)[:, 8:-8].ravel(), darker[:, 8:-8].ravel())[0, 1]
            for k in (-8, 8)
        )
        assert before > 0.05
        assert behind < before - 0.05


@pytest.mark.parametrize("quality", ["default", "high"])
def test_the_ground_stays_where_it_is_whatever_the_height_of_the_clouds(draw, monkeypatch, quality):
    world = msgspec.structs.replace(CLEAR, atmosphere=False)
    view = {"off_nadir_deg": 45.0, "quality": quality}
    low, high = [], []
    for kept, height_km in ((low, 0.0), (high, 6.0)):
        monkeypatch.setattr(passes, "CLOUD_KM", height_km)
        for clouds in (False, True):
            # programs are kept by their environment: one switch more, of what is not in view, makes another
            seen = msgspec.structs.replace(world, clouds=clouds, planets=height_km == 0, sun=False)
            kept.append(draw("2026-07-10T10:00:00Z", (26.0, 14.0, 500.0), seen, **view))
    assert not np.array_equal(low[1], high[1])
    assert low[0].std() / low[0].mean() > 0.02  # there is detail to be moved
    assert np.allclose(low[0], high[0], rtol=1e-4)
    # under clouds too, beside them: the desert is clear but for a few
    assert np.mean(np.abs(low[1] / high[1] - 1) < 0.01) > 0.6


def test_one_optics_changes_the_image(draw):
    world = Environment(stars=False, moon=False)
    place, epoch = (-5.0, -33.0, 700.0), "2026-03-20T14:30:00Z"
    alike = draw(epoch, place, msgspec.structs.replace(world, undifferentiated=True))
    assert np.abs(alike - draw(epoch, place, world)).mean() > 0.5
    # without optics of their own neither glint nor relief has a say
    again = draw(
        epoch, place, msgspec.structs.replace(world, undifferentiated=True, ocean_glint=False, relief=False)
    )
    assert np.array_equal(alike, again)


def disc_reflection(draw, phase_deg, bands="mono"):
    """Light of the whole Earth over that of a white Lambert disc facing the Sun, mean of six views."""
    size, field = 96, 0.046
    camera = Camera(
        width_px=size, height_px=size, fx_px=size / field, fy_px=size / field, cx_px=47.5, cy_px=47.5
    )
    altitude_km = 300e3
    share = []
    for hour in (1, 9, 17):
        for side in (-phase_deg, phase_deg):
            # at an equinox the Sun stands over the equator
            longitude = (-15 * (hour - 12) + side + 180) % 360 - 180
            world = Environment(moon=False, stars=False, sun=False)
            image = draw(
                f"2026-03-20T{hour:02d}:00:00Z",
                (0.0, longitude, altitude_km),
                world,
                camera=camera,
                bands=bands,
            )
            flux = image.astype(float).sum(axis=(0, 1)) * (field / size) ** 2
            sun = sun_irradiance_w_m2(bands, 0.9959 * 149_597_870_700.0)  # distance of the day
            share.append(flux / sun * ((altitude_km + 6378.137) / 6378.137) ** 2)
    return float(np.mean(share))


def test_disc_integrated_light_of_the_earth(draw):
    phases = (5.0, 30.0, 60.0, 90.0, 120.0, 150.0)
    light = [disc_reflection(draw, p) for p in phases]
    # two thirds of the spherical albedo of 0.295 (Penttila et al. 2022), times the anisotropy of what DSCOVR sees from
    # near the Sun, some 1.27 (Su et al. 2018, J. Geophys. Res. 123, 11479)
    assert light[0] == pytest.approx(0.25, rel=0.15)
    # Bond albedo: twice the integral of the disc's light over the sine of the phase
    curve = PchipInterpolator(np.radians([0.0, *phases, 180.0]), [light[0], *light, 0.0])
    angle = np.linspace(0, np.pi, 181)
    assert 0.25 < 2 * np.trapezoid(curve(angle) * np.sin(angle), angle) < 0.35


def test_thickness_of_the_air_is_the_height_of_its_glow(draw):
    camera = Camera(width_px=64, height_px=160, fx_px=1200.0, fy_px=1200.0, cx_px=31.5, cy_px=79.5)
    tops = []
    for thickness_km in (25.0, 100.0):
        world = Environment(
            stars=False, planets=False, moon=False, sun=False, atmosphere_thickness_km=thickness_km
        )
        look = {"camera": camera, "off_nadir_deg": 64.5, "azimuth_deg": 90.0}
        column = draw("2026-03-20T12:00:00Z", (0.0, 0.0, 700.0), world, **look)[:, 32]
        first = int(np.flatnonzero(column > 1e-4)[0])
        ray = np.radians(64.5) + np.arctan((79.5 - first) / 1200.0)
        tops.append(7078.137 * np.sin(ray) - 6378.137)
    assert tops[0] == pytest.approx(25.0, abs=3.0)
    assert 70 < tops[1] <= 101


def test_twilight_is_orange_at_its_base_and_blue_above(draw):
    # the Sun is 2 degrees below the horizon of the limb
    camera = Camera(width_px=16, height_px=160, fx_px=1200.0, fy_px=1200.0, cx_px=7.5, cy_px=79.5)
    look = {"camera": camera, "off_nadir_deg": 64.5, "azimuth_deg": 270.0, "bands": "rgb"}
    air = Environment(clouds=False, stars=False, planets=False, moon=False)
    column = draw("2026-03-20T19:59:00Z", (0.0, 0.0, 700.0), air, **look)[:, 8].astype(float)
    ray = np.radians(64.5) + np.arctan((79.5 - np.arange(160)) / 1200.0)
    height_km = 7078.137 * np.sin(ray) - 6378.137
    light = column / sun_irradiance_w_m2("rgb", 1.496e11)
    (base, ozone, thin) = (light[np.abs(height_km - h).argmin()] for h in (8.0, 33.0, 65.0))
    # thin air scatters as its Rayleigh depths are, 0.2312 and 0.0502 (Bodhaine et al. 1999)
    assert thin[2] / thin[0] == pytest.approx(0.2312 / 0.0502, rel=0.03)
    # ozone absorbs red and green along the beam (Hulburt 1953, J. Opt. Soc. Am. 43, 113)
    assert ozone[2] / ozone[0] > 1.1 * 0.2312 / 0.0502
    # dense air has scattered the blue out of the beam, and half of the green
    assert base[2] < 0.2 * base[0]
    assert base[1] < 0.5 * base[0]


def test_the_edges_of_the_sea_ice_enclose_the_extent_of_the_month():
    coast = decode_map(COAST, cv2.IMREAD_GRAYSCALE, (WIDTH * 2, HEIGHT * 2))
    # shelves of ice are sea in Natural Earth; the day map shows them white, and they are drawn as land
    shelf = decode_map(DAY, cv2.IMREAD_GRAYSCALE, (WIDTH * 2, HEIGHT * 2)) > 150
    shelf[: int(HEIGHT * 2 * 160 / 180)] = False  # most lie south of 70 degrees
    sea = cv2.resize(
        ((coast < 128) & ~shelf).astype(np.float32), (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA
    )
    for month in range(1, 13):
        north, south = extent_m2(sea_ice(f"2026-{month:02d}-15T12:00:00Z") / 255, sea)
        assert north == pytest.approx(EXTENT_NORTH[month - 1] * 1e12, rel=0.1)
        assert south == pytest.approx(EXTENT_SOUTH[month - 1] * 1e12, rel=0.1)


def test_sea_ice_matches_place_and_season(draw):
    bare = msgspec.structs.replace(CLEAR, atmosphere=False)
    view = {"off_nadir_deg": 20.0, "azimuth_deg": 180.0}

    def gain(epoch, latitude, longitude, **more):
        place = (latitude, longitude, 700.0)
        light, dark = (
            draw(epoch, place, msgspec.structs.replace(bare, sea_ice=on), **view, **more)
            for on in (True, False)
        )
        return light.mean() / dark.mean()

    for more in ({}, {"quality": "high"}, {"bands": "rgb"}):
        assert gain("2026-04-15T12:00:00Z", 80.0, 0.0, **more) > 4  # north of Fram Strait, snow on ice
    assert gain("2026-07-15T12:00:00Z", 70.0, 0.0) == 1.0  # the Norwegian Sea never freezes
    assert gain("2026-04-15T20:00:00Z", 60.0, -85.0) > 4  # Hudson Bay in spring
    assert gain("2026-09-10T20:00:00Z", 60.0, -85.0) < 1.05  # and in late summer
    assert gain("2026-10-15T12:00:00Z", -62.0, 0.0) > 4  # the Weddell Sea
    assert gain("2026-02-15T12:00:00Z", -62.0, 0.0) < 1.05
    assert gain("2026-04-15T12:00:00Z", 30.0, -40.0) == 1.0


def test_ice_texture_of_a_past_day_is_freed(draw, monkeypatch):
    # a data set's frames have a day each: with 1.4 MB left of every one a long capture took gigabytes
    library, names = gl_library(), set()
    if library is None:
        pytest.skip("moderngl frees the textures that it makes")
    monkeypatch.setattr(library.glIsTexture, "restype", ctypes.c_ubyte)

    def upload(context, levels):
        texture = mipmapped_texture(context, levels)
        if texture.size == (WIDTH, HEIGHT):
            names.add(texture.glo)
        return texture

    monkeypatch.setattr(passes, "mipmapped_texture", upload)
    for day in (1, 2, 3):
        draw(f"2026-04-{day:02d}T12:00:00Z", (80.0, 0.0, 700.0))
        assert sum(bool(library.glIsTexture(name)) for name in names) == 1


def test_ice_edge_is_ragged_and_depends_only_on_the_day(draw):
    ice = sea_ice("2026-03-10T12:00:00Z")
    assert np.array_equal(ice, sea_ice("2031-03-10T00:00:00Z"))
    # the latitude of the first ice, each quarter of a degree from 20 to 60 W: rough at small scales and large
    first = HEIGHT - 1 - np.argmax((ice[: HEIGHT // 2] > 40)[::-1], axis=0)[480:640] - HEIGHT // 2
    for step in (2, 8):
        assert 0.2 < np.abs(first[step:] - first[:-step]).mean() / 4 < 4


@pytest.mark.parametrize(("bands", "quality"), [("mono", "default"), ("rgb", "default"), ("rgb", "high")])
def test_shallow_water_is_brighter_than_deep(draw, bands, quality):
    bare = msgspec.structs.replace(CLEAR, atmosphere=False, ocean_glint=False)
    small = Camera(width_px=32, height_px=32, fx_px=200.0, fy_px=200.0, cx_px=15.5, cy_px=15.5)

    def sea(latitude, longitude):
        place = (latitude, longitude, 500.0)
        view = {"camera": small, "bands": bands, "quality": quality}
        return np.median(draw("2026-06-10T17:00:00Z", place, bare, **view).reshape(1024, -1), axis=0)

    bank, ocean = sea(24.1, -78.6), sea(26.5, -68.0)  # the Great Bahama Bank
    assert 2.5 < bank.mean() / ocean.mean() < 8  # white sand under some metres of clear water
    if bands == "rgb":
        assert bank[1] > 3 * ocean[1]  # it is green that comes back
        assert bank[0] < bank[1] / 2
        # clear water: reflectance falls from blue to red by some eight times (Morel & Maritorena 2001, fig. 8)
        red, green, blue = ocean / sun_irradiance_w_m2("rgb", 1.5e11)
        assert blue > 1.7 * green > 1.7**2 * red


def test_forests_are_as_dark_as_canopies_are_and_no_darker(draw):
    bare = msgspec.structs.replace(CLEAR, atmosphere=False)
    small = Camera(width_px=32, height_px=32, fx_px=200.0, fy_px=200.0, cx_px=15.5, cy_px=15.5)
    # the Amazon with the Sun at the zenith; leaves are up to 1.37 times as bright towards the Sun
    light = draw("2026-09-20T16:15:00Z", (-3.0, -66.0, 500.0), bare, camera=small, bands="rgb").mean((0, 1))
    red, green, blue = np.pi * light / sun_irradiance_w_m2("rgb", 1.505e11) / 1.37
    # canopies in the visible (Asner 1998, Remote Sensing of Environment 64, 234): 0.02-0.04, 0.03-0.07, 0.01-0.03
    assert 0.02 < red < 0.04
    assert 0.03 < green < 0.07
    assert 0.01 < blue < 0.03


@pytest.mark.parametrize("bands", ["mono", "rgb"])
def test_the_high_preset_draws_land_crisper_and_as_bright(draw, bands):
    # the Nile's valley among the desert
    plain, fine = (
        draw("2026-03-20T09:30:00Z", (26.5, 31.5, 420.0), bands=bands, quality=quality)
        for quality in ("default", "high")
    )
    steps = [np.abs(np.diff(image, axis=1)).mean() for image in (plain, fine)]
    assert steps[1] > 1.2 * steps[0]
    assert fine.mean() == pytest.approx(plain.mean(), rel=0.03)


@pytest.mark.parametrize("altitude_km", [420.0, 5000.0, 35_786.0])
def test_the_high_preset_draws_clouds_as_bright(draw, altitude_km):
    # the pattern of the clouds differs between the presets: broken cloud from near needs the mean of several places
    light = [
        [
            draw(
                f"2026-03-20T{hour:02d}:00:00Z",
                (lat, 180.0 - 15.0 * hour, altitude_km),
                Environment(),
                quality=quality,
            ).mean()
            for hour in (3, 13, 20)
            for lat in (-25.0, 0.0, 25.0)
        ]
        for quality in ("default", "high")
    ]
    assert np.mean(light[1]) == pytest.approx(np.mean(light[0]), rel=0.04 if altitude_km < 1000 else 0.02)
