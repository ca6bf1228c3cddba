"""The frame's images (radiance, and the target's coverage), and the passes that clear them and read them back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.render.frame_graph import Pass, Resource
from flyaround.simulator.render.gl.context import release
from flyaround.simulator.render.gl.fences import draw_to, flush
from flyaround.simulator.render.projection import PixelRect
from flyaround.simulator.render.view import SCENE
from flyaround.simulator.runtime.threads import run_in_threads, split_rows

if TYPE_CHECKING:
    from collections.abc import Callable

    import moderngl

    from flyaround.simulator.render.frame_graph import PassResources
    from flyaround.simulator.runtime.arrays import Float32Array, IntArray
    from flyaround.simulator.scene.state import SceneState

_MIN_THREADED_VALUES = 3 << 19  # size of an image from which on two threads unpack quads faster than one


class FrameImages:
    """Radiance per band and the target's coverage, in 32-bit floats: 16-bit ones overflow in the Sun's disc (2e7).

    The target is drawn first, into both images. The sky's passes then add their light times one minus the coverage, and
    skip pixels that the target hides.

    Parameters
    ----------
    context : Context
        OpenGL context.
    width : int
        Width [px].
    height : int
        Height [px].
    bands : int
        1 or 3. Three bands are stored as four channels, which every driver can draw to.
    """

    def __init__(self, context: moderngl.Context, width: int, height: int, bands: int) -> None:
        self._context = context
        self.size, self.bands = (width, height), bands
        self.radiance = context.texture(self.size, 1 if bands == 1 else 4, dtype="f4")
        self.coverage = context.texture(self.size, 1, dtype="f4")
        for texture in (self.radiance, self.coverage):
            texture.filter = (context.NEAREST, context.NEAREST)
        self.target_framebuffer = context.framebuffer([self.radiance, self.coverage])
        self.sky_framebuffer = context.framebuffer([self.radiance])
        self._label_framebuffer = context.framebuffer([self.coverage])
        self._covered_rect: PixelRect | None = PixelRect(0, 0, width, height)
        self._drawn_rect: PixelRect | None = PixelRect(0, 0, width, height)  # may not be black
        self._quads: tuple[list[moderngl.Texture], moderngl.Framebuffer] | None = None

    @property
    def can_pack_quads(self) -> bool:
        """True if the image has even sides, so that 2 x 2 pixels can be packed in a texel."""
        return not any(side % 2 for side in self.size)

    @property
    def quad_framebuffer(self) -> moderngl.Framebuffer:
        """Framebuffer of the radiance with 2 x 2 pixels in a texel (in three texels for three bands).

        A pass may compute four pixels at once.
        """
        if self._quads is None:
            size = (self.size[0] // 2, self.size[1] // 2)
            textures = [self._context.texture(size, 4, dtype="f4") for _ in range(self.bands)]
            self._quads = textures, self._context.framebuffer(textures)
        return self._quads[1]

    def clear(self, rect: PixelRect | None) -> None:
        """Clear the pixels that were drawn since the last call.

        Parameters
        ----------
        rect : PixelRect or None
            Pixels to clear; passes overwrite all others. ``None`` clears no radiance.
        """
        dirty = None if self._drawn_rect is None or rect is None else self._drawn_rect.intersection(rect)
        if dirty is not None:
            # a driver clears a whole one-band image faster than part of it
            part = None if dirty == PixelRect(0, 0, *self.size) else dirty.viewport
            draw_to(self.sky_framebuffer)
            self.sky_framebuffer.clear(0.0, 0.0, 0.0, 0.0, viewport=part)
            self._drawn_rect = None if dirty == self._drawn_rect else self._drawn_rect
        if self._covered_rect is not None:
            draw_to(self._label_framebuffer)
            self._label_framebuffer.clear(0.0, 0.0, 0.0, 0.0, viewport=self._covered_rect.viewport)
        self._covered_rect = None

    def mark_drawn(self, rect: PixelRect) -> None:
        """Record the pixels of the radiance that a pass is about to write or add to."""
        rect = PixelRect(0, 0, *self.size).intersection(rect) or PixelRect(0, 0, 0, 0)
        self._drawn_rect = rect if self._drawn_rect is None else self._drawn_rect.union(rect)

    def mark_covered(self, rect: PixelRect) -> None:
        """Record the pixels that the target is about to write."""
        self._covered_rect = rect
        self.mark_drawn(rect)

    def read_radiance(self, *, quads: bool = False) -> Float32Array:
        """Read (H, W) or (H, W, 3) radiance, row 0 at the top.

        Parameters
        ----------
        quads : bool, optional
            True if it was drawn with four pixels per texel.

        Returns
        -------
        (H, W) or (H, W, 3) array
            Radiance [W m-2 sr-1].
        """
        width, height = self.size
        flush(self._context)
        if quads:
            return self._read_quads()
        image = np.empty((height, width) if self.bands == 1 else (height, width, 3), np.float32)
        self.sky_framebuffer.read_into(image, components=self.bands, dtype="f4", alignment=1)
        return image

    def _read_quads(self) -> Float32Array:
        width, height = self.size
        image = np.empty((height, width * self.bands), np.float32)
        # two neighbours in a row are moved as one 64-bit number
        pairs = [
            np.frombuffer(
                self.quad_framebuffer.read(components=4, attachment=k, dtype="f4", alignment=1), np.float64
            ).reshape(height // 2, width // 2, 2)
            for k in range(self.bands)
        ]
        rows = [image[k::2].view(np.float64).reshape(height // 2, width // 2, self.bands) for k in (0, 1)]
        # order of shaders/common/quads.glsl: the upper row's pairs, then the lower one's
        order = np.repeat(np.arange(2 * self.bands), 2).tolist()

        def unpack(first: int, end: int) -> None:
            cv2.mixChannels([p[first:end] for p in pairs], [r[first:end] for r in rows], order)

        run_in_threads(split_rows(height // 2, 2 if image.size >= _MIN_THREADED_VALUES else 1), unpack)
        return image if self.bands == 1 else image.reshape(height, width, 3)

    def read_part(self, rect: PixelRect) -> tuple[Float32Array, Float32Array, tuple[slice, slice]]:
        """Read radiance and coverage of some pixels.

        Returns
        -------
        radiance : (h, w) or (h, w, 3) array
            Radiance of the rectangle [W m-2 sr-1], float32, row 0 at the top.
        coverage : (h, w) array
            Share of each pixel that the target covers, 0 to 1, float32.
        window : tuple of slice
            Rows and columns of the rectangle in the image.
        """
        window = slice(rect.y0, rect.y1), slice(rect.x0, rect.x1)
        size = rect.y1 - rect.y0, rect.x1 - rect.x0
        bands = () if self.bands == 1 else (self.bands,)
        if 0 in size:
            return np.zeros((*size, *bands), np.float32), np.zeros(size, np.float32), window
        flush(self._context)
        data = self.sky_framebuffer.read(rect.viewport, self.bands, dtype="f4", alignment=1)
        cover = self._label_framebuffer.read(rect.viewport, 1, dtype="f4", alignment=1)
        radiance = np.frombuffer(data, np.float32).reshape(*size, *bands)
        return radiance, np.frombuffer(cover, np.float32).reshape(size), window

    def read_coverage(self) -> Float32Array:
        """Read the coverage of all pixels.

        Returns
        -------
        (H, W) array
            Share of each pixel that the target covers, 0 to 1, float32, row 0 at the top.
        """
        flush(self._context)
        data = self._label_framebuffer.read(components=1, dtype="f4", alignment=1)
        return np.frombuffer(data, np.float32).reshape(self.size[1], self.size[0])

    def release(self) -> None:
        """Free the images."""
        release(
            self._context,
            self.target_framebuffer,
            self.sky_framebuffer,
            self._label_framebuffer,
            self.radiance,
            self.coverage,
        )
        if self._quads is not None:
            release(self._context, self._quads[1], *self._quads[0])
            self._quads = None


@dataclass(frozen=True, eq=False)
class PointLights:
    """Light of point sources, distributed over the nearest pixels.

    Parameters
    ----------
    pixels : (M,) array
        Indices of the pixels, row by row; may repeat.
    light : (M, n) array
        Radiance to add, per band [W m-2 sr-1].
    """

    pixels: IntArray
    light: Float32Array

    def add_to(self, radiance: Float32Array) -> None:
        """Add the light to an image (H, W) or (H, W, n)."""
        bands = self.light.shape[1]
        values = radiance.reshape(-1)  # flat, because NumPy adds rows of several values ten times as slowly
        for band in range(bands):
            np.add.at(values, self.pixels * bands + band, self.light[:, band])


RADIANCE: Resource[FrameImages] = Resource("radiance")
COVERAGE: Resource[FrameImages] = Resource("coverage")
IMAGES = (RADIANCE, COVERAGE)
"""Radiance and coverage. The target is drawn into both; the sky's light, times 1 - coverage, is added to radiance."""
STARLIGHT: Resource[PointLights] = Resource("starlight")
"""Light of point sources, added after the image is read back."""
PICTURE: Resource[Float32Array] = Resource("picture")


class ClearPass(Pass):
    """Clears the frame's images.

    Parameters
    ----------
    images_for : callable
        Function that returns the images of a scene's size and bands.
    name : str, optional
        Name of the pass, unique in its graph.
    """

    reads = (SCENE,)
    writes = IMAGES

    def __init__(self, images_for: Callable[[SceneState], FrameImages], name: str = "clear") -> None:
        self._images_for, self.name = images_for, name

    def run(self, r: PassResources) -> None:
        """Clear the pixels that the last frame drew."""
        r[RADIANCE] = r[COVERAGE] = images = self._images_for(r[SCENE])
        images.clear(PixelRect(0, 0, *images.size))


class ReadBackPass(Pass):
    """Waits for the driver and reads the image."""

    name = "readback"
    reads = (RADIANCE,)
    optional: tuple[Resource[object], ...] = (STARLIGHT,)
    writes = (PICTURE,)

    def run(self, r: PassResources) -> None:
        """Read the radiance and add the light of point sources."""
        r[PICTURE] = radiance = self._read(r)
        starlight = r.find(STARLIGHT)
        if starlight is not None:
            starlight.add_to(radiance)

    def _read(self, r: PassResources) -> Float32Array:
        return r[RADIANCE].read_radiance()
