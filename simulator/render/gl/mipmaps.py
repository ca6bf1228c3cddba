"""Mipmapped textures with levels from the cache, because a software driver takes half a second to generate them."""

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

_TEXTURE_2D, _UNSIGNED_BYTE, _UNPACK_ALIGNMENT = 0x0DE1, 0x1401, 0x0CF5
_FORMATS = {1: (0x8229, 0x1903), 4: (0x8058, 0x1908)}  # R8 and RED, RGBA8 and RGBA
_OWN_NAME = "name made here"


@dataclass(frozen=True, eq=False)
class MipmapChain:
    """An image (H, W) or (H, W, 4) and its smaller levels in sequence, from `mipmap_chain`."""

    image: ByteArray
    smaller: ByteArray


def mipmap_chain(image: ByteArray, *, globe: bool) -> MipmapChain:
    """Return the image with its levels, cached if the image came from `cached_array`. Needs no OpenGL.

    Parameters
    ----------
    globe : bool
        True for a map of a whole globe, row 0 at the north pole. Towards the poles, texels of its smaller levels
        average columns, so that they are as wide as high on the ground: a driver chooses a level by one size.
    """
    name = entry_of(image)
    if name is None:
        return MipmapChain(image, _smaller(image, globe=globe))
    key = entry_name(f"{name}-levels", (_smaller,), globe)
    return MipmapChain(image, cached_array(key, lambda: _smaller(image, globe=globe)))


def texture_of_levels(context: moderngl.Context, levels: Sequence[ByteArray]) -> moderngl.Texture:
    """Return a texture of four channels with all its levels given."""
    texture = context.texture(levels[0].shape[1::-1], 4, levels[0].tobytes())
    texture.build_mipmaps()
    for k, level in enumerate(levels):
        texture.write(np.ascontiguousarray(level).tobytes(), level=k)
    texture.filter = (context.LINEAR_MIPMAP_LINEAR, context.LINEAR)
    return texture


def mipmapped_texture(context: moderngl.Context, levels: MipmapChain) -> moderngl.Texture:
    """Return a texture with all its levels; without direct calls of OpenGL the driver generates them.

    Free it with `release_mipmapped`: moderngl does not delete textures that it did not create.
    """
    image = levels.image
    height, width = image.shape[:2]
    components = image.size // (width * height)
    library = gl_library()
    if library is None or components not in _FORMATS:
        texture = context.texture((width, height), components, image, alignment=1)
        texture.build_mipmaps()
        return texture
    name = ctypes.c_uint()
    library.glGenTextures(1, ctypes.byref(name))
    texture = context.external_texture(name.value, (width, height), components, 0, "f1")
    texture.extra = _OWN_NAME
    # before the first level: a driver that expects no more levels would move everything when they come
    texture.filter = (context.LINEAR_MIPMAP_LINEAR, context.LINEAR)
    texture.use(0)
    library.glPixelStorei(_UNPACK_ALIGNMENT, 1)
    inner, outer = _FORMATS[components]
    at, flat = 0, np.ascontiguousarray(levels.smaller)
    for level, (w, h) in enumerate([(width, height), *_sizes(width, height)]):
        data = np.ascontiguousarray(image) if level == 0 else flat[at : at + w * h * components]
        at += data.size if level else 0
        library.glTexImage2D(
            _TEXTURE_2D, level, inner, w, h, 0, outer, _UNSIGNED_BYTE, ctypes.c_void_p(data.ctypes.data)
        )
    return texture


def release_mipmapped(texture: moderngl.Texture) -> None:
    """Free a texture of `mipmapped_texture`, or any other."""
    name, library = texture.glo, gl_library() if texture.extra == _OWN_NAME else None
    texture.extra = None  # another texture may get the name
    texture.release()
    if library is not None:
        library.glDeleteTextures(1, ctypes.byref(ctypes.c_uint(name)))


def level_textures(context: moderngl.Context, levels: MipmapChain) -> list[moderngl.Texture]:
    """Return each level as its own texture, largest first: a driver is faster if it has no level to select."""
    height, width = levels.image.shape[:2]
    components = levels.image.size // (width * height)
    textures, at, flat = [], 0, np.ascontiguousarray(levels.smaller)
    for level, (w, h) in enumerate([(width, height), *_sizes(width, height)]):
        data = np.ascontiguousarray(levels.image) if level == 0 else flat[at : at + w * h * components]
        at += data.size if level else 0
        texture = context.texture((w, h), components, data, alignment=1)
        texture.filter = (context.LINEAR, context.LINEAR)
        textures.append(texture)
    return textures


class TilingTexture:
    """A tiling texture, with all its levels or with one of them; uploaded at first use.

    Parameters
    ----------
    levels : Future
        Future of the levels.
    """

    def __init__(self, context: moderngl.Context, levels: Future[MipmapChain]) -> None:
        self._context, self._levels = context, levels
        self._whole: moderngl.Texture | None = None
        self._single: list[moderngl.Texture] = []

    def mipmapped(self, smaller: int) -> moderngl.Texture:
        """Return the texture with all its levels; ``smaller`` is OpenGL's minification filter."""
        if self._whole is None:
            self._whole = mipmapped_texture(self._context, self._levels.result())
        self._whole.filter = (smaller, self._context.LINEAR)
        return self._whole

    def single(self, level: float) -> moderngl.Texture:
        """Return the nearest level as its own texture: a driver is faster if it has no level to select."""
        if not self._single:
            self._single = level_textures(self._context, self._levels.result())
        return self._single[min(max(round(level), 0), len(self._single) - 1)]

    def release(self) -> None:
        """Free the textures."""
        if self._whole is not None:
            release_mipmapped(self._whole)
        for texture in self._single:
            texture.release()


def _sizes(width: int, height: int) -> list[tuple[int, int]]:
    """Return the sizes of the mipmap levels from the second on."""
    sizes = []
    while max(width, height) > 1:
        width, height = max(width // 2, 1), max(height // 2, 1)
        sizes.append((width, height))
    return sizes


def _smaller(image: ByteArray, *, globe: bool) -> ByteArray:
    """Return the levels from the second on, concatenated."""
    levels, last = [], np.asarray(image)
    for size in _sizes(image.shape[1], image.shape[0]):
        last = np.asarray(cv2.resize(last, size, interpolation=cv2.INTER_AREA), np.uint8)
        levels.append((_as_wide_as_high(last) if globe else last).ravel())
    return np.concatenate(levels)


def _as_wide_as_high(level: ByteArray) -> ByteArray:
    """Average texels of each row of a globe's map until they are as wide on the ground as a row is high.

    By odd numbers of texels, from latitude 60 degrees on.
    """
    height, width = level.shape[:2]
    latitude = (0.5 - (np.arange(height) + 0.5) / height) * np.pi
    wide = np.minimum(1 / np.cos(latitude) * width / (2 * height), width)
    counts = 2 * ((wide - 1) / 2 + 0.5).astype(int) + 1
    counts = np.minimum(counts, width - 1 + width % 2)
    out = level.copy()
    starts = np.flatnonzero(np.diff(counts, prepend=0))
    for first, end in itertools.pairwise([*starts.tolist(), height]):
        count = int(counts[first])
        if count < 3:
            continue
        rows, reach = level[first:end], count // 2
        around = np.concatenate([rows[:, width - reach :], rows, rows[:, :reach]], axis=1)
        out[first:end] = cv2.blur(around, (count, 1))[:, reach : reach + width].reshape(rows.shape)
    return out
