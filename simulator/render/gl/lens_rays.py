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

KEPT = 64
"""Number of cached textures: a rolling shutter renders the image in at most 64 bands of rows, each with a camera."""
_STEP_PX = 8.0


def ray_table(camera: Camera) -> Float32Array:
    """Return (H + 2, W + 2, 3): x / z, y / z and angular size [rad] of each pixel, with a border of one pixel.

    Rays are exact at every eighth pixel and interpolated by a quintic spline, to within 1e-6 px for supported lenses.
    """
    from scipy.interpolate import RectBivariateSpline  # noqa: PLC0415 - slow to import, and most lenses are not distorted

    def nodes(length: int) -> np.ndarray:
        return np.linspace(-1.5, length + 0.5, max(int(np.ceil((length + 2) / _STEP_PX)), 6) + 1)

    x, y = nodes(camera.width_px), nodes(camera.height_px)
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    xy = camera.unproject(grid)
    # outside the lens's domain, in a window beyond the image, values are never sampled
    layers = [np.nan_to_num(v) for v in (*np.moveaxis(xy, -1, 0), np.sqrt(camera.pixel_solid_angle_sr(grid)))]
    at_x, at_y = np.arange(-1, camera.width_px + 1.0), np.arange(-1, camera.height_px + 1.0)
    return np.stack(
        [RectBivariateSpline(y, x, layer, kx=5, ky=5)(at_y, at_x) for layer in layers], axis=-1
    ).astype(np.float32)


class RayTextures:
    """Cache of the ray textures of the most recently used cameras."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._kept: OrderedDict[Camera, moderngl.Texture] = OrderedDict()

    def of(self, camera: Camera) -> moderngl.Texture:
        """Return the texture of a camera."""
        if camera in self._kept:
            self._kept.move_to_end(camera)
            return self._kept[camera]
        table = ray_table(camera)
        texture = self._context.texture(
            (table.shape[1], table.shape[0]), 3, table.tobytes(), dtype="f4", alignment=1
        )
        texture.filter = (self._context.LINEAR, self._context.LINEAR)
        texture.repeat_x = texture.repeat_y = False
        self._kept[camera] = texture
        if len(self._kept) > KEPT:
            self._kept.popitem(last=False)[1].release()
        return texture

    def release(self) -> None:
        """Free the textures."""
        for texture in self._kept.values():
            texture.release()
        self._kept.clear()


def lens_values(camera: Camera) -> dict[str, ArrayLike]:
    """Return the members of the uniform block ``Lens``."""
    c = np.zeros(8)
    distortion = camera.distortion
    brown = distortion.model == "brown_conrady"
    c[: len(distortion.coefficients)] = distortion.coefficients
    k, m = ([c[0], c[1], c[4], c[5]], [c[6], c[7], c[2], c[3]]) if brown else (c[:4], c[4:])
    return {
        "u_lens_k": k,
        "u_lens_m": m,
        "u_lens_limits": [min(camera.domain.limit, 1e6), 1.0 if brown else 2.0, 0.0, 0.0],
    }
