"""OpenEXR files: metres, pixels or radiance as 32-bit floats, normals as 16-bit ones."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import OpenEXR

from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray


MAX_SIDE_PX = 16_384  # largest side of an image, that of an OpenGL texture

# Maximum number of channels of an image.
MAX_CHANNELS = 4
MAX_BYTES = 2**32  # largest file: 4 bytes for each of the largest image's numbers


def encode_exr(names: tuple[str, ...], values: NDArray[Any]) -> bytes:
    """Return OpenEXR bytes of (H, W) or (H, W, C) floats, a channel per name; float16 stays half, NaN stays NaN."""
    planes = values[..., None] if values.ndim == 2 else values
    return encode_channels({name: planes[..., k] for k, name in enumerate(names)})


def encode_channels(planes: Mapping[str, NDArray[Any]]) -> bytes:
    """Return OpenEXR bytes of float channels (H, W), by name."""
    channels = {name: np.ascontiguousarray(plane) for name, plane in planes.items()}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "layer.exr"
        OpenEXR.File(header, channels).write(str(path))
        return path.read_bytes()


def decode_exr(data: bytes, names: tuple[str, ...], source: str) -> NDArray[Any]:
    """Decode an OpenEXR file's channels from its bytes, as `read_exr` does; ``source`` names it in messages.

    Raises
    ------
    UserError
        If the file is damaged, too large, or lacks a channel.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / Path(source).name
        path.write_bytes(data)
        return read_exr(path, names)


def read_exr(path: Path, names: tuple[str, ...]) -> NDArray[Any]:
    """Read (H, W) or (H, W, C) values of an OpenEXR file's channels.

    Raises
    ------
    UserError
        If the file is missing, damaged, larger than any camera's image, or lacks a channel.
    """
    if not path.is_file():
        raise UserError(f"cannot read {path}; it is missing")
    try:
        if path.stat().st_size > MAX_BYTES:
            raise UserError(f"{path} has more than {MAX_BYTES:,} bytes; draw it again")
        n = 0
        for part in OpenEXR.File(str(path), separate_channels=True, header_only=True).parts:
            low, high = (np.asarray(corner, np.int64) for corner in part.header["dataWindow"])
            width, height = (high - low + 1).tolist()
            n += len(part.header["channels"])
            if max(width, height) > MAX_SIDE_PX or n > MAX_CHANNELS:
                raise UserError(
                    f"{path} has {width:,} x {height:,} pixels of {n} channels, and at most {MAX_SIDE_PX:,} x "
                    f"{MAX_SIDE_PX:,} of {MAX_CHANNELS} are read; draw it again"
                )
        channels = OpenEXR.File(str(path), separate_channels=True).channels()
        planes = [np.asarray(channels[name].pixels) for name in names]
    except (RuntimeError, KeyError, ValueError, TypeError) as error:
        raise UserError(
            f"cannot read {path}; it is not an OpenEXR file of channels {', '.join(names)}"
        ) from error
    return planes[0] if len(planes) == 1 else np.stack(planes, axis=-1)
