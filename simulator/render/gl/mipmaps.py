"""Mipmapped textures with cached levels, because a software driver takes half a second to generate them."""

from __future__ import annotations

import ctypes
import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.render.gl.library import gl_library
from flyaround.simulator.runtime.cache import entry_name
from flyaround.simulator.runtime.cached_arrays import cached_array, entry_of

if TYPE_CHECKING:
    from collections.abc import Sequence
    from concurrent.futures import Future

    import moderngl

    from flyaround.simulator.runtime.arrays import ByteArray

# constants of OpenGL
_TEXTURE_2D, _UNSIGNED_BYTE, _UNPACK_ALIGNMENT = 0x0DE1, 0x1401, 0x0CF5
_FORMATS = {1: (0x8229, 0x1903), 4: (0x8058, 0x1908)}  # R8 and RED, RGBA8 and RGBA
_OWNED = "created by glGenTextures"  # mark of textures that moderngl does not delete


@dataclass(frozen=True, eq=False)
class MipmapChain:
    """An image (H, W) or (H, W, 4) and its smaller levels in sequence, from `mipmap_chain`."""

    image: ByteArray
    smaller: ByteArray


def mipmap_chain(image: ByteArray, *, globe: bool, root_channel: int | None = None) -> MipmapChain:
    """Return the image with its levels, cached if the image came from `cached_array`. Needs no OpenGL.

    Parameters
    ----------
    image : (H, W) or (H, W, n) array
        The image, level 0.
    globe : bool
        True for an equirectangular map of a globe, row 0 at the north pole. Towards the poles, the smaller levels
        average columns, so that a texel is as wide as high on the ground: a driver chooses a level by one footprint.
    root_channel : int, optional
        Channel of square roots, whose squares are averaged.
    """
    name = entry_of(image)
    if name is None:
        return MipmapChain(image, _smaller(image, globe=globe, root_channel=root_channel))
    key = entry_name(f"{name}-levels", (_smaller,), [globe, root_channel])
    return MipmapChain(
        image, cached_array(key, lambda: _smaller(image, globe=globe, root_channel=root_channel))
    )


def texture_of_levels(context: moderngl.Context, levels: Sequence[ByteArray]) -> moderngl.Texture:
    """Return a texture of four channels with all its levels given."""
    texture = context.texture(levels[0].shape[1::-1], 4, levels[0].tobytes())
    texture.build_mipmaps()
    for k, level in enumerate(levels):
        texture.write(np.ascontiguousarray(level).tobytes(), level=k)
    texture.filter = (context.LINEAR_MIPMAP_LINEAR, context.LINEAR)
    return texture


def mipmapped_texture(context: moderngl.Context, levels: MipmapChain) -> moderngl.Texture:
    """Return a texture with all its levels.

    Free it with `release_mipmapped`: moderngl does not delete textures that it did not create.
    """
    image = levels.image
    height, width = image.shape[:2]
    components = image.size // (width * height)
    library = gl_library()
    if library is None or components not in _FORMATS:
        texture = context.texture((width, height), components, image, alignment=1)
        texture.build_mipmaps()
        offset = 0
        for level, (w, h) in enumerate(_sizes(width, height), 1):
            end = offset + w * h * components
            texture.write(levels.smaller[offset:end].tobytes(), level=level, alignment=1)
            offset = end
        return texture
    name = ctypes.c_uint()
    library.glGenTextures(1, ctypes.byref(name))
    texture = context.external_texture(name.value, (width, height), components, 0, "f1")
    texture.extra = _OWNED
    # set before the first level, because a driver that expects no further levels would have to move the texture
    texture.filter = (context.LINEAR_MIPMAP_LINEAR, context.LINEAR)
    texture.use(0)
    library.glPixelStorei(_UNPACK_ALIGNMENT, 1)
    internal_format, pixel_format = _FORMATS[components]
    offset, smaller = 0, np.ascontiguousarray(levels.smaller)
    for level, (w, h) in enumerate([(width, height), *_sizes(width, height)]):
        data = np.ascontiguousarray(image) if level == 0 else smaller[offset : offset + w * h * components]
        offset += data.size if level else 0
        library.glTexImage2D(
            _TEXTURE_2D,
            level,
            internal_format,
            w,
            h,
            0,
            pixel_format,
            _UNSIGNED_BYTE,
            ctypes.c_void_p(data.ctypes.data),
        )
    return texture


def release_mipmapped(texture: moderngl.Texture) -> None:
    """Free a texture of `mipmapped_texture`, or any other."""
    name, library = texture.glo, gl_library() if texture.extra == _OWNED else None
    texture.extra = None  # another texture may get the name
    texture.release()
    if library is not None:
        library.glDeleteTextures(1, ctypes.byref(ctypes.c_uint(name)))


def level_textures(context: moderngl.Context, levels: MipmapChain) -> list[moderngl.Texture]:
    """Return each level as its own texture, largest first. A driver samples faster if it has no level to select."""
    height, width = levels.image.shape[:2]
    components = levels.image.size // (width * height)
    textures, offset, smaller = [], 0, np.ascontiguousarray(levels.smaller)
    for level, (w, h) in enumerate([(width, height), *_sizes(width, height)]):
        data = (
            np.ascontiguousarray(levels.image)
            if level == 0
            else smaller[offset : offset + w * h * components]
        )
        offset += data.size if level else 0
        texture = context.texture((w, h), components, data, alignment=1)
        texture.filter = (context.LINEAR, context.LINEAR)
        textures.append(texture)
    return textures


class TilingTexture:
    """A tiling texture, as a mipmapped texture or as single levels; each is uploaded at first use.

    Parameters
    ----------
    context : Context
        OpenGL context.
    levels : Future
        Future of the levels.
    """

    def __init__(self, context: moderngl.Context, levels: Future[MipmapChain]) -> None:
        self._context, self._levels = context, levels
        self._mipmapped: moderngl.Texture | None = None
        self._single: list[moderngl.Texture] = []

    def mipmapped(self, smaller: int) -> moderngl.Texture:
        """Return the texture with all its levels; ``smaller`` is OpenGL's minification filter."""
        if self._mipmapped is None:
            self._mipmapped = mipmapped_texture(self._context, self._levels.result())
        self._mipmapped.filter = (smaller, self._context.LINEAR)
        return self._mipmapped

    def single(self, level: float) -> moderngl.Texture:
        """Return the nearest level as its own texture. A driver samples faster if it has no level to select."""
        if not self._single:
            self._single = level_textures(self._context, self._levels.result())
        return self._single[min(max(round(level), 0), len(self._single) - 1)]

    def release(self) -> None:
        """Free the textures."""
        if self._mipmapped is not None:
            release_mipmapped(self._mipmapped)
        for texture in self._single:
            texture.release()


def _sizes(width: int, height: int) -> list[tuple[int, int]]:
    """Return the sizes of the mipmap levels from the second on."""
    sizes = []
    while max(width, height) > 1:
        width, height = max(width // 2, 1), max(height // 2, 1)
        sizes.append((width, height))
    return sizes


def _smaller(image: ByteArray, *, globe: bool, root_channel: int | None) -> ByteArray:
    """Return the levels from the second on, concatenated."""
    levels, level = [], np.asarray(image)
    squares = None if root_channel is None else level[..., root_channel].astype(np.float32) ** 2
    for size in _sizes(image.shape[1], image.shape[0]):
        level = np.asarray(cv2.resize(level, size, interpolation=cv2.INTER_AREA), np.uint8)
        if squares is not None:
            squares = np.asarray(cv2.resize(squares, size, interpolation=cv2.INTER_AREA), np.float32)
            level[..., root_channel] = np.rint(np.sqrt(squares))
        levels.append((_equalize_texels(level) if globe else level).ravel())
    return np.concatenate(levels)


def _equalize_texels(level: ByteArray) -> ByteArray:
    """Average the texels of each row of a globe's map over a width on the ground that equals the row's height.

    The average is over an odd number of texels, and starts at 60 degrees latitude.
    """
    height, width = level.shape[:2]
    latitude = (0.5 - (np.arange(height) + 0.5) / height) * np.pi
    width_texels = np.minimum(1 / np.cos(latitude) * width / (2 * height), width)
    counts = 2 * ((width_texels - 1) / 2 + 0.5).astype(int) + 1
    counts = np.minimum(counts, width - 1 + width % 2)
    averaged = level.copy()
    starts = np.flatnonzero(np.diff(counts, prepend=0))
    for first, end in itertools.pairwise([*starts.tolist(), height]):
        count = int(counts[first])
        if count < 3:
            continue
        rows, reach = level[first:end], count // 2
        around = np.concatenate([rows[:, width - reach :], rows, rows[:, :reach]], axis=1)
        averaged[first:end] = cv2.blur(around, (count, 1))[:, reach : reach + width].reshape(rows.shape)
    return averaged
