"""Label raster: depth, normal and part of the target at each pixel's centre, and the area of its whole silhouette.

Mask, depth, normals and parts come from one raster with one sample per pixel, so they agree. Hidden triangles are
culled on every driver, because the hidden one of two coplanar faces could otherwise win the depth test.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.render.craft.mesh_array import label_program
from flyaround.simulator.render.craft.viewport_fit import fit_viewport, homogeneous_matrix
from flyaround.simulator.render.gl.context import release
from flyaround.simulator.render.gl.fences import draw_to, flush
from flyaround.simulator.render.gl.lens_rays import lens_values
from flyaround.simulator.render.projection import PixelRect, clip_from_camera, window_from_pixel

if TYPE_CHECKING:
    from collections.abc import Callable

    import moderngl

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.render.craft.resident_targets import ResidentTarget, ResidentTargets
    from flyaround.simulator.render.craft.viewport_fit import ViewportFit
    from flyaround.simulator.render.device import Device
    from flyaround.simulator.runtime.arrays import BoolArray, Float32Array
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

_SILHOUETTE_SIDE_PX = 1024  # largest side of the raster of the whole silhouette: resolves 1e-3 of its area
_ROUNDING_PX = 1 / 4096  # largest rounding of a corner's position by single precision


@dataclass(frozen=True, eq=False)
class Surfaces:
    """The nearest surface at each pixel's centre.

    Parameters
    ----------
    depth_m : (H, W) array
        float32 camera z of the nearest surface, NaN outside the target.
    normals : (H, W, 3) array, optional
        float16 unit normals towards the camera, camera frame, zero outside the target; or None.
    parts : (H, W) array, optional
        uint16 index of the part, from 1; 0 outside the target; or None.
    window : tuple of slice, optional
        Rows and columns that hold the target.
    """

    depth_m: Float32Array
    normals: np.typing.NDArray[np.float16] | None = None
    parts: np.typing.NDArray[np.uint16] | None = None
    window: tuple[slice, slice] = (slice(None), slice(None))


@dataclass(frozen=True, eq=False)
class PendingSurfaces:
    """A label raster that the driver is drawing; it is read once."""

    context: moderngl.Context
    framebuffer: moderngl.Framebuffer
    resources: tuple[moderngl.Texture | moderngl.Renderbuffer, ...]
    size: tuple[int, int]
    layers: bool

    def read(self) -> Surfaces:
        """Wait for the raster, read it and free its memory."""
        shape = self.size[::-1]
        flush(self.context)
        z = self.framebuffer.read(components=1, dtype="f4", alignment=1)
        depth_m = np.frombuffer(z, np.float32).reshape(shape).copy()
        depth_m[depth_m == 0] = np.nan
        normals = parts = None
        if self.layers:
            data = self.framebuffer.read(components=4, attachment=1, dtype="f2", alignment=1)
            surface = np.frombuffer(data, np.float16).reshape(*shape, 4)
            normals, parts = surface[..., :3], surface[..., 3].astype(np.uint16)
        release(self.context, self.framebuffer, *self.resources)
        return Surfaces(depth_m, normals, parts)


class LabelRaster:
    """Draws the target with one sample per pixel."""

    def __init__(self, device: Device, targets: ResidentTargets) -> None:
        self._context, self._programs, self._lens = device.context, device.programs, device.blocks.lens
        self._targets = targets
        self._flush_framebuffer = self._context.framebuffer([self._context.texture((1, 1), 1)])

    def start_surfaces(self, scene: SceneState, target: Target, *, layers: bool) -> Callable[[], Surfaces]:
        """Start drawing the surface at each pixel's centre.

        Return a function that waits for the driver and reads the result; call it once.
        """
        resident, camera = self._targets.get(target), scene.camera
        fit = fit_viewport(
            resident.mesh,
            homogeneous_matrix(scene.camera_from_target.R, scene.t_camera_from_target_m),
            camera,
        )
        pending = None
        if fit is not None:
            pending = self._begin(resident, camera, fit, fit.rect, layers=layers)

        def whole_image() -> Surfaces:
            shape = (camera.height_px, camera.width_px)
            depth = np.full(shape, np.nan, np.float32)
            normals = np.zeros((*shape, 3), np.float16) if layers else None
            parts = np.zeros(shape, np.uint16) if layers else None
            window = (slice(0, 0), slice(0, 0))
            if fit is not None and pending is not None:
                rect, surfaces = fit.rect, pending.read()
                window = (slice(rect.y0, rect.y1), slice(rect.x0, rect.x1))
                depth[window] = surfaces.depth_m
                if normals is not None and surfaces.normals is not None:
                    for k in range(3):  # NumPy copies three at a time five times more slowly
                        normals[window][..., k] = surfaces.normals[..., k]
                if parts is not None and surfaces.parts is not None:
                    parts[window] = surfaces.parts
            return Surfaces(depth, normals, parts, window)

        return whole_image

    def silhouette_inside(self, scene: SceneState, target: Target) -> float:
        """Return the fraction of the silhouette's area inside the image; 0 if nothing is in front of the camera."""
        resident, camera = self._targets.get(target), scene.camera
        fit = fit_viewport(
            resident.mesh,
            homogeneous_matrix(scene.camera_from_target.R, scene.t_camera_from_target_m),
            camera,
            clip=False,
        )
        if fit is None:
            return 0.0
        x0, y0 = np.floor(fit.bounds_px[:2]).astype(int)
        x1, y1 = np.ceil(fit.bounds_px[2:]).astype(int) + 1
        if x0 >= 0 and y0 >= 0 and x1 <= camera.width_px and y1 <= camera.height_px:
            return 1.0
        rect = PixelRect(int(x0), int(y0), int(x1), int(y1))
        scale = min(1.0, _SILHOUETTE_SIDE_PX / max(rect.width, rect.height))
        raster = self._begin(resident, camera, fit, rect, scale=scale)
        silhouette = np.isfinite(raster.read().depth_m)
        is_in_image = _image_mask(camera, rect, silhouette.shape, scale)
        total = int(silhouette.sum())
        return float((silhouette & is_in_image).sum() / total) if total else 0.0

    def _begin(
        self,
        resident: ResidentTarget,
        camera: Camera,
        fit: ViewportFit,
        rect: PixelRect,
        *,
        layers: bool = False,
        scale: float = 1.0,
    ) -> PendingSurfaces:
        """Start drawing the surface in the pixels of ``rect``, with ``layers`` normals and parts too.

        A ``scale`` below 1 draws fewer, larger pixels.
        """
        arrays = resident.drawn(self._context, fit.longest_m).labels
        program, camera_from_target = label_program(self._programs, layers=layers), fit.camera_from_target
        size = (max(1, round(rect.width * scale)), max(1, round(rect.height * scale)))
        clip = clip_from_camera(camera, *fit.near_far_m, window_from_pixel(rect) * scale, size)
        outputs = [self._context.texture(size, 1, dtype="f4")]
        depth = self._context.depth_renderbuffer(size)
        if layers:
            outputs.append(self._context.texture(size, 4, dtype="f2"))
        framebuffer = self._context.framebuffer(outputs, depth)
        if not camera.distortion.is_none:
            self._lens.write(lens_values(camera))
        draw_to(framebuffer)
        framebuffer.clear()
        self._context.enable_only(self._context.DEPTH_TEST)
        if camera.distortion.is_none:
            clip = clip @ camera_from_target
        program.set("u_label_clip", tuple(clip.T.ravel()))
        program.set("u_label_camera_from_target", tuple(camera_from_target.T.ravel()))
        eye_m = -camera_from_target[:3, :3].T @ camera_from_target[:3, 3]
        program.set("u_label_px", size)
        # Corners are rounded to the raster's subpixels, so that a face covers no pixel outside itself. A sliver thinner
        # than single precision has an arbitrary depth, so the offset moves each face back by its slope times that.
        self._context.polygon_offset = (_ROUNDING_PX, 0.0)
        (arrays.layers if layers else arrays.depth).render(np.append(eye_m, 1.0))
        self._context.polygon_offset = (0.0, 0.0)
        # a software driver starts drawing, in its own threads, once another framebuffer is used
        draw_to(self._flush_framebuffer)
        self._flush_framebuffer.clear()
        return PendingSurfaces(self._context, framebuffer, (depth, *outputs), size, layers)

    def release(self) -> None:
        """Free the raster's own framebuffer."""
        release(self._context, self._flush_framebuffer, *self._flush_framebuffer.color_attachments)


def _image_mask(camera: Camera, rect: PixelRect, shape: tuple[int, ...], scale: float) -> BoolArray:
    """Return a mask of the pixels of a scaled window whose centres lie in the image."""
    x = (np.arange(shape[1]) + 0.5) / scale + rect.x0 - 0.5
    y = (np.arange(shape[0]) + 0.5) / scale + rect.y0 - 0.5
    return np.asarray(
        ((x >= -0.5) & (x < camera.width_px - 0.5))[None, :]
        & ((y >= -0.5) & (y < camera.height_px - 0.5))[:, None]
    )
