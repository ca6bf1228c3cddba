"""What the uniform blocks hold for one frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from simulator.render.view import EQUATOR_M, POLE_M
from simulator.scene.illumination.atmosphere import SUN_ANGULAR_RADIUS_RAD

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from simulator.camera.lens.camera_model import Camera
    from simulator.render.earth.earth_view import EarthView
    from simulator.render.moon.moon_view import MoonView
    from simulator.render.view import View
    from simulator.runtime.arrays import FloatArray
    from simulator.scene.illumination.atmosphere import Atmosphere
    from simulator.scene.state import SceneState


def frame_values(scene: SceneState, view: View) -> dict[str, ArrayLike]:
    """Members of the block ``Frame``."""
    camera, sky = scene.camera, view.sky
    u_sky, u_earth = np.zeros((10, 4)), np.zeros((3, 4))
    u_sky[:, : sky.irradiance_w_m2.shape[1]] = sky.irradiance_w_m2
    u_earth[: len(sky.radiance_w_m2_sr)] = sky.radiance_w_m2_sr
    lamp = scene.lamp
    return {
        "u_intrinsics": [camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px],
        "u_sun_direction": [*view.sun_direction, view.sun_sine],
        "u_sun_irradiance": _four(view.sun_irradiance_w_m2 * view.sun_share),
        "u_sky": u_sky,
        "u_earth_radiance": u_earth,
        "u_earth_rim": [*sky.axis, sky.disc_cosine],
        # a disc of half the sky lights from around the mean of normal and nadir, all of the sky from the normal
        "u_nadir_direction": [*sky.axis, float(np.clip((1 + sky.disc_cosine) / 2, 0, 1))],
        "u_lamp_place": [0.0] * 4 if lamp is None else [*lamp.offset_m, lamp.shape],
        "u_lamp_intensity": [0.0] * 4 if lamp is None else _four(lamp.intensity_w_sr(scene.bands)),
    }


def earth_values(view: View, earth: EarthView, air: Atmosphere) -> dict[str, ArrayLike]:
    """Members of the block ``Earth``."""
    matrix = np.eye(4)
    matrix[:3, :3] = earth.earth_from_camera
    radius = float(np.linalg.norm(earth.camera))
    mu = earth.sun_cosine
    longitude = float(np.arctan2(earth.camera[1], earth.camera[0]))
    moon = view.moon_itrs * np.array([1.0, 1.0, EQUATOR_M / POLE_M])
    return {
        "u_earth_from_camera": matrix,
        "u_earth_camera": [*earth.camera, 1 / radius],
        "u_earth_sun": [*earth.sun, mu],
        "u_earth_moon": [*(moon / np.linalg.norm(moon)), view.moon_share],
        "u_earth_irradiance": _four(view.sun_at_earth_w_m2),
        "u_earth_limits": [max(np.sqrt(max(1 - mu * mu, 0.0)), 1e-6), earth.top2, EQUATOR_M / POLE_M, 0.0],
        "u_earth_meridian": [np.cos(longitude), np.sin(longitude), longitude, 0.0],
        "u_air_radius": [air.radius_m, air.top_m, radius * EQUATOR_M, SUN_ANGULAR_RADIUS_RAD],
        "u_air_sun": [mu, 0.0, 0.0, 0.0],
        "u_air_shape": [1 / air.rayleigh_height_m, 1 / air.mie_height_m, air.mie_g, 0.0],
        "u_air_rayleigh": _four(air.rayleigh_m),
        "u_air_mie_scattering": _four(air.mie_scattering_m),
        "u_air_mie_extinction": _four(air.mie_extinction_m),
        "u_air_ozone": _four(air.ozone_m),
    }


def moon_values(moon: MoonView) -> dict[str, ArrayLike]:
    """Members of the block ``Moon``."""
    matrix = np.eye(4)
    matrix[:3, :3] = moon.moon_from_camera
    longitude = float(np.arctan2(moon.camera[1], moon.camera[0]))
    return {
        "u_moon_from_camera": matrix,
        "u_moon_camera": [*moon.camera, 0.0],
        "u_moon_sun": [*moon.sun, 0.0],
        "u_moon_earth": [*moon.earth, moon.earthlight],
        "u_moon_meridian": [np.cos(longitude), np.sin(longitude), longitude, 0.0],
        "u_moon_albedo": _four(moon.albedo),
        "u_moon_irradiance": _four(moon.irradiance_w_m2),
        "u_moon_shadow": [*moon.shadow, moon.shadow_reach],
        "u_moon_shadow_axis": [*moon.shadow_axis, 0.0],
    }


def lens_values(
    camera: Camera, clip_from_camera: FloatArray, camera_from_target: FloatArray
) -> dict[str, ArrayLike]:
    """Members of the block ``Lens`` for one window of the image.

    Parameters
    ----------
    clip_from_camera : (4, 4) of the window, as if the lens did not distort.
    """
    c = np.zeros(8)
    distortion = camera.distortion
    brown = distortion.model == "brown_conrady"
    c[: len(distortion.coefficients)] = distortion.coefficients
    k, m = ([c[0], c[1], c[4], c[5]], [c[6], c[7], c[2], c[3]]) if brown else (c[:4], c[4:])
    return {
        "u_lens_camera_from_target": camera_from_target,
        "u_lens_clip_from_image": clip_from_camera,
        "u_lens_k": k,
        "u_lens_m": m,
        "u_lens_limits": [
            min(camera.domain.limit, 1e6),
            1.0 if brown else 2.0,
            max(camera.fx_px, camera.fy_px),
            0.0,
        ],
    }


def _four(bands: FloatArray) -> list[float]:
    """One or three bands as the vec4 of a uniform block."""
    return [*(float(v) for v in bands), *([0.0] * (4 - len(bands)))]
