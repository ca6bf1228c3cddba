"""Geometry of a camera: intrinsics and lens, projection and its inverse in OpenCV's conventions.

x right, y down, z forward; pixel (0, 0) is the centre of the top-left pixel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, get_args

import numpy as np
from msgspec import UNSET, UnsetType

from flyaround.simulator.camera.encoding import Encoding
from flyaround.simulator.camera.lens.distortion import (
    Distortion,
    DistortionModel,
    LensDomain,
    jacobian,
    lens_domain,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flyaround.simulator.runtime.arrays import FloatArray

__all__ = ["Camera", "Distortion", "DistortionModel"]

MAX_IMAGE_PX = 16384
"""Largest width and height of an image, which every OpenGL 4.1 driver can draw."""
FOCAL_PX = (1.0, 1e7)
"""Smallest and largest focal length of files and recorded scenes."""
CENTRE_PX = (-1e5, 1e5)
"""Smallest and largest coordinate of a principal point."""
_NO_DISTORTION = Distortion()
_NODES, _STEP_RAD = 25, 1e-3  # points per side of the grid of `_bending`, and the step of its differences


@dataclass(frozen=True, kw_only=True)
class Camera:
    """Intrinsics of one camera; this object as JSON is the CAMERA.json of the command line.

    Parameters
    ----------
    width_px : int
        Width of the image.
    height_px : int
        Height of the image.
    fx_px : float
        Focal length over the width of a pixel.
    fy_px : float
        Focal length over the height of a pixel.
    cx_px : float
        Column of the principal point; (0, 0) is the centre of the top-left pixel.
    cy_px : float
        Row of the principal point.
    distortion : Distortion, optional
        Model and coefficients of the lens.
    encoding : Encoding, optional
        Transfer function of its images, absent where they are linear: see `pixel_encoding`.

    Raises
    ------
    ValueError
        If the image has no pixels, a focal length or the principal point is not a finite number, or the encoding is
        unknown.
    """

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    distortion: Distortion = _NO_DISTORTION
    encoding: Encoding | UnsetType = UNSET

    def __post_init__(self) -> None:
        if not all(
            isinstance(side, (int, np.integer)) and side > 0 for side in (self.width_px, self.height_px)
        ):
            raise ValueError(
                f"a camera has {self.width_px} x {self.height_px} pixels, allowed: whole numbers above 0"
            )
        numbers = (self.fx_px, self.fy_px, self.cx_px, self.cy_px)
        if not (all(map(math.isfinite, numbers)) and min(numbers[:2]) > 0):
            raise ValueError(
                f"a camera has the focal lengths {self.fx_px:g}, {self.fy_px:g} and the principal point "
                f"{self.cx_px:g}, {self.cy_px:g} px, allowed: finite numbers, and focal lengths above 0"
            )
        if self.pixel_encoding not in get_args(Encoding):
            raise ValueError(
                f"a camera has the encoding {self.encoding!r}, allowed: {', '.join(get_args(Encoding))}"
            )
        # one form for one camera: "linear" and absent are the same
        if self.encoding == "linear":
            object.__setattr__(self, "encoding", UNSET)

    @property
    def pixel_encoding(self) -> Encoding:
        """Transfer function of the images: ``linear``, ``srgb`` or ``gamma``."""
        return "linear" if isinstance(self.encoding, UnsetType) else self.encoding

    @property
    def K(self) -> FloatArray:
        """(3, 3) matrix of intrinsics, for ``cv2.projectPoints``."""
        return np.array([[self.fx_px, 0, self.cx_px], [0, self.fy_px, self.cy_px], [0, 0, 1.0]])

    @property
    def domain(self) -> LensDomain:
        """The lens over this image."""
        return _domain(self)

    def project(self, points_camera_m: ArrayLike) -> FloatArray:
        """Return pixel positions of points in the camera frame; NaN for points behind the camera.

        Visible points are projected as OpenCV does; points beyond the lens's domain stay outside the image.

        Parameters
        ----------
        points_camera_m : array_like
            (..., 3) [m].

        Returns
        -------
        (..., 2) array
            Pixel coordinates.

        Raises
        ------
        ValueError
            If the last axis does not hold three numbers.
        """
        p = np.asarray(points_camera_m, float)
        if p.shape[-1:] != (3,):
            raise ValueError(f"a point has three coordinates, got the shape {p.shape}")
        z = np.where(p[..., 2] > 1e-9, p[..., 2], np.nan)
        xy = p[..., :2] / z[..., None]
        if not self.distortion.is_none:
            xy = self.domain.distort(xy)
        return xy * (self.fx_px, self.fy_px) + (self.cx_px, self.cy_px)

    def unproject(self, pixels_px: ArrayLike) -> FloatArray:
        """Return undistorted rays (x / z, y / z) of pixel positions; NaN outside the lens's field of view.

        Parameters
        ----------
        pixels_px : array_like
            (..., 2) pixel coordinates, at most a few per cent outside the image.

        Returns
        -------
        (..., 2) array
            Normalised coordinates: the ray is (x, y, 1).

        Raises
        ------
        ValueError
            If the last axis does not hold two numbers.
        """
        pixels = np.asarray(pixels_px, float)
        if pixels.shape[-1:] != (2,):
            raise ValueError(f"a pixel position has two coordinates, got the shape {pixels.shape}")
        image_xy = (pixels - (self.cx_px, self.cy_px)) / (self.fx_px, self.fy_px)
        return image_xy if self.distortion.is_none else self.domain.undistort(image_xy)

    def rays(self, pixels_px: ArrayLike) -> FloatArray:
        """Return the unit vectors (..., 3) in the camera frame through pixel positions (..., 2).

        Returns
        -------
        (..., 3) array
            Unit vectors, camera frame; NaN outside the lens's domain.
        """
        xy = self.unproject(pixels_px)
        ray = np.concatenate([xy, np.ones((*xy.shape[:-1], 1))], axis=-1)
        return np.asarray(ray / np.linalg.norm(ray, axis=-1, keepdims=True))

    def pixel_solid_angle_sr(self, pixels_px: ArrayLike) -> FloatArray:
        """Return the solid angle (...) of one pixel at pixel positions (..., 2) [sr].

        Returns
        -------
        (...) array
            Solid angles [sr].
        """
        return self.ray_solid_angle_sr(self.unproject(pixels_px))

    def ray_solid_angle_sr(self, xy: FloatArray) -> FloatArray:
        """Return the solid angle (...) of one pixel at undistorted rays (..., 2) of (x / z, y / z) [sr].

        Returns
        -------
        (...) array
            Solid angles [sr].
        """
        area = 1 / (self.fx_px * self.fy_px * (1 + (xy**2).sum(axis=-1)) ** 1.5)
        if self.distortion.is_none:
            return np.asarray(area)
        return np.asarray(area / np.linalg.det(jacobian(self.distortion, xy)))

    def border(self, count: int = 33, margin_px: float = 0.0) -> FloatArray:
        """Return pixel positions (4 count, 2) along the image's edges, corners included.

        Parameters
        ----------
        count : int, optional
            Number of points per edge.
        margin_px : float, optional
            Distance of the points outside the image.

        Returns
        -------
        (4 count, 2) array
            Columns and rows [px].
        """
        x = np.linspace(-0.5 - margin_px, self.width_px - 0.5 + margin_px, count)
        y = np.linspace(-0.5 - margin_px, self.height_px - 0.5 + margin_px, count)
        return np.concatenate(
            [
                np.stack([x, np.full(count, y[0])], -1),
                np.stack([x, np.full(count, y[-1])], -1),
                np.stack([np.full(count, x[0]), y], -1),
                np.stack([np.full(count, x[-1]), y], -1),
            ]
        )

    def half_angle_rad(self) -> float:
        """Return the largest angle from the boresight that the image shows [rad].

        Returns
        -------
        float
            Angle [rad].
        """
        return _half_angle_rad(self)

    def pixel_angle_rad(self) -> float:
        """Return the largest angle that one pixel of the image spans [rad]; for a pinhole 1 / f, at its centre.

        Returns
        -------
        float
            Angle [rad].
        """
        if self.distortion.is_none:
            return 1 / min(self.fx_px, self.fy_px)
        return _pixel_angle_rad(self)

    def bending_px_rad2(self, bounds_px: tuple[float, float, float, float] | None = None) -> float:
        """Return the largest curvature of the image of a great circle [px rad-2].

        The image of a straight line that subtends a small angle a deviates from a straight line by up to ``a**2 / 8``
        times this value.

        Parameters
        ----------
        bounds_px : tuple of float, optional
            x0, y0, x1, y1 of the part of the image that is requested.

        Returns
        -------
        float
            Curvature [px rad-2]; 0 for a pinhole.
        """
        if self.distortion.is_none:
            return 0.0
        x, y, bending = _bending(self)
        if bounds_px is not None:
            x0, y0, x1, y1 = bounds_px
            columns = slice(max(np.searchsorted(x, x0) - 1, 0), np.searchsorted(x, x1) + 1)
            rows = slice(max(np.searchsorted(y, y0) - 1, 0), np.searchsorted(y, y1) + 1)
            bending = bending[rows, columns]
        return float(bending.max(initial=0.0))

    def contains(self, pixels_px: ArrayLike) -> np.typing.NDArray[np.bool_]:
        """Return a mask (...) of pixel positions (..., 2) inside the image; its edges are at -0.5 and size - 0.5.

        Returns
        -------
        (...) array of bool
            True inside the image.
        """
        p = np.asarray(pixels_px, float)
        with np.errstate(invalid="ignore"):
            is_inside = (
                (p[..., 0] >= -0.5)
                & (p[..., 0] < self.width_px - 0.5)
                & (p[..., 1] >= -0.5)
                & (p[..., 1] < self.height_px - 0.5)
            )
        return np.asarray(is_inside)

    def resized(self, width_px: int) -> Camera:
        """Return a camera with the same field of view and another number of pixels.

        With the scale s, a principal point c becomes ``(c + 0.5) s - 0.5``.

        Returns
        -------
        Camera
            Camera with scaled intrinsics and the same lens.
        """
        s = width_px / self.width_px
        return replace(
            self,
            width_px=width_px,
            height_px=round(self.height_px * s),
            fx_px=self.fx_px * s,
            fy_px=self.fy_px * s,
            cx_px=(self.cx_px + 0.5) * s - 0.5,
            cy_px=(self.cy_px + 0.5) * s - 0.5,
        )


def reduced_camera(camera: Camera, divisor: int) -> Camera:
    """Return the same lens on ``divisor`` times fewer pixels each way.

    A pixel's index is its centre, so a coarse pixel's centre lies half a coarse pixel from the image's edge:
    ``c' = (c + 1/2) / divisor - 1/2``.

    Returns
    -------
    Camera
        The camera; rows and columns that fill no coarse pixel are left out.
    """
    if divisor == 1:
        return camera
    return replace(
        camera,
        width_px=max(camera.width_px // divisor, 1),
        height_px=max(camera.height_px // divisor, 1),
        fx_px=camera.fx_px / divisor,
        fy_px=camera.fy_px / divisor,
        cx_px=(camera.cx_px + 0.5) / divisor - 0.5,
        cy_px=(camera.cy_px + 0.5) / divisor - 0.5,
    )


@lru_cache(maxsize=256)
def _half_angle_rad(camera: Camera) -> float:
    return float(np.arccos(camera.rays(camera.border())[:, 2].min()))


@lru_cache(maxsize=64)
def _pixel_angle_rad(camera: Camera) -> float:
    x = np.linspace(-0.5, camera.width_px - 0.5, 17)
    y = np.linspace(-0.5, camera.height_px - 0.5, 17)
    pixels = np.stack(np.meshgrid(x, y), axis=-1)
    ray = camera.rays(pixels)
    steps = (np.linalg.norm(camera.rays(pixels + step) - ray, axis=-1) for step in ((1.0, 0.0), (0.0, 1.0)))
    return float(max(step.max() for step in steps))


@lru_cache(maxsize=64)
def _bending(camera: Camera) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return columns, rows and values (N, N) of `Camera.bending_px_rad2` on a grid over the image."""
    x = np.linspace(-0.5, camera.width_px - 0.5, _NODES)
    y = np.linspace(-0.5, camera.height_px - 0.5, _NODES)
    ray = camera.rays(np.stack(np.meshgrid(x, y), axis=-1))
    right = np.cross([0.0, 1.0, 0.0], ray)
    right /= np.linalg.norm(right, axis=-1, keepdims=True)
    down = np.cross(ray, right)
    middle, bending = camera.project(ray), np.zeros((_NODES, _NODES))
    for angle in np.arange(8) * (np.pi / 8):
        step = _STEP_RAD * (np.cos(angle) * right + np.sin(angle) * down)
        behind_px, ahead_px = camera.project(ray - step), camera.project(ray + step)
        tangent, second_difference = ahead_px - behind_px, behind_px + ahead_px - 2 * middle
        cross = tangent[..., 0] * second_difference[..., 1] - tangent[..., 1] * second_difference[..., 0]
        curvature = (
            np.abs(cross) / np.maximum(np.hypot(tangent[..., 0], tangent[..., 1]), 1e-12) / _STEP_RAD**2
        )
        bending = np.fmax(bending, curvature)
    return x, y, bending


@lru_cache(maxsize=256)
def _domain(camera: Camera) -> LensDomain:
    # two pixels beyond the edge, where rays are interpolated; not strict, because a window may reach beyond the lens
    return lens_domain(camera.distortion, _border_xy(camera), strict=False)


def _border_xy(camera: Camera) -> FloatArray:
    with np.errstate(over="ignore"):  # a focal length near zero overflows
        return (camera.border(margin_px=2.0) - (camera.cx_px, camera.cy_px)) / (camera.fx_px, camera.fy_px)


def camera_problem(camera: Camera) -> str | None:
    """Describe what is wrong with a camera's lens over its image.

    Returns
    -------
    str or None
        Parameter and reason; None if the camera can be used.
    """
    try:
        lens_domain(camera.distortion, _border_xy(camera))
    except ValueError as error:
        return f"{'fx_px' if camera.distortion.is_none else 'distortion.coefficients'}: {error}"
    return None
