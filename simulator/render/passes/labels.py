"""Label pass: the target's depth at pixel centres, and how much of its silhouette is in the image."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from simulator.render.context import release
from simulator.render.projection import PixelRect, clip_from_camera, window_from_pixel

if TYPE_CHECKING:
    import moderngl

    from simulator.arrays import Float32Array, FloatArray
    from simulator.camera.model import Camera
    from simulator.render.programs import ProgramLibrary

_SILHOUETTE_SIDE_PX = 512  # of the picture that measures the whole silhouette: 1e-3 of its area is resolved


class LabelPass:
    """Draws the target's camera z, one sample per pixel. Reads the mesh; owns what it writes."""

    def __init__(self, context: moderngl.Context, programs: ProgramLibrary) -> None:
        self._context = context
        self.program = programs.get("target/depth.vert", "target/depth.frag", {})

    def depth_m(
        self,
        vertex_array: moderngl.VertexArray,
        camera: Camera,
        rect: PixelRect,
        size: tuple[int, int],
        camera_from_target: FloatArray,
        near_far_m: tuple[float, float],
        scale: float = 1.0,
    ) -> Float32Array:
        """(h, w) camera z over ``rect``, NaN where the target is not; ``scale`` < 1 draws fewer, larger pixels."""
        buffer_from_pixel = window_from_pixel(rect)
        buffer_from_pixel = buffer_from_pixel * scale
        clip = clip_from_camera(camera, *near_far_m, buffer_from_pixel, size) @ camera_from_target
        image = self._context.texture(size, 1, dtype="f4")
        depth = self._context.depth_renderbuffer(size)
        framebuffer = self._context.framebuffer([image], depth)
        framebuffer.use()
        framebuffer.clear(float("nan"), 0.0, 0.0, 0.0)
        self._context.enable_only(self._context.DEPTH_TEST)
        self.program.set("u_clip_from_target", tuple(clip.T.ravel()))
        self.program.set("u_camera_z", tuple(camera_from_target[2]))
        vertex_array.render()
        data = np.frombuffer(framebuffer.read(components=1, dtype="f4", alignment=1), np.float32)
        release(self._context, framebuffer, image, depth)
        return data.reshape(size[1], size[0])

    def silhouette_inside(
        self,
        vertex_array: moderngl.VertexArray,
        camera: Camera,
        bounds_px: FloatArray,
        camera_from_target: FloatArray,
        near_far_m: tuple[float, float],
    ) -> float:
        """Share of the silhouette's area that lies on the image.

        Parameters
        ----------
        bounds_px : x0, y0, x1, y1 of the whole projected target, not clipped.
        """
        x0, y0 = np.floor(bounds_px[:2]).astype(int)
        x1, y1 = np.ceil(bounds_px[2:]).astype(int) + 1
        if x0 >= 0 and y0 >= 0 and x1 <= camera.width_px and y1 <= camera.height_px:
            return 1.0
        rect = PixelRect(int(x0), int(y0), int(x1), int(y1))
        scale = min(1.0, _SILHOUETTE_SIDE_PX / max(rect.width, rect.height))
        size = (max(1, round(rect.width * scale)), max(1, round(rect.height * scale)))
        seen = np.isfinite(
            self.depth_m(vertex_array, camera, rect, size, camera_from_target, near_far_m, scale)
        )
        x = (np.arange(size[0]) + 0.5) / scale + rect.x0 - 0.5
        y = (np.arange(size[1]) + 0.5) / scale + rect.y0 - 0.5
        on_image = ((x >= -0.5) & (x < camera.width_px - 0.5))[None, :] & (
            (y >= -0.5) & (y < camera.height_px - 0.5)
        )[:, None]
        total = int(seen.sum())
        return float((seen & on_image).sum() / total) if total else 0.0
