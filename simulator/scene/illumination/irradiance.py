"""Earth-shine and moon-shine on the spacecraft, as an irradiance field over directions.

The visible part of the Earth is sampled from the target: each sample's radiance is the sunlight there times the albedo
of ground and clouds. The field is stored in two forms: irradiance on a plate of any normal, a second-degree polynomial
(Ramamoorthi & Hanrahan 2001, An efficient representation for irradiance environment maps), and radiance of the Earth's
disc, linear in direction, for reflections.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.geometry.directions import orthonormal_basis, spherical_fibonacci
from flyaround.simulator.scene.illumination.moonlight import moonlight_share

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray
    from flyaround.simulator.world.ephemeris.body import Body

_SAMPLES = 256  # directions over a globe's disc
_PLATES = 96  # plate normals to which the field is fitted
_GRADIENT = np.arange(3)  # the gradient's terms, which are regularised


@dataclass(frozen=True, eq=False)
class IrradianceField:
    """Irradiance from all sources but the Sun on a plate of any normal, camera frame.

    Parameters
    ----------
    irradiance_w_m2 : (10, n) array
        Coefficients per band of 1, x, y, z, xy, yz, zx, 3 z^2 - 1, x^2 - y^2 of the normal, and of the fourth Legendre
        polynomial of its cosine with ``axis``, about which a disc is symmetric.
    radiance_w_m2_sr : (n, 4) array
        Radiance inside the disc per band: gradient over directions, and constant.
    disc_cosine : float
        Cosine of the disc's angular radius about ``axis``; -2 for light from everywhere.
    axis : (3,) array
        Unit vector to the disc's centre.
    """

    irradiance_w_m2: FloatArray
    radiance_w_m2_sr: FloatArray
    disc_cosine: float
    axis: FloatArray


def basis(directions: FloatArray, axis: FloatArray) -> FloatArray:
    """Return the basis polynomials of `IrradianceField.irradiance_w_m2`.

    Returns
    -------
    (..., 10) array
        Values for unit vectors of shape (..., 3), in the order of that field's coefficients.
    """
    d = np.asarray(directions, float)
    x, y, z = np.moveaxis(d, -1, 0)
    return np.stack(
        [np.ones_like(x), x, y, z, x * y, y * z, z * x, 3 * z * z - 1, x * x - y * y, _legendre_4(d @ axis)],
        axis=-1,
    )


def _legendre_4(cosine: FloatArray) -> FloatArray:
    """Return the fourth Legendre polynomial."""
    c2 = cosine * cosine
    return np.asarray((35 * c2 * c2 - 30 * c2 + 3) / 8)


_NORMALS = spherical_fibonacci(_PLATES)
_DESIGN = basis(_NORMALS, np.array([0.0, 0.0, 1.0]))  # the last column needs its axis


def _fit_irradiance(axis: FloatArray, irradiance: FloatArray) -> FloatArray:
    """Fit (10, n) coefficients, by least squares, to the irradiance (P, n) of plates with normals ``_NORMALS``."""
    design = _DESIGN.copy()
    design[:, 9] = _legendre_4(_NORMALS @ axis)
    return np.asarray(np.linalg.solve(design.T @ design, design.T @ irradiance), float)


def dark_field(bands: int) -> IrradianceField:
    """Return a field without light.

    Returns
    -------
    IrradianceField
        Field of zeros for ``bands`` bands, whose disc contains no direction.
    """
    return IrradianceField(np.zeros((10, bands)), np.zeros((bands, 4)), 2.0, np.array([0.0, 0.0, 1.0]))


def uniform_field(radiance_w_m2_sr: FloatArray) -> IrradianceField:
    """Return the field of uniform radiance from all directions, for white-furnace tests.

    Returns
    -------
    IrradianceField
        Field for white-furnace tests: on a plate of any normal, irradiance pi times the radiance.
    """
    radiance = np.asarray(radiance_w_m2_sr, float)
    irradiance = np.zeros((10, len(radiance)))
    irradiance[0] = np.pi * radiance
    linear = np.zeros((len(radiance), 4))
    linear[:, 3] = radiance
    return IrradianceField(irradiance, linear, -2.0, np.array([0.0, 0.0, 1.0]))


def field_of_samples(
    directions: FloatArray,
    radiance: FloatArray,
    solid_angle_sr: float | FloatArray,
    disc_cosine: float,
    axis: FloatArray,
    additional_w_m2: FloatArray | None = None,
    disc: int | None = None,
) -> IrradianceField:
    """Fit the field of a disc to samples.

    Parameters
    ----------
    directions : (K, 3) array
        Unit vectors from the target.
    radiance : (K, n) array
        [W m-2 sr-1].
    solid_angle_sr : float or array
        Solid angle of each sample, or (K,).
    disc_cosine : float
        Cosine of the disc's angular radius.
    axis : (3,) array
        Direction of the disc's centre.
    additional_w_m2 : (P, n) array, optional
        Irradiance of other light, from `moon_plate_irradiance`.
    disc : int, optional
        Number of samples, first in order, that are on the disc; the others surround it.

    Returns
    -------
    IrradianceField
        Irradiance by the direction of a face.
    """
    solid_angles = np.broadcast_to(solid_angle_sr, len(directions))[:, None]
    falling = np.maximum(_NORMALS @ directions.T, 0) @ (radiance * solid_angles)
    if additional_w_m2 is not None:
        falling += additional_w_m2
    directions, radiance, solid_angles = directions[:disc], radiance[:disc], solid_angles[:disc]
    design = np.ones((len(directions), 4))
    design[:, :3] = directions
    weighted = design * (solid_angles / solid_angles.mean())
    # a small weight on the gradient, which a small or uniform disc leaves undetermined
    normal_equations = design.T @ weighted
    normal_equations[_GRADIENT, _GRADIENT] += 1e-4 * len(directions)
    linear = np.linalg.solve(normal_equations, weighted.T @ radiance)
    return IrradianceField(_fit_irradiance(axis, falling), np.asarray(linear.T, float), disc_cosine, axis)


@lru_cache(maxsize=2)
def albedo_of(body: Body) -> Float32Array:
    """Return the albedo of a body's ground.

    Returns
    -------
    (H, W) or (1, 1) array
        Albedo 0 to 1, float32: the body's map with the north pole in row 0, or its mean if it has no map. Cached:
        callers must not write to it.

    Raises
    ------
    UserError
        If the map cannot be read.
    """
    if body.albedo_map is None:
        return np.full((1, 1), body.albedo, np.float32)
    image = cv2.imread(body.albedo_map, cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise UserError(f"the albedo map of {body.title}, {body.albedo_map}, cannot be read")
    return np.asarray(image, np.float32) / np.float32(255)


def globe_shine(
    r_target_globe_m: FloatArray,
    sun_globe: FloatArray,
    R_camera_from_globe: FloatArray,
    sun_w_m2: FloatArray,
    albedo: Float32Array,
    radius_m: float,
    additional_w_m2: FloatArray | None = None,
) -> IrradianceField:
    """Compute the light of the part of a globe that is visible from a target.

    Parameters
    ----------
    r_target_globe_m : array
        Position of the target, axes of the globe [m].
    sun_globe : array
        Unit vector to the Sun, axes of the globe.
    R_camera_from_globe : (3, 3) array
        Rotation from the globe's axes to the camera's.
    sun_w_m2 : array
        Irradiance of the Sun at the globe, per band.
    albedo : (H, W) array
        Lambertian albedo, equirectangular, row 0 in the north, column 0 at -180 degrees; or (1, 1).
    radius_m : float
        Radius of the globe, here a sphere.
    additional_w_m2 : array, optional
        Irradiance of other light, see `field_of_samples`.

    Returns
    -------
    IrradianceField
        Irradiance by the direction of a face [W m-2].
    """
    distance = float(np.linalg.norm(r_target_globe_m))
    sine = min(radius_m / distance, 1.0)
    rim = float(np.sqrt(1 - sine * sine))
    zenith = r_target_globe_m / distance
    cap = spherical_fibonacci(_SAMPLES, rim)
    c = cap[:, 2]
    # in units of the radius
    above = distance / radius_m
    along = above * c - np.sqrt(np.maximum(1 - above**2 * (1 - c * c), 0))
    axes = orthonormal_basis(zenith)
    axes[2] = -zenith
    rays = cap @ axes
    ground = above * zenith + along[:, None] * rays
    height, width = albedo.shape
    latitude = np.arcsin(np.minimum(np.maximum(ground[:, 2], -1), 1))
    row = np.minimum((0.5 - latitude / np.pi) * height, height - 1).astype(int)
    column = ((np.arctan2(ground[:, 1], ground[:, 0]) / (2 * np.pi) + 0.5) * width).astype(int) % width
    light = albedo[row, column] / np.pi * np.maximum(ground @ sun_globe, 0)
    solid_angle = 2 * np.pi * (1 - rim) / _SAMPLES
    return field_of_samples(
        rays @ R_camera_from_globe.T,
        light[:, None] * sun_w_m2,
        solid_angle,
        rim,
        -R_camera_from_globe @ zenith,
        additional_w_m2,
    )


def moon_shine(
    r_moon_from_target_m: FloatArray,
    sun: FloatArray,
    R_camera: FloatArray,
    sun_w_m2: FloatArray,
    axis: FloatArray,
) -> FloatArray:
    """Compute (10, n) coefficients of moonlight from the Moon's phase.

    Parameters
    ----------
    r_moon_from_target_m : (3,) array
        Position of the Moon relative to the target [m].
    sun : array
        Unit vector to the Sun, in the frame of ``r_moon_from_target_m``.
    R_camera : array
        Rotation from it to the camera.
    sun_w_m2 : (n,) array
        Solar irradiance per band.
    axis : array
        Axis of the field to which the coefficients belong, camera frame.
    """
    return _fit_irradiance(axis, moon_plate_irradiance(r_moon_from_target_m, sun, R_camera, sun_w_m2))


def moon_plate_irradiance(
    r_moon_from_target_m: FloatArray, sun: FloatArray, R_camera: FloatArray, sun_w_m2: FloatArray
) -> FloatArray:
    """Return the irradiance of moonlight on the plates of the fit; the parameters are those of `moon_shine`.

    Returns
    -------
    (P, n) array
        Irradiance per band [W m-2], for the ``additional_w_m2`` of `field_of_samples`.
    """
    direction = r_moon_from_target_m / np.linalg.norm(r_moon_from_target_m)
    share = moonlight_share(r_moon_from_target_m, sun)
    return np.asarray(np.maximum(_NORMALS @ (R_camera @ direction), 0)[:, None] * (sun_w_m2 * share))
