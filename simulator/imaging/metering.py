"""An exposure meter that predicts radiance from the geometry, without drawing an image.

It applies Lambert's law at a few hundred points of the craft and of the visible ground. Highlights, shadows, clouds and
interreflection are ignored, which is sufficient for setting an exposure.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.geometry.triangles import face_vectors
from flyaround.simulator.imaging.image_formation import expose
from flyaround.simulator.scene.illumination.bands import reflectance, sun_irradiance_w_m2
from flyaround.simulator.scene.illumination.lamp import Lamp
from flyaround.simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from flyaround.simulator.imaging.auto_exposure import AutoExposure
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.illumination.area_light import AreaLight
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

SPECULAR_SHARE = 0.7  # of a metal's light, which mostly does not reach the camera: chosen by eye
N_POINTS = 600  # surface points that are metered
BACKGROUND_GRID = (16, 12)  # columns and rows of metered background
NEAREST_M = 1e-3  # least distance of a light from the surface that it shines on

DARK_RADIANCE_W_M2_SR = 1e-4
"""Radiance below which a point counts as dark [W m-2 sr-1]; sunlit surfaces are five orders of magnitude brighter."""


@dataclass(frozen=True, eq=False)
class MeterPoints:
    """Points spread evenly over a craft's surface: positions (K, 3) [m], normals (K, 3), albedo (K,), area [m2]."""

    positions_m: FloatArray
    normals: FloatArray
    albedo: FloatArray
    area_m2: float


@lru_cache(maxsize=4)
def meter_points(target: Target) -> MeterPoints:
    """Return points of a target, one per equal share of its surface."""
    base = {m.name: m for m in target.materials}
    corners, albedo = [], []
    for part in target.parts:
        material = base[part.material]
        corners.append(part.positions_m[part.triangles].astype(float))
        diffuse = float(reflectance("mono", np.asarray(material.base_color))[0])
        diffuse *= 1 - SPECULAR_SHARE * material.metallic
        albedo.append(np.full(len(part.triangles), diffuse))
    c, a = np.concatenate(corners), np.concatenate(albedo)
    normal = face_vectors(c)
    area = np.linalg.norm(normal, axis=1) / 2
    total = np.cumsum(area)
    triangle = np.searchsorted(total, (np.arange(N_POINTS) + 0.5) / N_POINTS * total[-1])
    unit = normal[triangle] / np.linalg.norm(normal[triangle], axis=1, keepdims=True)
    return MeterPoints(c[triangle].mean(axis=1), unit, a[triangle], float(total[-1] / N_POINTS))


def metered_radiance_w_m2_sr(scene: SceneState, target: Target, share: float) -> float:
    """Return the panchromatic radiance that ``share`` of the lit image stays below; 0 if nothing is lit.

    Parameters
    ----------
    scene : SceneState
        Scene at mid-exposure.
    target : Target
        Target model.
    share : float
        Share of the image's area, 0..1: 0.9 lets the brightest tenth exceed it.
    """
    radiance, area = (
        np.concatenate(pair) for pair in zip(_craft(scene, target), _ground(scene), strict=True)
    )
    is_lit = radiance > DARK_RADIANCE_W_M2_SR
    if not is_lit.any() or area[is_lit].sum() <= 0:
        return 0.0
    order = np.argsort(radiance[is_lit])
    cumulative_area = np.cumsum(area[is_lit][order])
    return float(radiance[is_lit][order][np.searchsorted(cumulative_area, share * cumulative_area[-1])])


def _craft(scene: SceneState, target: Target) -> tuple[FloatArray, FloatArray]:
    """Return the radiance of the craft's points, and the pixels that each represents (0 if hidden)."""
    points = meter_points(target)
    pose, c = scene.camera_from_target, scene.camera
    p, n = pose.apply(points.positions_m), points.normals @ pose.R.T
    distance = np.linalg.norm(p, axis=1)
    facing = np.clip(-(p * n).sum(axis=1) / distance, 0, None)
    with np.errstate(invalid="ignore"):
        on_image = c.contains(c.project(p))
    area = points.area_m2 * facing / distance**2 * c.fx_px * c.fy_px * on_image
    sun_m = float(np.linalg.norm(np.subtract(scene.r_sun_eci_m, scene.r_target_eci_m)))
    sunlight = float(sun_irradiance_w_m2("mono", sun_m)[0]) * scene.sunlit_fraction
    incidence = np.clip(n @ np.asarray(scene.sun_direction_camera), 0, None)
    light = sunlight * incidence
    if scene.lamp is not None:
        light = light + scene.lamp.irradiance_w_m2(p, n, "mono")[:, 0]
    for lamp in scene.area_lights:
        factor = lamp.in_camera_frame(pose).irradiance_factor(p, n)
        light = light + factor * lamp.radiance_w_m2_sr
    return points.albedo / np.pi * light, area


def _ground(scene: SceneState) -> tuple[FloatArray, FloatArray]:
    """Return the radiance of the central body's ground on a grid over the image, and the pixels per point."""
    c, central, body = scene.camera, scene.central, scene.central.body
    u = (np.arange(BACKGROUND_GRID[0]) + 0.5) / BACKGROUND_GRID[0] * c.width_px - 0.5
    v = (np.arange(BACKGROUND_GRID[1]) + 0.5) / BACKGROUND_GRID[1] * c.height_px - 0.5
    pixels = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    area = np.full(len(pixels), c.width_px * c.height_px / len(pixels))
    if not scene.environment.draws(body):
        return np.zeros(len(pixels)), area
    d = c.rays(pixels) @ matrix_from_quat(scene.q_camera_from_eci_wxyz)
    center = np.asarray(central.r_eci_m)
    r = np.asarray(scene.r_camera_eci_m) - center
    along = -d @ r
    discriminant = along**2 - (r @ r - body.radius_m**2)
    hit = (discriminant > 0) & (along > 0)
    zenith = (r + (along - np.sqrt(np.maximum(discriminant, 0)))[:, None] * d) / body.radius_m
    sun = np.asarray(scene.r_sun_eci_m) - center
    cosine = np.clip(zenith @ sun / np.linalg.norm(sun), 0, None)
    sunlight = sun_irradiance_w_m2("mono", body.sun_distance_m)[0]
    return np.where(hit, body.albedo / np.pi * sunlight * cosine, 0.0), area


def light_signal(scene: SceneState, light: Lamp | AreaLight) -> float:
    """Return the signal of a white surface at the target's origin that faces a light, without any other light.

    Returns
    -------
    float
        Share of full scale; the light is a point in the middle of an area light.
    """
    at = np.asarray(scene.t_camera_from_target_m, float)
    if isinstance(light, Lamp):
        away = at - light.offset_m
        if (distance_m := float(np.linalg.norm(away))) < NEAREST_M:
            away, distance_m = np.array([0.0, 0.0, NEAREST_M]), NEAREST_M
        place, facing = light.offset_m + away, -away / distance_m
        irradiance = float(light.irradiance_w_m2(place[None], facing[None], "mono")[0, 0])
    else:
        seen = light.in_camera_frame(scene.camera_from_target)
        away = at - seen.middle_m
        distance_m = max(float(np.linalg.norm(away)), NEAREST_M)
        cosine = max(float(seen.axis @ away) / distance_m, 0.0)
        area_m2 = light.width_m * light.height_m
        irradiance = light.radiance_w_m2_sr * area_m2 * cosine ** (seen.exponent + 1) / distance_m**2
    return irradiance / np.pi * _unit_signal(scene, scene.exposure_s)


def _unit_signal(scene: SceneState, exposure_s: float) -> float:
    """Return the signal of a uniform image of unit radiance."""
    return float(expose(np.ones((9, 9), np.float32), scene.sensor, exposure_s, optics=scene.optics)[4, 4])


def metered_exposure_s(auto: AutoExposure, scene: SceneState, target: Target) -> float:
    """Return the meter's exposure for a scene.

    Returns
    -------
    float
        Exposure within the bounds of ``auto`` [s]; the longest if nothing is lit.
    """
    radiance = metered_radiance_w_m2_sr(scene, target, auto.share)
    return auto.exposure_for_radiance_s(radiance, 1 / _unit_signal(scene, 1.0))
