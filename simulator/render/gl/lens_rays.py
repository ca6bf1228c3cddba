"""Inverse lens distortion as a texture: the undistorted ray and the angular size of each pixel."""

from __future__ import annotations

from collections import OrderedDict
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import moderngl
    from numpy.typing import ArrayLike

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.runtime.arrays import Float32Array

MAX_TEXTURES = 64
"""Largest number of cached textures: a rolling shutter draws at most 64 bands of rows, each with its own camera."""
_STEP_PX = 8.0  # distance between the spline's nodes


def ray_table(camera: Camera) -> Float32Array:
    """Return (H + 2, W + 2, 3): x / z, y / z and angular size [rad] of each pixel, with a border of one pixel.

    Rays are computed at every eighth pixel and interpolated by a quintic spline. For the built-in cameras, the result
    is within 1e-4 px, the rounding of float32.
    """
    from scipy.interpolate import RectBivariateSpline  # noqa: PLC0415 - slow to import, and most lenses are not distorted

    def nodes(length: int) -> np.ndarray:
        return np.linspace(-1.5, length + 0.5, max(int(np.ceil((length + 2) / _STEP_PX)), 6) + 1)

    x, y = nodes(camera.width_px), nodes(camera.height_px)
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    xy = camera.unproject(grid)
    # NaN outside the lens's domain: no pixel of the image samples it there
    layers = [
        np.nan_to_num(values)
        for values in (*np.moveaxis(xy, -1, 0), np.sqrt(camera.pixel_solid_angle_sr(grid)))
    ]
    columns, rows = np.arange(-1, camera.width_px + 1.0), np.arange(-1, camera.height_px + 1.0)
    return np.stack(
        [RectBivariateSpline(y, x, layer, kx=5, ky=5)(rows, columns) for layer in layers], axis=-1
    ).astype(np.float32)


class RayTextures:
    """Cache of the ray textures of the most recently used cameras."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._textures: OrderedDict[Camera, moderngl.Texture] = OrderedDict()

    def get(self, camera: Camera) -> moderngl.Texture:
        """Return the ray texture of a camera."""
        if camera in self._textures:
            self._textures.move_to_end(camera)
            return self._textures[camera]
        table = ray_table(camera)
        texture = self._context.texture(
            (table.shape[1], table.shape[0]), 3, table.tobytes(), dtype="f4", alignment=1
        )
        texture.filter = (self._context.LINEAR, self._context.LINEAR)
        texture.repeat_x = texture.repeat_y = False
        self._textures[camera] = texture
        if len(self._textures) > MAX_TEXTURES:
            self._textures.popitem(last=False)[1].release()
        return texture

    def release(self) -> None:
        """Free the textures."""
        for texture in self._textures.values():
            texture.release()
        self._textures.clear()


def lens_values(camera: Camera) -> dict[str, ArrayLike]:
    """Return the members of the uniform block ``Lens``."""
    coefficients = np.zeros(8)
    distortion = camera.distortion
    is_brown = distortion.model == "brown_conrady"
    coefficients[: len(distortion.coefficients)] = distortion.coefficients
    # OpenCV's order is k1 k2 p1 p2 k3 k4 k5 k6, and k1 k2 k3 k4 for a fisheye
    order = [0, 1, 4, 5, 6, 7, 2, 3] if is_brown else [0, 1, 2, 3, 4, 5, 6, 7]
    k1_to_k4, k5_k6_p1_p2 = np.split(coefficients[order], 2)
    return {
        "u_lens_k": k1_to_k4,
        "u_lens_m": k5_k6_p1_p2,
        "u_lens_limits": [min(camera.domain.limit, 1e6), 1.0 if is_brown else 2.0, 0.0, 0.0],
    }
