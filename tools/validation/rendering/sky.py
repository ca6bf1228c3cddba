"""Rows of the rendering page on the limb's position, a star's photons, the Sun's penumbra and moonlight."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from flyaround.simulator.camera.detector.optics import Optics
from flyaround.simulator.camera.detector.response import electrons_per_radiance
from flyaround.simulator.camera.detector.sensor import Detector, Sensor
from flyaround.simulator.celestial.star_catalogue import stars
from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.scene.environments import NOTHING
from flyaround.simulator.scene.illumination.moonlight import moonlight_share
from flyaround.simulator.scene.illumination.planets import earth_velocity_c
from flyaround.simulator.scene.state import TargetRef
from flyaround.simulator.scene.viewpoint import scene_above
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.constants import (
    AU_M,
    EARTH_POLAR_RADIUS_M,
    EARTH_RADIUS_M,
    FLATTENING,
    SUN_RADIUS_M,
)
from flyaround.simulator.world.ephemeris.eclipse import sun_fraction_past_earth
from flyaround.simulator.world.frames.rotation import matrix_from_quat, quat_from_matrix
from tools.validation.bare_scene import square_camera
from tools.validation.rows import Row

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.render.renderer import Renderer
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.environments import Environment
    from flyaround.simulator.scene.state import SceneState

LIGHT_M_S, PLANCK_J_S = 299_792_458.0, 6.62607015e-34  # speed of light and Planck constant (SI, exact)
NOTES = """
The limb row compares how much of each pixel of the Sun's disc, half set, the ground hides with the share of 48 by 48
rays that meet the ellipsoid, summed along the limb's normal.
"""


@dataclass(frozen=True, eq=False)
class LimbError:
    """Error of the rendered limb against the ellipsoid.

    Parameters
    ----------
    offset_px : float
        Mean offset along the limb.
    columns_px : (K,) array
        Offset in each column of pixels.
    share_rms : float
        RMS error of the covered share of the limb's pixels.
    """

    offset_px: float
    columns_px: FloatArray
    share_rms: float


def rows(renderer: Renderer) -> list[Row]:
    """Measure and return every comparison."""
    return [*limb_rows(renderer), *light_rows(renderer)]


def limb_rows(renderer: Renderer) -> list[Row]:
    """Return rows of the Earth's limb in three directions of the image."""
    limbs = np.concatenate([limb_error(renderer, roll).columns_px for roll in (0.0, 17.0, 45.0)])
    return [
        Row(
            what=f"Earth's limb, camera rolled by 0, 17 and 45 deg, {name}",
            against="ellipsoid, ray by ray",
            unit="px",
            goal=0.05,
            measured=measured,
        )
        for name, measured in (
            ("rms", float(np.sqrt(np.mean(limbs**2)))),
            ("largest", float(np.abs(limbs).max())),
        )
    ]


def light_rows(renderer: Renderer) -> list[Row]:
    """Return rows of a star's photons, the Sun's penumbra and the Moon's light on the ground."""
    drawn, counted = star_electrons(renderer)
    return [
        Row(
            what="electrons of Vega in the picture (f/2, 17.6 mm, half a second), relative",
            against="photons of Hayes's flux (1985), counted by hand",
            unit="1",
            goal=0.08,
            measured=abs(drawn / counted - 1),
        ),
        Row(
            what="Sun's share across the Earth's penumbra, 2,000 km behind equator and poles, largest difference",
            against="points of the disc and the ellipsoid, ray by ray",
            unit="1",
            goal=0.005,
            measured=penumbra_difference(),
        ),
        Row(
            what="night in the full Moon's light over the same day, without air, relative",
            against="magnitudes -12.73 and -26.74 (Allen 2000)",
            unit="1",
            goal=0.02,
            measured=moonlight_difference(renderer),
        ),
    ]


def _empty(
    epoch: str,
    place: tuple[float, float, float],
    camera: Camera,
    environment: Environment = NOTHING,
    azimuth_deg: float = 0.0,
    off_nadir_deg: float = 0.0,
    look_at: str = "earth",
) -> SceneState:
    """Return a monochrome scene without spacecraft; parameters as in `scene_above`."""
    return scene_above(
        epoch,
        place,
        camera=camera,
        target=TargetRef(name="tango", sha256=load_target("tango").sha256),
        azimuth_deg=azimuth_deg,
        off_nadir_deg=off_nadir_deg,
        look_at=look_at,
        bands="mono",
        environment=environment,
    )


def _draw(renderer: Renderer, scene: SceneState, **changes: bool) -> FloatArray:
    world: Environment = msgspec.structs.replace(scene.environment, **changes)
    scene = replace(scene, environment=world)
    return np.asarray(renderer.render(scene, load_target("tango")).radiance, float)


def limb_error(renderer: Renderer, roll_deg: float, size: int = 120, focal_px: float = 9000.0) -> LimbError:
    """Return the error for the Sun half set behind the limb, 700 km over 40 N, against coverage counted by rays."""
    low, high = 60.0, 170.0
    for _ in range(24):  # longitude of sunset by bisection
        longitude = (low + high) / 2
        place = (40.0, longitude, 700.0)
        scene = _empty("2026-03-20T12:00:00Z", place, square_camera(size, focal_px), look_at="sun")
        low, high = (longitude, high) if scene.sun_visible_fraction > 0.5 else (low, longitude)
    turn = np.radians(roll_deg)
    R_roll = np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    R_ce = R_roll @ matrix_from_quat(scene.q_camera_from_eci_wxyz)
    scene = replace(scene, q_camera_from_eci_wxyz=quat(quat_from_matrix(R_ce)))
    full_disc, part = _draw(renderer, scene, sun=True), _draw(renderer, scene, sun=True, earth=True)
    disc = full_disc > 0.2 * full_disc.max()
    hidden = 1 - part / np.where(disc, full_disc, 1.0)
    exact = _ground_share(scene, size, focal_px)
    wrong = np.where(disc, hidden - exact, 0.0)
    edge = disc & (exact > 0) & (exact < 1)
    # columns in which the whole limb is in front of the disc
    limb = (exact > 0) & (exact < 1)
    columns = edge.any(axis=0) & ~(limb & ~disc).any(axis=0)
    row, column = np.nonzero(edge)
    rise = np.polyfit(column, row, 1)[0]
    return LimbError(
        float(wrong[edge].sum() / edge.sum()),
        wrong[:, columns].sum(axis=0) / np.hypot(1.0, rise),
        float(np.sqrt(np.mean(wrong[edge] ** 2))),
    )


def _ground_share(scene: SceneState, size: int, focal_px: float, rays: int = 48) -> FloatArray:
    """Return the (size, size) share of each pixel's rays that hit the ellipsoid."""
    R_ie = scene.body("earth").R_fixed_from_eci
    R = matrix_from_quat(scene.q_camera_from_eci_wxyz) @ R_ie.T
    c = R_ie @ scene.r_camera_eci_m
    Q = np.diag([EARTH_RADIUS_M**-2, EARTH_RADIUS_M**-2, EARTH_POLAR_RADIUS_M**-2])
    middle = (size - 1) / 2

    def meets(x: FloatArray, y: FloatArray) -> FloatArray:
        d = np.stack([(x - middle) / focal_px, (y - middle) / focal_px, np.ones(x.shape)], -1) @ R
        b = d @ (Q @ c)
        return np.asarray(b * b > ((d @ Q) * d).sum(axis=-1) * (c @ Q @ c - 1), float)

    y, x = (v.ravel().astype(float) for v in np.mgrid[:size, :size])
    corner = np.array([-0.5, 0.5, -0.5, 0.5]), np.array([-0.5, -0.5, 0.5, 0.5])
    corners = meets(x[:, None] + corner[0], y[:, None] + corner[1])
    share = corners.mean(axis=1)
    cut = np.flatnonzero((share > 0) & (share < 1))
    within = (np.arange(rays) + 0.5) / rays - 0.5
    u, v = (w.ravel() for w in np.meshgrid(within, within))
    share[cut] = meets(x[cut, None] + u, y[cut, None] + v).mean(axis=1)
    return share.reshape(size, size)


def star_electrons(renderer: Renderer) -> tuple[float, float]:
    """Return the electrons of Vega in a rendered image, and those computed from its flux."""
    pitch, focal, number, exposure, efficiency = 5.86e-6, 17.6e-3, 2.0, 0.5, 0.5
    scene = _empty("2026-03-20T12:00:00Z", (0.0, 0.0, 700.0), square_camera(96, focal / pitch))
    field = stars(scene.epoch_utc, "mono")
    # Hipparcos 91262: J2000 18h36m56.34s +38d47m01.3s
    ra, dec = np.radians([(18 + 36 / 60 + 56.34 / 3600) * 15, 38 + 47 / 60 + 1.3 / 3600])
    to_star = np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])
    to_star = field.directions[:, int(np.argmax(to_star @ field.directions))]
    to_star = to_star + earth_velocity_c(scene.epoch_utc) + np.asarray(scene.v_camera_eci_m_s) / LIGHT_M_S
    z = to_star / np.linalg.norm(to_star)
    x = np.cross([0.1, 0.2, 1.0], z)
    x /= np.linalg.norm(x)
    scene = replace(scene, q_camera_from_eci_wxyz=quat(quat_from_matrix(np.stack([x, np.cross(z, x), z]))))
    optics = Optics(f_number=number, transmission=1.0)
    sensor = Sensor(
        detector=Detector(quantum_efficiency=(efficiency,)), pixel_pitch_x_m=pitch, pixel_pitch_y_m=pitch
    )
    image = _draw(renderer, replace(scene, sensor=sensor), stars=True)
    middle = slice(45, 51)
    drawn = float(image[middle, middle].sum()) * float(
        np.squeeze(electrons_per_radiance(sensor, optics, exposure, 1))
    )
    # 3.05e-11 W m-2 nm-1 over the 300 nm of the band, with mean wavelength 563 nm in Vega's light
    photons = 3.05e-11 * 300 / (PLANCK_J_S * LIGHT_M_S / 563e-9)
    return drawn, photons * np.pi / 4 * (focal / number) ** 2 * exposure * efficiency


def penumbra_difference(points: int = 400) -> float:
    """Return the maximum difference of the Sun's visible share at eleven points of equatorial and polar penumbras."""
    grid = (np.arange(points) + 0.5) / points * 2 - 1
    y, z = (v.ravel() for v in np.meshgrid(grid, grid))
    disc = np.stack([np.zeros_like(y), y, z], axis=-1)[y * y + z * z < 1] * SUN_RADIUS_M
    sun = np.array([AU_M, 0.0, 0.0])
    worst = 0.0
    sphere = 1 / np.array([EARTH_RADIUS_M, EARTH_RADIUS_M, EARTH_RADIUS_M * (1 - FLATTENING)])
    for up in (np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])):
        for height in 1 / float(sphere @ up) + np.linspace(-9e3, 9e3, 11):
            r = np.array([-2e6, 0.0, 0.0]) + height * up
            # in units of its axes the ellipsoid is a unit sphere
            d, q = (sun + disc - r) * sphere, r * sphere
            d /= np.linalg.norm(d, axis=-1, keepdims=True)
            open_sky = np.linalg.norm(q - (d @ q)[:, None] * d, axis=-1) > 1
            worst = max(worst, abs(float(sun_fraction_past_earth(r, sun)) - float(open_sky.mean())))
    return worst


def moonlight_difference(renderer: Renderer) -> float:
    """Return the maximum relative difference of a moonlit night from a scaled day over the same ground."""
    world = msgspec.structs.replace(NOTHING, earth=True, clouds=True, ocean_glint=True, moon=True)
    camera = square_camera(96, 140.0)
    day = _empty("2026-06-20T08:30:00Z", (38.0, 24.0, 420.0), camera, world, 40.0, 30.0)
    sun = np.asarray(day.r_sun_eci_m)
    to_sun = sun / np.linalg.norm(sun)
    night = replace(day, r_sun_eci_m=vec3(-sun), sun_visible_fraction=0.0).with_body(
        "moon", r_eci_m=vec3(3.844e8 * to_sun)
    )
    share = moonlight_share(3.844e8 * to_sun, -to_sun)
    return float(np.abs(_draw(renderer, night) / (share * _draw(renderer, day)) - 1).max())
