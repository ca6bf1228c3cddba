"""Projection from the camera frame (OpenCV's conventions) to OpenGL's clip space.

A framebuffer's row 0 holds the image's row 0 (the top). So pixel (x, y) of OpenCV is the fragment whose
``gl_FragCoord.xy`` is (x + 0.5, y + 0.5), and an image needs no flip after it is read back.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from pyrr.matrix44 import create_perspective_projection_from_bounds

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.runtime.arrays import FloatArray


@dataclass(frozen=True)
class PixelRect:
    """A rectangle of whole pixels: x0 <= x < x1, y0 <= y < y1."""

    x0: int
    y0: int
    x1: int
    y1: int

    @property
    def width(self) -> int:
        """Width [px]."""
        return self.x1 - self.x0

    @property
    def height(self) -> int:
        """Height [px]."""
        return self.y1 - self.y0

    @property
    def viewport(self) -> tuple[int, int, int, int]:
        """Viewport for OpenGL: x, y, width, height."""
        return (self.x0, self.y0, self.width, self.height)

    def intersection(self, other: PixelRect) -> PixelRect | None:
        """Return the intersection with another rectangle.

        Returns
        -------
        PixelRect or None
            Common pixels; None if there are none.
        """
        x0, y0 = max(self.x0, other.x0), max(self.y0, other.y0)
        x1, y1 = min(self.x1, other.x1), min(self.y1, other.y1)
        return PixelRect(x0, y0, x1, y1) if x1 > x0 and y1 > y0 else None

    def union(self, other: PixelRect) -> PixelRect:
        """Return the bounding rectangle of two.

        Returns
        -------
        PixelRect
            Smallest rectangle that holds both; it may hold pixels of neither.
        """
        low, high = (
            (min(self.x0, other.x0), min(self.y0, other.y0)),
            (max(self.x1, other.x1), max(self.y1, other.y1)),
        )
        return PixelRect(*low, *high)


def clip_from_camera(
    camera: Camera, near_m: float, far_m: float, buffer_from_pixel: FloatArray, size: tuple[int, int]
) -> FloatArray:
    """Return the (4, 4) matrix from the camera frame [m] to clip space of a framebuffer.

    Parameters
    ----------
    camera : Camera
        The camera, as a pinhole: its distortion is not applied.
    near_m : float
        Camera z of the near plane.
    far_m : float
        Camera z of the far plane.
    buffer_from_pixel : (2, 3) array
        Affine map from image pixels (x, y, 1) to framebuffer coordinates, in which the first fragment's centre is (0.5,
        0.5). Plain images use ``IMAGE_FROM_PIXEL``.
    size : tuple of int
        Width and height of the framebuffer's viewport [px].
    """
    # OpenGL's camera looks along -z; its "bottom" is the framebuffer's row 0, the image's top
    left_m, right_m = near_m * (np.array([-0.5, camera.width_px - 0.5]) - camera.cx_px) / camera.fx_px
    top_m, bottom_m = near_m * (np.array([-0.5, camera.height_px - 0.5]) - camera.cy_px) / camera.fy_px
    frustum = create_perspective_projection_from_bounds(left_m, right_m, top_m, bottom_m, near_m, far_m)
    image_clip = frustum.T @ np.diag([1.0, 1.0, -1.0, 1.0])
    # from the image's clip space to its pixels, to the buffer's pixels, and to the buffer's clip space
    width, height = camera.width_px, camera.height_px
    pixel_from_clip = np.array(
        [[width / 2, 0.0, (width - 1) / 2], [0.0, height / 2, (height - 1) / 2], [0.0, 0.0, 1.0]]
    )
    window = np.eye(4)
    window[:2, [0, 1, 3]] = 2 * (buffer_from_pixel @ pixel_from_clip) / np.reshape(size, (2, 1)) - [
        [0, 0, 1],
        [0, 0, 1],
    ]
    return np.asarray(window @ image_clip)


def project_rays(camera: Camera, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Project rays, given by x / z and y / z, to columns and rows of the image [px]."""
    if not camera.distortion.is_none:
        x, y = np.moveaxis(camera.domain.distort(np.stack([x, y], axis=-1)), -1, 0)
    return x * camera.fx_px + camera.cx_px, y * camera.fy_px + camera.cy_px


IMAGE_FROM_PIXEL = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.5]])
"""Affine map from pixel coordinates to those of a framebuffer that holds the whole image."""


def window_from_pixel(rect: PixelRect) -> FloatArray:
    """Return the (2, 3) affine map from pixel coordinates to those of a framebuffer that holds only ``rect``."""
    return IMAGE_FROM_PIXEL - np.array([[0.0, 0.0, rect.x0], [0.0, 0.0, rect.y0]])


@lru_cache(maxsize=16)  # a camera's frames use the same few grids
def _undistorted(camera: Camera, x_px: bytes, y_px: bytes) -> FloatArray:
    """Return (len(y), len(x), 2) undistorted rays through a grid of pixels; columns and rows are float64 bytes."""
    return camera.unproject(np.stack(np.meshgrid(np.frombuffer(x_px), np.frombuffer(y_px)), axis=-1))


def directions(camera: Camera, x_px: FloatArray, y_px: FloatArray, matrix: FloatArray) -> FloatArray:
    """Return (len(y), len(x), 3) unit vectors of rays through a grid of pixels; NaN outside the lens's range.

    Parameters
    ----------
    camera : Camera
        The camera.
    x_px : array
        Columns of the grid.
    y_px : array
        Rows of the grid.
    matrix : (3, 3) array
        Matrix applied to the rays' camera coordinates.
    """
    if camera.distortion.is_none:
        column = (x_px - camera.cx_px)[:, None] / camera.fx_px * matrix[:, 0]
        row = (y_px - camera.cy_px)[:, None] / camera.fy_px * matrix[:, 1]
        d = row[:, None] + (column + matrix[:, 2])
    else:
        d = _undistorted(camera, x_px.tobytes(), y_px.tobytes()) @ matrix[:, :2].T + matrix[:, 2]
    return np.asarray(d / np.sqrt(np.einsum("ijk,ijk->ij", d, d))[..., None])
