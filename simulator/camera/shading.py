"""What reaches a pixel of the light of its direction (vignetting), and what light strays there (veiling glare)."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from simulator.arrays import Float32Array, FloatArray
    from simulator.camera.model import Camera
    from simulator.camera.optics import Optics

_STEP_PX = 16
_CORE_DEG = 0.3  # nearer to the Sun than its own disc the glare is part of the picture of the disc


@lru_cache(maxsize=4)
def vignetting(camera: Camera, optics: Optics) -> Float32Array | None:
    """(H, W) share of the light that reaches each pixel, or None for all of it.

    cos^4 of the angle from the axis; and the aperture as a unit disc, part of which a rear rim (a disc of
    ``rim_radius``) hides when it is seen from an angle: their centres are ``mechanical_vignetting`` x tan(angle) apart.
    """
    if not optics.natural_vignetting and optics.mechanical_vignetting <= 0:
        return None
    rays = _coarse_rays(camera)
    cosine = rays[..., 2]
    share = np.ones(cosine.shape)
    if optics.natural_vignetting:
        share *= cosine**4
    if optics.mechanical_vignetting > 0:
        shift = optics.mechanical_vignetting * np.sqrt(1 - cosine**2) / cosine
        share *= common_area(shift, 1.0, optics.rim_radius) / common_area(np.zeros(1), 1.0, optics.rim_radius)
    return _fine(camera, share)


def common_area(distance: FloatArray, a: float, b: float) -> FloatArray:
    """Area that two discs of radii ``a`` and ``b`` share."""
    d = np.clip(distance, abs(a - b) + 1e-12, a + b - 1e-12)
    at_a = np.arccos(np.clip((d * d + a * a - b * b) / (2 * d * a), -1, 1))
    at_b = np.arccos(np.clip((d * d + b * b - a * a) / (2 * d * b), -1, 1))
    lens = a * a * (at_a - np.sin(2 * at_a) / 2) + b * b * (at_b - np.sin(2 * at_b) / 2)
    whole = np.pi * min(a, b) ** 2
    return np.asarray(np.where(distance <= abs(a - b), whole, np.where(distance >= a + b, 0.0, lens)))


def veiling_glare(
    camera: Camera, optics: Optics, sun_direction: FloatArray, sun_irradiance_w_m2: FloatArray
) -> Float32Array | None:
    """(H, W) or (H, W, n) radiance that the Sun scatters into the picture [W m-2 sr-1], or None.

    Parameters
    ----------
    sun_direction : unit vector, camera frame. sun_irradiance_w_m2 : per band; what is hidden of the Sun taken off.

    References
    ----------
    Vos (1984), Disability glare: the law of the inverse square of the angle (Stiles-Holladay), here for a lens.
    """
    off_axis = np.rad2deg(np.arccos(np.clip(sun_direction[2], -1, 1)))
    if (
        optics.veiling_glare_sr <= 0
        or off_axis > optics.glare_limit_deg
        or not np.any(sun_irradiance_w_m2 > 0)
    ):
        return None
    angle_deg = np.rad2deg(np.arccos(np.clip(_coarse_rays(camera) @ sun_direction, -1, 1)))
    spread = optics.veiling_glare_sr / np.maximum(angle_deg, _CORE_DEG) ** 2
    field = _fine(camera, spread)
    irradiance = np.asarray(sun_irradiance_w_m2, np.float32)
    return field * irradiance[0] if irradiance.size == 1 else field[..., None] * irradiance


def _coarse_rays(camera: Camera) -> FloatArray:
    """Rays of a grid of points from corner to corner of the image."""
    columns, rows = (-(-n // _STEP_PX) + 1 for n in (camera.width_px, camera.height_px))
    x, y = np.meshgrid(
        np.linspace(0, camera.width_px - 1, columns), np.linspace(0, camera.height_px - 1, rows)
    )
    return camera.rays(np.stack([x, y], axis=-1))


def _fine(camera: Camera, coarse: FloatArray) -> Float32Array:
    """The grid's values at every pixel."""
    x = np.linspace(0, coarse.shape[1] - 1, camera.width_px, dtype=np.float32)
    y = np.linspace(0, coarse.shape[0] - 1, camera.height_px, dtype=np.float32)
    at_x, at_y = np.meshgrid(x, y)
    return np.asarray(
        cv2.remap(coarse.astype(np.float32), at_x, at_y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
    )
