"""One frame in the camera's own coordinates: everything the passes need, subtracted and rotated in float64."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from simulator.scene.bands import bands_of, sun_irradiance_w_m2
from simulator.scene.refraction import sunlight_past_earth
from simulator.world.constants import MOON_RADIUS_M
from simulator.world.eclipse import sun_visible_fraction
from simulator.world.rotation import matrix_from_quat

if TYPE_CHECKING:
    from simulator.arrays import FloatArray
    from simulator.scene.state import SceneState

EQUATOR_M, POLE_M = 6_378_137.0, 6_356_752.314245  # WGS84
SUN_RADIUS_M = 6.957e8  # IAU 2015 resolution B3, nominal solar radius
EARTH_RADIUS_M = 6_371_008.8  # mean radius, for earthshine only; the picture uses the ellipsoid
EARTH_MEAN_ALBEDO = 0.30  # Bond albedo, Stephens et al. (2015), The albedo of Earth, Rev. Geophys. 53


@dataclass(frozen=True, eq=False)
class View:
    """Camera-frame quantities of one scene, float64.

    Parameters
    ----------
    R_camera_from_target, t_camera_from_target_m : pose of the target.
    R_camera_from_itrs : orientation of the Earth. r_camera_itrs_m : camera, Earth-fixed.
    sun_direction : unit vector from the target to the Sun. sun_sine : sine of its angular radius.
    sun_itrs : unit vector from the Earth to the Sun, Earth-fixed.
    sun_irradiance_w_m2 : per band, unobstructed, at the target.
    sun_share : per band, what Earth, air and Moon leave of it.
    sun_at_earth_w_m2 : per band, at the Earth.
    earthshine_direction, earthshine_w_m2 : towards the lit part of the Earth; on a plate that faces it, per band.
    nadir : unit vector to the Earth's centre. earth_sine : sine of the Earth's angular radius.
    """

    R_camera_from_target: FloatArray
    t_camera_from_target_m: FloatArray
    R_camera_from_itrs: FloatArray
    R_camera_from_eci: FloatArray
    r_camera_itrs_m: FloatArray
    sun_direction: FloatArray
    sun_sine: float
    sun_itrs: FloatArray
    sun_irradiance_w_m2: FloatArray
    sun_at_earth_w_m2: FloatArray
    sun_visible_fraction: float
    sun_share: FloatArray
    earthshine_direction: FloatArray
    earthshine_w_m2: FloatArray
    nadir: FloatArray
    earth_sine: float


def build_view(scene: SceneState) -> View:
    """Reduce a scene to the camera frame."""
    R_ce = matrix_from_quat(scene.q_camera_from_eci_wxyz)
    R_ie = matrix_from_quat(scene.q_itrs_from_eci_wxyz)
    r_camera, r_target = np.asarray(scene.r_camera_eci_m), np.asarray(scene.r_target_eci_m)
    r_sun = np.asarray(scene.r_sun_eci_m)
    to_sun = r_sun - r_target
    sun_distance = float(np.linalg.norm(to_sun))
    distance = float(np.linalg.norm(r_target))
    sun_unit = r_sun / np.linalg.norm(r_sun)
    direction, share, earth_sine = _earthshine(r_target / distance, distance, sun_unit)
    sun_w_m2 = sun_irradiance_w_m2(scene.bands, sun_distance)
    return View(
        R_camera_from_target=matrix_from_quat(scene.q_camera_from_target_wxyz),
        t_camera_from_target_m=np.asarray(scene.t_camera_from_target_m),
        R_camera_from_itrs=R_ce @ R_ie.T,
        R_camera_from_eci=R_ce,
        r_camera_itrs_m=R_ie @ r_camera,
        sun_direction=R_ce @ (to_sun / sun_distance),
        sun_sine=SUN_RADIUS_M / sun_distance,
        sun_itrs=R_ie @ sun_unit,
        sun_irradiance_w_m2=sun_w_m2,
        sun_at_earth_w_m2=sun_irradiance_w_m2(scene.bands, float(np.linalg.norm(r_sun))),
        sun_visible_fraction=scene.sun_visible_fraction,
        sun_share=_sun_share(scene, R_ie),
        earthshine_direction=R_ce @ direction,
        earthshine_w_m2=sun_w_m2 * share,
        nadir=R_ce @ (-r_camera / np.linalg.norm(r_camera)),
        earth_sine=earth_sine,
    )


def _sun_share(scene: SceneState, R_itrs_from_eci: FloatArray) -> FloatArray:
    """Share (n,) of the Sun's light per band at the target, through the Earth's air where that is drawn."""
    fraction = np.full(len(bands_of(scene.bands)), scene.sun_visible_fraction)
    if not (scene.environment.earth and scene.environment.atmosphere):
        return fraction
    stretch = np.array([1.0, 1.0, EQUATOR_M / POLE_M])  # the ellipsoid becomes a sphere
    r, sun = np.asarray(scene.r_target_eci_m), np.asarray(scene.r_sun_eci_m)
    through = sunlight_past_earth(
        stretch * (R_itrs_from_eci @ r), stretch * (R_itrs_from_eci @ sun), scene.bands
    )
    if np.all(through == 1):
        return fraction
    moon = np.asarray(scene.r_moon_eci_m)
    return through * float(sun_visible_fraction(r - moon, sun - moon, MOON_RADIUS_M))


def _earthshine(zenith: FloatArray, distance_m: float, sun: FloatArray) -> tuple[FloatArray, float, float]:
    """Light that a Lambert Earth of mean albedo throws on a plate turned towards it.

    Parameters
    ----------
    zenith : unit vector from the Earth's centre to the target. sun : unit vector to the Sun, same frame.

    Returns
    -------
    direction : unit vector from the target to the centre of the light.
    share : irradiance on a plate facing ``direction``, over the Sun's at normal incidence.
    sine : sine of the Earth's angular radius.
    """
    sine = min(EARTH_RADIUS_M / distance_m, 1.0)
    # directions over the visible disc, even in solid angle (a spiral): radiance of each is albedo / pi * cos(sun)
    count = 128
    k = np.arange(count) + 0.5
    cosine_rim = np.sqrt(1 - sine**2)
    c = 1 - k / count * (1 - cosine_rim)
    s, turn = np.sqrt(1 - c * c), k * np.pi * (3 - np.sqrt(5))
    east = np.cross(zenith, [0.0, 0.0, 1.0] if abs(zenith[2]) < 0.9 else [1.0, 0.0, 0.0])
    east = east / np.linalg.norm(east)
    north = np.cross(zenith, east)
    rays = -c[:, None] * zenith + (s * np.cos(turn))[:, None] * east + (s * np.sin(turn))[:, None] * north
    along = distance_m * c - np.sqrt(np.clip(EARTH_RADIUS_M**2 - (distance_m * s) ** 2, 0, None))
    ground = (distance_m * zenith + along[:, None] * rays) / EARTH_RADIUS_M
    radiance = EARTH_MEAN_ALBEDO / np.pi * np.clip(ground @ sun, 0, None)
    solid_angle = 2 * np.pi * (1 - cosine_rim) / count
    flux = (radiance[:, None] * rays).sum(axis=0) * solid_angle
    share = float(np.linalg.norm(flux))
    return (flux / share if share > 1e-9 else -zenith), share, sine
