"""Rows of the rendering page on Earth, air, Moon, Sun and stars: rendered images against published figures."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.celestial.air_tables import air_tables
from flyaround.simulator.celestial.star_catalogue import star_irradiance_w_m2
from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.scene.environments import NOTHING, Environment
from flyaround.simulator.scene.illumination.atmosphere import (
    MultipleScattering,
    earth_atmosphere,
    ground_irradiance,
    mie_phase,
    path_light,
    rayleigh_phase,
)
from flyaround.simulator.scene.illumination.bands import sun_irradiance_w_m2
from flyaround.simulator.scene.illumination.moonlight import disc_phase
from flyaround.simulator.scene.illumination.multiple_scattering import multiple_scattering
from flyaround.simulator.scene.illumination.refraction import shadow_profile, sunlight_past_earth
from flyaround.simulator.scene.state import TargetRef
from flyaround.simulator.scene.viewpoint import scene_above
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.constants import AU_M, EARTH_POLAR_RADIUS_M, EARTH_RADIUS_M
from flyaround.simulator.world.ephemeris.body import earth_and_moon
from flyaround.simulator.world.frames.rotation import matrix_from_quat, quat_from_matrix
from tools.validation.rows import Row

if TYPE_CHECKING:
    from flyaround.simulator.render.renderer import Renderer
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.illumination.bands import Bands
    from flyaround.simulator.scene.state import SceneState

SIZE, FIELD_RAD = 128, 0.046  # side of the image [px], and its field of view
WIDE = 300e3  # height from which the whole Earth is visible [km]
PHASES_DEG = (5.0, 30.0, 60.0, 90.0, 120.0, 150.0)  # phase angles of the Moon
NOTES = """
Full Earth: two thirds of the spherical albedo of 0.295 +- 0.008 (Penttila et al. 2022, Front. Remote Sens. 3,
790723), times an anisotropy near the Sun's direction of 1.27: our estimate, after angular distribution models as Su
et al. (2021, Front. Remote Sens. 2, 747859) apply them to DSCOVR. Older photometry of the dark Moon (Allen 2000:
0.367; Mallama, Krobusek & Pavlov 2017: 0.434) contradicts both it and the reflectances below. The Moon's rows are
means of the waxing and the waning Moon. "Twin": the same physics in double precision on the CPU.
"""


def rows(renderer: Renderer) -> list[Row]:
    """Measure and return every comparison."""
    return [*_earth(renderer), *_air(renderer), *_moon(renderer), *_sun_and_stars(renderer)]


def _square(field_rad: float) -> Camera:
    f, middle = SIZE / field_rad, (SIZE - 1) / 2
    return Camera(width_px=SIZE, height_px=SIZE, fx_px=f, fy_px=f, cx_px=middle, cy_px=middle)


def _empty(
    epoch: str, place: tuple[float, float, float], camera: Camera, bands: Bands, world: Environment
) -> SceneState:
    ref = TargetRef(name="tango", sha256=load_target("tango").sha256)
    return scene_above(epoch, place, camera=camera, target=ref, bands=bands, environment=world)


def _draw(renderer: Renderer, scene: SceneState) -> FloatArray:
    return np.asarray(renderer.render(scene, load_target("tango")).radiance, float)


def _error(measured: float, published: float) -> float:
    return abs(measured / published - 1)


def earth_disc(renderer: Renderer, phase_deg: float) -> float:
    """Return the light of the whole Earth over that of a white Lambert disc, mean of six equinox views."""
    camera, world = _square(FIELD_RAD), Environment(moon=False, stars=False, planets=False, sun=False)
    shares = []
    for hour in (1, 9, 17):
        for side in (-phase_deg, phase_deg):
            longitude = (-15 * (hour - 12) + side + 180) % 360 - 180
            scene = _empty(f"2026-03-20T{hour:02d}:00:00Z", (0.0, longitude, WIDE), camera, "mono", world)
            flux = _draw(renderer, scene).sum() * (FIELD_RAD / SIZE) ** 2
            sun = sun_irradiance_w_m2("mono", float(np.linalg.norm(scene.r_sun_eci_m)))[0]
            shares.append(flux / sun * (np.linalg.norm(scene.r_camera_eci_m) / EARTH_RADIUS_M) ** 2)
    return float(np.mean(shares))


def _earth(renderer: Renderer) -> list[Row]:
    light = [earth_disc(renderer, phase) for phase in PHASES_DEG]
    angle = np.radians([0.0, *PHASES_DEG, 180.0])
    fine = np.linspace(0, np.pi, 361)
    # the logarithm is nearly linear between the phases
    curve = np.exp(np.interp(fine, angle, np.log([light[0], *light, light[-1] / 4])))
    bond = 2 * np.trapezoid(curve * np.sin(fine), fine)
    return [
        Row(
            what="full Earth's irradiance at 5 deg phase, relative",
            against="DSCOVR: 0.25 (notes)",
            unit="1",
            goal=0.15,
            measured=_error(light[0], 0.25),
        ),
        Row(
            what="Earth's disc-integrated albedo, distance from 0.30",
            against="Penttila et al. (2022), 0.295, rounded",
            unit="1",
            goal=0.05,
            measured=abs(float(bond) - 0.30),
        ),
    ]


def _air(renderer: Renderer) -> list[Row]:
    out = []
    for bands in ("mono", "rgb"):
        measured = [_twin_db(renderer, bands, hour) for hour in (2, 6, 11)]
        out.append(
            Row(
                what=f"limb against its twin, {bands}: 45 dB over the least PSNR",
                against="double precision, three heights of the Sun",
                unit="1",
                goal=1.0,
                measured=45.0 / min(measured),
            )
        )
    air = earth_atmosphere("rgb")
    table = multiple_scattering(air, ground_albedo=0.15)
    direct, sky = ground_irradiance(air, np.array([np.cos(np.radians(48.2))]), multiple=table)
    blue = float((sky / (direct + sky))[0, 2])
    out.append(
        Row(
            what="sky's share of blue light on level ground, Sun 48 deg from the zenith, distance from 0.228",
            against="Bird & Riordan (1986), 400-500 nm, aerosol and ground (0.15) as ours",
            unit="1",
            goal=0.03,
            measured=abs(blue - 0.228),
        )
    )
    height, radiance = _limb_profile()
    upper = (height > 40e3) & (height < 60e3)
    fall = -1 / np.polyfit(height[upper], np.log(radiance[upper]), 1)[0]
    out.append(
        Row(
            what="limb's fall from 40 to 60 km, scale height against 7.82 km, relative",
            against="U.S. Standard Atmosphere 1976",
            unit="1",
            goal=0.05,
            measured=_error(float(fall), 7820.0),
        )
    )
    return out


def _limb_profile() -> tuple[FloatArray, FloatArray]:
    """Return the blue radiance over irradiance by tangent height [m], with the Sun 60 deg from that point's zenith."""
    air = earth_atmosphere("rgb")
    table = MultipleScattering(np.asarray(air_tables("rgb", 100e3).multiple, float), 100e3)
    height = np.linspace(1e3, 80e3, 159)
    camera = np.array([-np.sqrt((air.radius_m + 700e3) ** 2 - air.radius_m**2), 0.0, air.radius_m])
    foot = np.stack([np.zeros_like(height), np.zeros_like(height), air.radius_m + height], axis=1)
    rays = foot - camera
    # perpendicular to the vertical at the tangent point only for h = 0: the ray's lowest point is within 0.1 km of it
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    sun = np.array([0.0, np.sin(np.radians(60)), np.cos(np.radians(60))])
    light = path_light(air, camera, rays, sun, steps=96, multiple=table)
    angle = (rays @ sun)[:, None]
    total = light.rayleigh * rayleigh_phase(angle) + light.mie * mie_phase(angle, air.mie_g) + light.multiple
    perigee = np.linalg.norm(np.cross(camera, rays), axis=1) - air.radius_m
    return perigee, total[:, 2]


def _twin_db(renderer: Renderer, bands: Bands, hour: int) -> float:
    """Return the PSNR of the rendered air beyond the limb against its double-precision twin [dB]."""
    world = msgspec.structs.replace(NOTHING, earth=True, atmosphere=True)
    camera = Camera(width_px=SIZE, height_px=SIZE, fx_px=300.0, fy_px=300.0, cx_px=63.5, cy_px=63.5)
    ref = TargetRef(name="tango", sha256=load_target("tango").sha256)
    scene = scene_above(
        f"2026-03-20T{hour:02d}:00:00Z",
        (10.0, 80.0, 700.0),
        camera=camera,
        target=ref,
        bands=bands,
        environment=world,
        off_nadir_deg=64.0,
        azimuth_deg=60.0,
    )
    drawn = _draw(renderer, scene).reshape(SIZE * SIZE, -1)
    stretch = np.array([1, 1, EARTH_RADIUS_M / EARTH_POLAR_RADIUS_M])
    R_ie = scene.body("earth").R_fixed_from_eci
    y, x = np.mgrid[0:SIZE, 0:SIZE]
    rays = camera.rays(np.stack([x.ravel(), y.ravel()], axis=1)) @ matrix_from_quat(
        scene.q_camera_from_eci_wxyz
    )
    d = (rays @ R_ie.T) * stretch
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    c, s = stretch * (R_ie @ scene.r_camera_eci_m), stretch * (R_ie @ scene.r_sun_eci_m)
    s /= np.linalg.norm(s)
    air = earth_atmosphere(bands)
    table = MultipleScattering(np.asarray(air_tables(bands, 100e3).multiple, float), 100e3)
    perigee = np.linalg.norm(np.cross(c, d), axis=1)
    sky = np.flatnonzero((perigee > air.radius_m + 500) & (perigee < air.top_m) & (d @ c < 0))[::5]
    light = path_light(air, c, d[sky], s, steps=96, multiple=table)
    angle = (d[sky] @ s)[:, None]
    exact = light.rayleigh * rayleigh_phase(angle) + light.mie * mie_phase(angle, air.mie_g) + light.multiple
    exact = exact * sun_irradiance_w_m2(bands, float(np.linalg.norm(scene.r_sun_eci_m)))
    error = np.sqrt(np.mean((drawn[sky] - exact) ** 2))
    return float(20 * np.log10(exact.max() / error))


def _moon(renderer: Renderer) -> list[Row]:
    out = []
    world = msgspec.structs.replace(NOTHING, moon=True)
    field = 0.012
    for phase in (5.0, 50.0, 100.0):
        light = [_moon_irradiance(renderer, np.radians(p), world, field) for p in (phase, -phase)]
        # V = -12.74 at full against the Sun's -26.76
        full = sun_irradiance_w_m2("mono", AU_M)[0] * 10 ** (-0.4 * (-12.74 + 26.76))
        out.append(
            Row(
                what=f"Moon's irradiance at {phase:g} deg phase, relative",
                against="Allen (2000), 12.5",
                unit="1",
                goal=0.15,
                measured=_error(float(np.mean(light)), float(full * disc_phase(np.radians(phase)))),
            )
        )
    share, reach = shadow_profile(384_400, 150, "rgb")
    edge = float(np.interp(0.99, share[:, 1], np.linspace(0, reach, len(share))))
    out.append(
        Row(
            what="radius of the penumbra at the Moon, relative",
            against="Meeus (1998), ch. 54: 8.2 Mm",
            unit="1",
            goal=0.03,
            measured=_error(edge, 8.2e6),
        )
    )
    return out


def _moon_irradiance(renderer: Renderer, phase_rad: float, world: Environment, field_rad: float) -> float:
    """Return the irradiance by the Moon at the mean distance from the Earth's centre [W m-2]."""
    distance = 384_400e3
    scene = _empty("2026-03-20T12:00:00Z", (0.0, 0.0, 400.0), _square(field_rad), "mono", world)
    sun = np.array([distance, 0, 0]) + AU_M * np.array([-np.cos(phase_rad), np.sin(phase_rad), 0])
    R = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]], float)  # looking along x
    scene = replace(
        scene,
        r_camera_eci_m=(1.0, 0.0, 0.0),
        r_target_eci_m=(-1000.0, 0.0, 0.0),
        bodies=earth_and_moon((distance, 0.0, 0.0), q_moon_from_eci_wxyz=(0.0, 0.0, 0.0, 1.0)),
        r_sun_eci_m=vec3(sun),
        q_camera_from_eci_wxyz=quat(quat_from_matrix(R)),
    )
    return float(_draw(renderer, scene).sum() * (field_rad / SIZE) ** 2)


def _sun_and_stars(renderer: Renderer) -> list[Row]:
    field = 0.02
    world = msgspec.structs.replace(NOTHING, sun=True)
    ref = TargetRef(name="tango", sha256=load_target("tango").sha256)
    scene = scene_above(
        "2026-03-20T12:00:00Z",
        (0.0, 0.0, 36e3),
        camera=_square(field),
        target=ref,
        bands="mono",
        environment=world,
        look_at="sun",
    )
    image = _draw(renderer, scene)
    irradiance = image.sum() * (field / SIZE) ** 2
    expected = sun_irradiance_w_m2("mono", float(np.linalg.norm(scene.r_sun_eci_m)))[0]
    middle = SIZE // 2
    rim = image[middle, image[middle] > 0]
    darkening = rim[2] / rim.max()
    vega = star_irradiance_w_m2(np.array([0.09]), np.array([0.0]), "mono")[0, 0]
    # half of the light in a low orbit's sunset, where refraction flattens the disc
    heights = np.linspace(0, 80e3, 161)
    light = [
        sunlight_past_earth(np.array([-2.5e6, 0, EARTH_RADIUS_M + h]), np.array([AU_M, 0, 0]), "mono")[0]
        for h in heights
    ]
    half = float(np.interp(0.5, light, heights))
    return [
        Row(
            what="irradiance of the Sun's disc in the picture, relative",
            against="ASTM G173 in the band, distance of the day",
            unit="1",
            goal=0.02,
            measured=_error(float(irradiance), float(expected)),
        ),
        Row(
            what="Sun near the limb over its middle, distance from 0.56",
            against="linear law, u = 0.6 (Allen 2000), two pixels inside",
            unit="1",
            goal=0.08,
            measured=abs(float(darkening) - 0.56),
        ),
        Row(
            what="Vega over 450-750 nm, relative",
            against="Hayes (1985): 3.05e-11 W m-2 nm-1",
            unit="1",
            goal=0.08,
            measured=_error(float(vega), 3.05e-11 * 300),
        ),
        Row(
            what="height of the Sun's middle at half light, distance from 25 km",
            against="Rayleigh optical depth ln 2 and flattening by refraction, by hand",
            unit="km",
            goal=8.0,
            measured=abs(half / 1e3 - 25.0),
        ),
    ]
