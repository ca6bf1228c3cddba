"""The Moon: irradiance, phase, position, occultations."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.celestial.craters import BROAD_MAX_PX, SIZE, SLOPE_MAX, crater_texture
from flyaround.simulator.render.moon.moon_pass import BROAD_KM
from flyaround.simulator.scene.environments import Environment
from flyaround.simulator.scene.illumination.bands import sun_irradiance_w_m2
from flyaround.simulator.scene.illumination.moonlight import disc_phase, lommel_seeliger_disc, surface_phase
from flyaround.simulator.scene.illumination.refraction import shadow_profile, sunlight_past_earth
from flyaround.simulator.world.ephemeris.body import earth_and_moon
from flyaround.simulator.world.frames.rotation import matrix_from_quat, quat_from_matrix

pytestmark = pytest.mark.gl
AU_M, MOON_M = 149_597_870_700.0, 384_400_000.0
FAR = (0.0, 0.0, -50.0)


@pytest.fixture(scope="module")
def speck(draw_kit):
    return draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.5)], [draw_kit.white()])


UNTURNED = (1.0, 0.0, 0.0, 0.0)


def _scene(
    draw_kit,
    speck,
    *,
    camera_eci,
    look_eci,
    moon_eci,
    sun_eci,
    environment,
    fov_rad=0.02,
    size=96,
    q_moon=UNTURNED,
    **more,
):
    z = np.asarray(look_eci, float) / np.linalg.norm(look_eci)
    x = np.cross([0.1, 0.2, 1.0], z)
    x /= np.linalg.norm(x)
    R_ce = np.stack([x, np.cross(z, x), z])
    middle = (size - 1) / 2
    f = size / fov_rad
    camera = Camera(width_px=size, height_px=size, fx_px=f, fy_px=f, cx_px=middle, cy_px=middle)
    scene = draw_kit.scene(speck, t_m=FAR, camera=camera, environment=environment)
    camera_eci = np.asarray(camera_eci, float)
    return replace(
        scene,
        r_camera_eci_m=tuple(map(float, camera_eci)),
        r_target_eci_m=tuple(map(float, camera_eci + R_ce.T @ FAR)),
        bodies=earth_and_moon(tuple(map(float, moon_eci)), q_moon_from_eci_wxyz=q_moon),
        r_sun_eci_m=tuple(map(float, sun_eci)),
        q_camera_from_eci_wxyz=quat_from_matrix(R_ce),
        **more,
    )


def _facing(phase_rad):
    """Orientation of the Moon with its near side to -x of ECI, and a far Sun at a phase angle."""
    R_moon_from_eci = np.diag([-1.0, -1.0, 1.0])
    sun = np.array([MOON_M, 0, 0]) + AU_M * np.array([-np.cos(phase_rad), np.sin(phase_rad), 0])
    return quat_from_matrix(R_moon_from_eci), sun


@pytest.mark.parametrize("phase_deg", [5.0, 50.0, 100.0])
def test_moonlight_matches_published_irradiance(renderer, draw_kit, speck, phase_deg):
    only = msgspec.structs.replace(draw_kit.nothing, moon=True)
    irradiance = []
    for phase in np.radians([phase_deg, -phase_deg]):
        q, sun = _facing(phase)
        # the camera at the Earth's centre, as the published figures have it
        scene = _scene(
            draw_kit, speck, camera_eci=(1.0, 0, 0), look_eci=(1, 0, 0), moon_eci=(MOON_M, 0, 0), sun_eci=sun,
            environment=only, fov_rad=0.012, q_moon=q,
        )  # fmt: skip
        irradiance.append(renderer.render(scene, speck).radiance.astype(float).sum() * (0.012 / 96) ** 2)
    # V = -12.74 at full against the Sun's -26.76 (Allen 2000), means of the waxing and the waning Moon
    published = (
        sun_irradiance_w_m2("mono", AU_M)[0]
        * 10 ** (-0.4 * (-12.74 + 26.76))
        * disc_phase(np.radians(phase_deg))
    )
    assert np.mean(irradiance) == pytest.approx(published, rel=0.15)


def test_night_side_of_the_moon_has_only_earthshine(renderer, draw_kit, speck):
    """From the Earth, a thick crescent: beyond the terminator the Moon shines by what a gibbous Earth sends."""
    drawn, crescent = {}, 2.0
    nearly_full = 0.06  # no nearer: the Earth's shadow
    for phase in (nearly_full, crescent):
        q, sun = _facing(phase)
        scene = _scene(
            draw_kit, speck, camera_eci=(1.0, 0, 0), look_eci=(1, 0, 0), moon_eci=(MOON_M, 0, 0), sun_eci=sun,
            environment=msgspec.structs.replace(draw_kit.nothing, moon=True), fov_rad=0.012, q_moon=q,
        )  # fmt: skip
        drawn[phase] = renderer.render(scene, speck).radiance.astype(float)
    full, thin = drawn.values()
    # where each pixel's ray meets the sphere, and the Sun's height there
    v, u = np.mgrid[:96, :96]
    rays = scene.camera.unproject(np.stack([u, v], axis=-1).reshape(-1, 2).astype(float))
    d = np.concatenate([rays, np.ones((len(rays), 1))], axis=1)
    d = d / np.linalg.norm(d, axis=1, keepdims=True) @ matrix_from_quat(scene.q_camera_from_eci_wxyz)
    moon = np.array([MOON_M - 1.0, 0, 0])
    along = d @ moon
    inside = along**2 - moon @ moon + 1_737_400.0**2
    on = (inside > 0.1 * 1_737_400.0**2).reshape(96, 96)
    normal = (d * (along - np.sqrt(np.maximum(inside, 0)))[:, None] - moon) / 1_737_400.0
    to_sun = np.array(scene.r_sun_eci_m) - scene.body("moon").r_eci_m
    height = (normal @ to_sun / np.linalg.norm(to_sun)).reshape(96, 96)
    night, day = on & (height < -0.05), on & (height > 0.2)
    assert min(night.sum(), day.sum()) > 400
    assert thin.min() >= 0
    # against the full Moon the ground's albedo cancels: the full Earth of V -16.8 at the Moon's distance, the Sun of
    # -26.76 (Allen 2000), and the phase of a Lambert sphere
    share = thin[night] / full[night] * disc_phase(nearly_full)
    lambert = (np.sin(crescent) - crescent * np.cos(crescent)) / np.pi
    assert np.median(share) == pytest.approx(lambert * 10 ** (-0.4 * (-16.8 + 26.76)), rel=0.25)
    assert share.max() < 2 * np.median(share)
    assert share.min() > 0.5 * np.median(share)
    assert thin[day].min() > 100 * thin[night].max()


def test_no_slope_is_lit_from_below_the_horizon_nor_from_behind(renderer, draw_kit, speck):
    """Close to the ground, where craters are resolved: with the Sun 5 degrees under the horizon none sees it."""
    lit = []
    for height_deg in (-5.0, 3.0):
        # 10 km up, looking down at the near side's middle
        sun = np.radians(90 - height_deg)
        scene = _scene(
            draw_kit, speck, camera_eci=(MOON_M - 1_747_400.0, 0, 0), look_eci=(1, 0, 0), moon_eci=(MOON_M, 0, 0),
            sun_eci=np.array([MOON_M, 0, 0]) + AU_M * np.array([-np.cos(sun), np.sin(sun), 0]), fov_rad=0.8,
            environment=msgspec.structs.replace(draw_kit.nothing, moon=True), q_moon=_facing(0.0)[0],
        )  # fmt: skip
        lit.append(renderer.render(scene, speck).radiance.astype(float))
    under, over = lit
    earthlight = np.median(under)
    # slopes turn to and from the Earth, at the zenith, too
    assert 0 < under.min() <= under.max() < 2 * earthlight
    # grazing light leaves what is turned away in the dark, and only that
    assert 0.03 < np.mean(over < 2 * earthlight) < 0.6
    assert 0.1 < np.mean(over < 0.3 * np.median(over)) < 0.6
    assert over.min() > 0.5 * under.min()
    assert np.median(over) > 5 * earthlight


@pytest.mark.parametrize("pole", [1.0, -1.0])
def test_ground_that_rises_to_the_sun_is_dark_and_ground_that_falls_to_it_bright(
    renderer, draw_kit, speck, pole
):
    """Over a pole, where the plane of the craters has the Moon's own x and y; or craters would look like hills."""
    moon_km = 1737.4
    broad = crater_texture(BROAD_MAX_PX, BROAD_KM / SIZE)[..., :2].astype(float) / 255 - 0.5
    for azimuth in np.radians([10.0, 130.0, 250.0]):
        sun = np.array([np.cos(azimuth), np.sin(azimuth), 0.5 * pole])
        scene = _scene(
            draw_kit, speck, camera_eci=(MOON_M, 0, 1e3 * pole * (moon_km + 100)), look_eci=(0, 0, -pole),
            moon_eci=(MOON_M, 0, 0), sun_eci=np.array([MOON_M, 0, 0]) + AU_M * sun, fov_rad=0.4,
            environment=msgspec.structs.replace(draw_kit.nothing, moon=True), q_moon=UNTURNED,
        )  # fmt: skip
        image = renderer.render(scene, speck).radiance.astype(float).ravel()
        v, u = np.mgrid[:96, :96]
        rays = scene.camera.rays(np.stack([u, v], axis=-1).reshape(-1, 2).astype(float))
        d = rays @ matrix_from_quat(scene.q_camera_from_eci_wxyz)
        ground_km = 100 * d[:, :2] / np.abs(d[:, 2:])
        at = ground_km + moon_km * np.array([0.12, -0.08]) * pole  # the tile's place at the pole
        column, row = (np.floor(at / BROAD_KM * SIZE).astype(int) % SIZE).T
        rise = 2 * SLOPE_MAX * broad[row, column] @ sun[:2]  # towards the Sun
        assert np.corrcoef(image, rise)[0, 1] < -0.45


def test_moon_phase_curve_matches_measurements():
    # Rougier (1933) as Allen, Astrophysical Quantities (1976), section 66, has it; over 10 degrees, clear of the surge
    phase_deg = np.array([10, 20, 30, 40, 50, 60, 70, 80, 90, 100, 110, 120])
    measured = np.array([0.809, 0.625, 0.483, 0.377, 0.288, 0.225, 0.172, 0.127, 0.089, 0.061, 0.041, 0.027])
    drawn = disc_phase(np.radians(phase_deg))
    assert drawn / drawn[0] == pytest.approx(measured / measured[0], rel=0.1)
    # Buratti, Hillier & Wang (1996): more than 40 % between 4 and 0 degrees
    near = surface_phase(np.radians([0.0, 4.0]))
    assert near[0] / near[1] == pytest.approx(1.4, rel=0.1)


def test_phase_of_the_lommel_seeliger_disc():
    angle = np.radians([0.0, 60.0, 120.0])
    for a, drawn in zip(angle, lommel_seeliger_disc(angle), strict=True):
        # integral over the lit and seen part of the sphere, by brute force
        x, y = np.meshgrid(np.linspace(-1, 1, 801), np.linspace(-1, 1, 801))
        z = np.sqrt(np.clip(1 - x * x - y * y, 0, None))
        mu, mu_sun = z, np.clip(x * np.sin(a) + z * np.cos(a), 0, None)
        inside = x * x + y * y < 1
        mean = (2 * mu_sun / (mu_sun + mu + 1e-9))[inside].mean()
        assert drawn == pytest.approx(mean, abs=0.01)


def test_the_moon_hides_stars_sun_and_earth(renderer, draw_kit, speck):
    q, _ = _facing(0.0)
    behind = {"camera_eci": (MOON_M + 4e6, 0, 0), "look_eci": (-1, 0, 0), "moon_eci": (MOON_M, 0, 0)}
    sky = msgspec.structs.replace(draw_kit.nothing, earth=True, sun=True, stars=True)
    scene = _scene(
        draw_kit,
        speck,
        **behind,
        sun_eci=(-AU_M, 0.06 * AU_M, 0),
        environment=sky,
        q_moon=q,
        fov_rad=0.3,
    )
    open_sky = renderer.render(scene, speck).radiance
    assert open_sky.max() > 1e5
    hidden = renderer.render(
        replace(scene, environment=msgspec.structs.replace(sky, moon=True)), speck
    ).radiance
    assert hidden.max() < 1.0  # its night side


def test_earthrise_and_a_moon_behind_the_earth(renderer, draw_kit, speck):
    q, _ = _facing(0.0)
    world = msgspec.structs.replace(draw_kit.nothing, earth=True, moon=True)
    # 100 km up, over the Moon's limb seen from the Earth
    place = np.array([MOON_M, 1_837_400.0, 0])
    scene = _scene(
        draw_kit, speck, camera_eci=place, look_eci=-place, moon_eci=(MOON_M, 0, 0), sun_eci=(0, AU_M, 0),
        environment=world, q_moon=q, fov_rad=0.9, size=128,
    )  # fmt: skip
    image = renderer.render(scene, speck).radiance
    earth = renderer.render(
        replace(scene, environment=msgspec.structs.replace(world, moon=False)), speck
    ).radiance
    moon = renderer.render(
        replace(scene, environment=msgspec.structs.replace(world, earth=False)), speck
    ).radiance
    assert (earth > 0).sum() > 5
    assert (moon > 0).sum() > 500
    # exactly, but for moonlight on the Earth's night
    assert np.allclose(image, earth + moon, rtol=0, atol=2.5e-6 * earth.max())
    assert np.array_equal(image[moon > 0], (earth + moon)[moon > 0])
    # from low orbit with the Earth in between
    scene = _scene(
        draw_kit, speck, camera_eci=(-7e6, 0, 0), look_eci=(1, 0, 0), moon_eci=(MOON_M, 0, 0),
        sun_eci=(-AU_M, 0.1 * AU_M, 0), q_moon=q,
        environment=msgspec.structs.replace(draw_kit.nothing, moon=True),
    )  # fmt: skip
    assert renderer.render(scene, speck).radiance.max() > 1
    alone = renderer.render(
        replace(scene, environment=msgspec.structs.replace(draw_kit.nothing, earth=True)), speck
    ).radiance
    both = renderer.render(replace(scene, environment=world), speck).radiance
    assert np.array_equal(alone, both)


def test_eclipsed_moon_is_dim_and_red():
    share, reach = shadow_profile(384_400, 150, "rgb")
    # radii of umbra and penumbra: 4.6 and 8.2 thousand km (Meeus 1998, ch. 54, for the mean distance)
    axis = np.linspace(0, reach, 256)
    assert np.interp(0.99, share[:, 1], axis) == pytest.approx(8.2e6, rel=0.03)
    assert np.interp(0.01, share[:, 1], axis) == pytest.approx(4.65e6, rel=0.04)
    red, green, blue = share[20]
    # total eclipses: ten thousand to a million times dimmer (Keen 1983, Science 222)
    assert 1e-6 < red < 4e-4
    assert red > 5 * green > 5 * blue


def test_sunset_of_a_spacecraft_dims_reddens_and_ends():
    heights = np.array([150e3, 30e3, 12e3, 0.0, -30e3, -120e3])
    light = np.array(
        [
            sunlight_past_earth(np.array([-2.5e6, 0, 6_378_137 + h]), np.array([AU_M, 0, 0]), "rgb")
            for h in heights
        ]
    )
    assert light[0] == pytest.approx(1.0, abs=1e-3)
    assert np.all(np.diff(light, axis=0) < 0)
    assert np.all(light[3:5, 0] > 2 * light[3:5, 2])
    assert light[-1].max() < 1e-4


def test_switches_and_the_default_environment(renderer, draw_kit, speck):
    q, sun = _facing(0.3)
    scene = _scene(
        draw_kit, speck, camera_eci=(7e6, 0, 0), look_eci=(1, 0, 0), moon_eci=(MOON_M, 0, 0), sun_eci=sun,
        environment=Environment(), q_moon=q,
    )  # fmt: skip
    full = renderer.render(scene, speck).radiance[40:56, 40:56]
    dark = renderer.render(replace(scene, environment=Environment(moon=False)), speck).radiance[40:56, 40:56]
    assert dark.max() < 0.5 < np.median(full)
    # in colour without the Earth, whose maps in three bands take seconds to upload and which is behind the camera
    colours = replace(scene, bands="rgb", environment=Environment(earth=False))
    seen = renderer.render(colours, speck).radiance[40:56, 40:56]
    assert np.median(seen[..., 0]) > np.median(seen[..., 2]) * 1.1  # the Moon is warm
    without = replace(colours, environment=Environment(earth=False, moon=False))
    assert renderer.render(without, speck).radiance[40:56, 40:56].max() < 0.5


def test_the_high_preset_draws_grazed_ground_as_its_pixels_show_it(renderer, draw_kit, speck):
    q, _ = _facing(0.0)
    # 110 km up, towards the limb, with the Sun low behind it
    place = np.array([MOON_M - 1_847_400.0, 0, 0])

    def at(size, quality):
        return _scene(
            draw_kit, speck, camera_eci=place, look_eci=(0.42, 0.9, 0), moon_eci=(MOON_M, 0, 0), size=size,
            sun_eci=(MOON_M - 0.25 * AU_M, -AU_M, 0), environment=msgspec.structs.replace(draw_kit.nothing, moon=True),
            q_moon=q, fov_rad=0.35, quality=quality,
        )  # fmt: skip

    plain, fine, small = (
        renderer.render(at(size, quality), speck).radiance
        for size, quality in ((64, "default"), (64, "high"), (768, "default"))
    )
    # a pixel shows what twelve by twelve of a camera with finer ones show together
    true = small.reshape(64, 12, 64, 12).mean(axis=(1, 3))
    seen = true > 0.2 * true.mean()
    assert seen.mean() > 0.3
    wrong_plain, wrong_fine = (np.abs(x - true)[seen].mean() / true[seen].mean() for x in (plain, fine))
    # measured: 0.20 and 0.09
    assert wrong_fine < 0.1
    assert wrong_fine < 0.5 * wrong_plain
