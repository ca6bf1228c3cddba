"""From the camera's pinhole to OpenGL's clip space: the one place where the two conventions meet.

A framebuffer's row 0 holds the image's row 0 (the top), so that pixel (x, y) of OpenCV is the fragment whose
``gl_FragCoord.xy`` is (x + 0.5, y + 0.5) and a read-back needs no flip. OpenGL would call this picture upside down.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from simulator.camera.lens.camera_model import Camera
    from simulator.runtime.arrays import FloatArray


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
        """As OpenGL wants it: x, y, width, height."""
        return (self.x0, self.y0, self.width, self.height)


def clip_from_camera(
    camera: Camera, near_m: float, far_m: float, buffer_from_pixel: FloatArray, size: tuple[int, int]
) -> FloatArray:
    """(4, 4) matrix from the camera frame [m] to clip space of a framebuffer.

    Parameters
    ----------
    near_m, far_m : camera z of the clipping planes.
    buffer_from_pixel : (2, 3) affine map from image pixels (x, y, 1) to framebuffer coordinates, in which the
        first fragment's centre is (0.5, 0.5). Plain images use ``IMAGE_FROM_PIXEL``.
    size : width and height of the framebuffer's viewport [px].
    """
    # homogeneous pixel coordinates (x z, y z, z) of a camera point
    pixel = np.array(
        [
            [camera.fx_px, 0.0, camera.cx_px, 0.0],
            [0.0, camera.fy_px, camera.cy_px, 0.0],
            [0.0, 0.0, 1.0, 0.0],
        ]
    )
    buffer = buffer_from_pixel @ pixel
    w = np.array([0.0, 0.0, 1.0, 0.0])
    depth = np.array([0.0, 0.0, (far_m + near_m) / (far_m - near_m), -2 * far_m * near_m / (far_m - near_m)])
    return np.stack([2 * buffer[0] / size[0] - w, 2 * buffer[1] / size[1] - w, depth, w])


def image_of(camera: Camera, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Columns and rows [px] of points by x / z and y / z, arrays of one shape: numpy is quick along long rows."""
    if not camera.distortion.is_none:
        x, y = np.moveaxis(camera.domain.distort(np.stack([x, y], axis=-1)), -1, 0)
    return x * camera.fx_px + camera.cx_px, y * camera.fy_px + camera.cy_px


IMAGE_FROM_PIXEL = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.5]])


def window_from_pixel(rect: PixelRect) -> FloatArray:
    """(2, 3) map for a framebuffer that holds only ``rect`` of the image."""
    return IMAGE_FROM_PIXEL - np.array([[0.0, 0.0, rect.x0], [0.0, 0.0, rect.y0]])


@lru_cache(maxsize=16)  # frames of a camera ask for the same few grids
def _undistorted(camera: Camera, x_px: bytes, y_px: bytes) -> FloatArray:
    """(len(y), len(x), 2) undistorted rays through a grid of pixels, whose columns and rows are float64."""
    return camera.unproject(np.stack(np.meshgrid(np.frombuffer(x_px), np.frombuffer(y_px)), axis=-1))


def directions(camera: Camera, x_px: FloatArray, y_px: FloatArray, matrix: FloatArray) -> FloatArray:
    """(len(y), len(x), 3) unit vectors of the rays through a grid of pixels; NaN where the lens does not see.

    Parameters
    ----------
    x_px, y_px : columns and rows of the grid. matrix : (3, 3) what the rays' camera coordinates are multiplied by.
    """
    if camera.distortion.is_none:
        column = (x_px - camera.cx_px)[:, None] / camera.fx_px * matrix[:, 0]
        row = (y_px - camera.cy_px)[:, None] / camera.fy_px * matrix[:, 1]
        d = row[:, None] + (column + matrix[:, 2])
    else:
        d = _undistorted(camera, x_px.tobytes(), y_px.tobytes()) @ matrix[:, :2].T + matrix[:, 2]
    return np.asarray(d / np.sqrt(np.einsum("ijk,ijk->ij", d, d))[..., None])
