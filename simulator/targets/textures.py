"""Textures of a target: formats, size limits, images embedded in glTF buffers, and references to them."""

from __future__ import annotations

import io
import warnings
from typing import Any

from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.model import TextureImage

MIME = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg"}
MAX_SIDE_PX, MAX_PIXELS = 16_384, 8192 * 8192
"""Largest side and area of an image, 200 MB once decoded. The size of the file is no bound, because images compress."""
_DECODED = ("PNG", "JPEG", "BMP", "DIB", "GIF", "TIFF", "WEBP", "JPEG2000", "PPM")


def mime_type(data: bytes) -> str:
    """Return the MIME type of an image by its signature; empty if glTF 2.0 does not support it."""
    return next((mime for magic, mime in MIME.items() if data.startswith(magic)), "")


def picture_size(data: bytes) -> tuple[int, int] | None:
    """Read the size of an image from its header, without decoding.

    Returns
    -------
    tuple of int or None
        Width and height [px]; None if the format is not supported or the header damaged. An image that Pillow
        refuses as too large has one more than `MAX_SIDE_PX` in both directions.
    """
    from PIL import Image  # noqa: PLC0415 - few targets have textures

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(io.BytesIO(data), formats=_DECODED) as image:
                return image.size
    except Image.DecompressionBombError:
        return (MAX_SIDE_PX + 1, MAX_SIDE_PX + 1)
    except Exception:  # noqa: BLE001 - Pillow raises many types on a damaged header
        return None


def check_picture(data: bytes, source: str) -> None:
    """Check the size of an image before it is decoded.

    Raises
    ------
    UserError
        If it is not a supported image, or has too many pixels.
    """
    size = picture_size(data)
    if size is None or min(size) < 1:
        raise UserError(f"{source} is not a picture that can be read; convert it to PNG")
    if max(size) > MAX_SIDE_PX or size[0] * size[1] > MAX_PIXELS:
        raise UserError(
            f"{source} has {size[0]:,} x {size[1]:,} pixels; make it smaller, at most 8192 x 8192"
        )


def embedded_pictures(document: dict[str, Any], blob: bytes) -> tuple[TextureImage, ...]:
    """Return the images embedded in a glTF document and its binary buffer.

    Raises
    ------
    ValueError
        If an image extends past the end of its buffer.
    """
    pictures = []
    for k, image in enumerate(document.get("images") or []):
        view = document["bufferViews"][image["bufferView"]]
        start = view.get("byteOffset", 0)
        data = blob[start : start + view["byteLength"]]
        if len(data) < view["byteLength"]:
            raise ValueError("a picture runs past the end of its buffer")
        pictures.append(TextureImage(name=str(image.get("name") or f"picture-{k + 1}"), data=data))
    return tuple(pictures)


def texture_name(
    document: dict[str, Any], info: dict[str, Any] | None, pictures: tuple[TextureImage, ...]
) -> str:
    """Return the name of the image of a texture reference; empty if there is none."""
    if info is None:
        return ""
    return pictures[document["textures"][info["index"]]["source"]].name
