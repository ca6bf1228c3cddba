"""Conversion between pixels and bytes in each of the link's formats; rows have no padding."""

from __future__ import annotations

from typing import Tuple, Union

import numpy as np

from flyaround.hil.link.errors import PacketError
from flyaround.hil.link.packets.enums import PixelFormat

Image = np.ndarray  # (H, W) or (H, W, 3) uint8, or (H, W) uint16


def pixels_bytes(width_px: int, height_px: int, pixel_format: PixelFormat) -> int:
    """Return the size of a raw image.

    Returns
    -------
    int
        Size [bytes], without padding of the rows; that of `Mono12p` is rounded up.
    """
    if pixel_format is PixelFormat.Mono12p:
        return (3 * width_px * height_px + 1) // 2
    return width_px * height_px * pixel_format.channels * (2 if pixel_format.in_words else 1)


def array_shape(width_px: int, height_px: int, pixel_format: PixelFormat) -> Tuple[int, ...]:
    """Return the shape of the unpacked image."""
    return (height_px, width_px) if pixel_format.channels == 1 else (height_px, width_px, 3)


def fits(image: Image, pixel_format: PixelFormat) -> bool:
    """Return True if the image has the format's channels, and its values fit."""
    channels = 1 if image.ndim == 2 else image.shape[2] if image.ndim == 3 else 0
    if channels != pixel_format.channels or image.dtype.kind != "u" or image.dtype.itemsize > 2:
        return False
    holds = 8 * image.dtype.itemsize <= pixel_format.depth_bits
    return holds or not image.size or int(image.max()) < 1 << pixel_format.depth_bits


def pack_pixels(image: Image, pixel_format: PixelFormat) -> bytes:
    """Pack an image as raw bytes.

    Returns
    -------
    bytes
        Rows from the top, without padding; values of two bytes are little-endian.

    Raises
    ------
    PacketError
        If the image has other channels, or values too large for the format.
    """
    if not fits(image, pixel_format):
        raise PacketError(
            f"an image of shape {image.shape} and type {image.dtype} does not fit the pixel format {pixel_format.name}"
        )
    if pixel_format is PixelFormat.Mono12p:
        return _pack_twelve(image)
    dtype = np.dtype("<u2") if pixel_format.in_words else np.dtype("u1")
    return np.ascontiguousarray(image, dtype=dtype).tobytes()


def unpack_pixels(
    data: Union[bytes, bytearray, memoryview], width_px: int, height_px: int, pixel_format: PixelFormat
) -> Image:
    """Unpack an image from raw bytes of the correct size.

    Returns
    -------
    (H, W) or (H, W, 3) array
        Image, uint8 or little-endian uint16. Except for `Mono12p` it shares the memory of ``data``, and is read-only if
        ``data`` is.
    """
    if pixel_format is PixelFormat.Mono12p:
        return _unpack_twelve(data, width_px * height_px).reshape(height_px, width_px)
    dtype = np.dtype("<u2") if pixel_format.in_words else np.dtype("u1")
    return np.frombuffer(data, dtype=dtype).reshape(array_shape(width_px, height_px, pixel_format))


def _pack_twelve(image: Image) -> bytes:
    """Pack pairs of values into three bytes, lower bits first."""
    flat = image.astype(np.uint16).ravel()
    count = flat.size
    if count % 2:
        flat = np.append(flat, np.uint16(0))
    even_pixels, odd_pixels = flat[0::2], flat[1::2]
    out = np.empty((even_pixels.size, 3), np.uint8)
    out[:, 0] = even_pixels & 0xFF
    out[:, 1] = (even_pixels >> 8) | ((odd_pixels & 0xF) << 4)
    out[:, 2] = odd_pixels >> 4
    return out.tobytes()[: (3 * count + 1) // 2]


def _unpack_twelve(data: Union[bytes, bytearray, memoryview], count: int) -> Image:
    triples = np.frombuffer(data, np.uint8)
    if count % 2:
        triples = np.append(triples, np.uint8(0))
    triples = triples.reshape(-1, 3).astype(np.uint16)
    out = np.empty((triples.shape[0], 2), np.uint16)
    out[:, 0] = triples[:, 0] | ((triples[:, 1] & 0xF) << 8)
    out[:, 1] = (triples[:, 1] >> 4) | (triples[:, 2] << 4)
    return out.ravel()[:count]
