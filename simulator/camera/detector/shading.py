"""Vignetting, veiling glare, glow and scatter: light that is lost or scattered in the lens."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.camera.detector.psf_pyramid import TAPS_PER_SIDE, Pyramid

if TYPE_CHECKING:
    from flyaround.simulator.camera.detector.optics import Optics
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray

_STEP_PX = 16  # spacing of the grid on which smooth fields are computed
_SUN_WINDOW_PX = 128  # half the side of the window around the Sun in which glare is computed per pixel
_SUN_CORE_DEG = 0.3  # angle from the Sun's centre within which glare is constant, inside the disc
_GLOW_STEP_PX = 4  # binning before a wide blur; its error is far below one digital number
_WIDTH_RATIO = (
    3.0  # of the tail's two Gaussians, half of the light each, which together approximate a power law
)
_SCATTER_TAPS = 2  # reach of the kernel on each side [samples]
_SCATTER_POWER = 2.5  # exponent of the distance in the wings of the PSF, chosen among those of optics, 2 to 3


@lru_cache(maxsize=4)
def vignetting(camera: Camera, optics: Optics) -> Float32Array | None:
    """Return the fraction of the light that reaches each pixel.

    Natural vignetting is cos^4 of the angle from the axis. Mechanical vignetting is the overlap of the aperture (a unit
    disc) with a rear rim (a disc of ``rim_radius``), whose centre is shifted by ``mechanical_vignetting`` x tan(angle).

    Returns
    -------
    (H, W) array or None
        Fraction relative to the axis, float32; None without vignetting. Cached: callers must not write to it.
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
        share *= disc_overlap_area(shift, 1.0, optics.rim_radius) / disc_overlap_area(
            np.zeros(1), 1.0, optics.rim_radius
        )
    return _interpolate(camera, share)


def disc_overlap_area(distance: FloatArray, a: float, b: float) -> FloatArray:
    """Return the overlap area of two discs of radii ``a`` and ``b``."""
    d = np.clip(distance, abs(a - b) + 1e-12, a + b - 1e-12)
    angle_a = np.arccos(np.clip((d * d + a * a - b * b) / (2 * d * a), -1, 1))
    angle_b = np.arccos(np.clip((d * d + b * b - a * a) / (2 * d * b), -1, 1))
    overlap = a * a * (angle_a - np.sin(2 * angle_a) / 2) + b * b * (angle_b - np.sin(2 * angle_b) / 2)
    smaller_disc = np.pi * min(a, b) ** 2
    return np.asarray(
        np.where(distance <= abs(a - b), smaller_disc, np.where(distance >= a + b, 0.0, overlap))
    )


def veiling_glare(
    camera: Camera, optics: Optics, sun_direction: FloatArray, sun_irradiance_w_m2: FloatArray
) -> Float32Array | None:
    """Return (H, W) or (H, W, n) radiance that the Sun scatters into the image [W m-2 sr-1], or None.

    Parameters
    ----------
    camera : Camera
        The camera.
    optics : Optics
        The optics.
    sun_direction : array
        Unit vector, camera frame.
    sun_irradiance_w_m2 : array
        Irradiance of the visible part, per band.

    Returns
    -------
    (H, W) or (H, W, n) array, or None
        Radiance [W m-2 sr-1]; None without glare.

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
    # interpolate the square of the angle, which is smooth everywhere; its inverse is not smooth near the Sun
    field = _interpolate(camera, _square_deg2(_coarse_rays(camera), sun_direction))
    patch = _window_around(camera, sun_direction)
    if patch is not None:
        # single precision on the grid is not enough for the smallest angles
        y, x = np.meshgrid(*(np.arange(s.start, s.stop) for s in patch), indexing="ij")
        field[patch] = _square_deg2(camera.rays(np.stack([x, y], axis=-1)), sun_direction)
    field = np.asarray(optics.veiling_glare_sr / np.maximum(field, np.float32(_SUN_CORE_DEG**2)), np.float32)
    irradiance = np.asarray(sun_irradiance_w_m2, np.float32)
    return field * irradiance[0] if irradiance.size == 1 else field[..., None] * irradiance


def _square_deg2(rays: FloatArray, sun_direction: FloatArray) -> FloatArray:
    """Return the squared angle from the Sun [deg2]."""
    return np.asarray(np.rad2deg(np.arccos(np.clip(rays @ sun_direction, -1, 1))) ** 2)


def _window_around(camera: Camera, direction: FloatArray) -> tuple[slice, slice] | None:
    """Return rows and columns of the image near a direction; None if there are none."""
    if direction[2] <= 0:
        return None
    x, y = camera.project(direction)
    if not np.isfinite([x, y]).all():
        return None
    rows = slice(max(int(y) - _SUN_WINDOW_PX, 0), min(int(y) + _SUN_WINDOW_PX, camera.height_px))
    columns = slice(max(int(x) - _SUN_WINDOW_PX, 0), min(int(x) + _SUN_WINDOW_PX, camera.width_px))
    return (rows, columns) if rows.start < rows.stop and columns.start < columns.stop else None


def _coarse_rays(camera: Camera) -> FloatArray:
    """Return rays of a grid of points from corner to corner of the image."""
    columns, rows = (-(-n // _STEP_PX) + 1 for n in (camera.width_px, camera.height_px))
    x, y = np.meshgrid(
        np.linspace(0, camera.width_px - 1, columns), np.linspace(0, camera.height_px - 1, rows)
    )
    return camera.rays(np.stack([x, y], axis=-1))


def _interpolate(camera: Camera, coarse: FloatArray) -> Float32Array:
    """Interpolate the grid's values at every pixel by cubic splines."""
    row_weights, column_weights = (
        _weights(coarse.shape[0], camera.height_px),
        _weights(coarse.shape[1], camera.width_px),
    )
    return np.asarray(row_weights @ (coarse.astype(np.float32) @ column_weights.T), np.float32)


@lru_cache(maxsize=8)
def _weights(nodes: int, count: int) -> Float32Array:
    """Return the (count, nodes) weights of a uniform grid's nodes at points between its ends."""
    from scipy.interpolate import make_interp_spline  # noqa: PLC0415 - slow to import, and few cameras shade

    spline = make_interp_spline(np.linspace(0, 1, nodes), np.eye(nodes), k=min(3, nodes - 1))
    return np.asarray(spline(np.linspace(0, 1, count)), np.float32)


def glow(image: Float32Array, optics: Optics) -> Float32Array:
    """Spread ``glow_share`` of the light into a wide tail of the point spread function.

    Without glow the image itself is returned.

    Parameters
    ----------
    image : (H, W) or (H, W, n) array
        Linear light, dark beyond its border.
    optics : Optics
        The optics.

    Returns
    -------
    array
        Image of the same shape and sum of light, but for what leaves its border.
    """
    if optics.glow_share <= 0:
        return image
    height, width = image.shape[:2]
    binned = cv2.resize(
        image, (-(-width // _GLOW_STEP_PX), -(-height // _GLOW_STEP_PX)), interpolation=cv2.INTER_AREA
    ).astype(np.float32)
    tail = np.zeros_like(binned)
    for factor in (1.0, _WIDTH_RATIO):
        sigma = max(factor * optics.glow_radius_px / _GLOW_STEP_PX, 0.5)
        tail += 0.5 * cv2.GaussianBlur(binned, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
    full_size_tail = cv2.resize(tail, (width, height), interpolation=cv2.INTER_LINEAR)
    share = np.float32(optics.glow_share)
    return np.asarray(image * (1 - share) + share * full_size_tail, np.float32)


def scatter(image: Float32Array, optics: Optics) -> Float32Array:
    """Spread ``scatter_share`` of the light into wings of the PSF that fall as a power of the distance.

    The image's border is replicated.

    Returns
    -------
    array
        Image of the same shape, float32; without scatter the given image itself.

    References
    ----------
    King (1971), The profile of a star image, PASP 83, 199 (wings of measured images). Peterson (2004), Analytic
    expressions for in-field scattered light distributions, Proc. SPIE 5178, 184 (powers of the angle). ISO 9358 defines
    how veiling glare is measured.
    """
    return image if optics.scatter_share <= 0 else scattering_pyramid(optics.scatter_share).blur(image, 1.0)


@lru_cache(maxsize=8)
def scattering_pyramid(share: float) -> Pyramid:
    """Return the wings as a pyramid of Gaussians, each twice as wide as the last, which approximate a power law."""
    weights = 2.0 ** (-(_SCATTER_POWER - 2) * np.arange(1, len(TAPS_PER_SIDE)))
    position = np.arange(-_SCATTER_TAPS, _SCATTER_TAPS + 1)
    gaussian = np.exp(-(position**2) / 2)
    gaussian /= gaussian.sum()
    taps = [
        np.array([[1 - share]]),
        *(w * np.outer(gaussian, gaussian) for w in share * weights / weights.sum()),
    ]
    return Pyramid(tuple(t.astype(np.float32) for t in taps))
