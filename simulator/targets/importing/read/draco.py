"""KHR_draco_mesh_compression: compressed geometry decoded into plain accessors of the document."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.importing.read.bounded_process import DecoderError, run_decoder
from flyaround.simulator.targets.importing.read.gltf_accessors import COMPONENTS

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

DRACO = "KHR_draco_mesh_compression"
MAX_RESULT_BYTES = 128 << 20  # held up to four times during unpacking
COMPONENT_TYPES = {"b": 5120, "B": 5121, "h": 5122, "H": 5123, "I": 5125, "f": 5126}
ACCESSOR_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


def unpack_draco(path: Path, document: dict[str, Any], buffers: list[bytes]) -> list[bytes]:
    """Decode compressed primitives into a new buffer, and change the document to refer to it.

    Primitives that also contain the uncompressed geometry are not changed.

    Parameters
    ----------
    path : Path
        File, for messages.
    document : dict
        Parsed JSON; it is changed.
    buffers : list of bytes
        Contents of the document's buffers.

    Returns
    -------
    list of bytes
        The buffers and the new one.

    Raises
    ------
    UserError
        If a stream cannot be decoded.
    ValueError, LookupError, TypeError, AttributeError
        If the document violates glTF or the extension.
    """
    primitives = [
        p
        for mesh in document.get("meshes", [])
        for p in mesh["primitives"]
        if DRACO in p.get("extensions", {}) and not _is_plain(document, p)
    ]
    if not primitives:
        return buffers
    views = list(dict.fromkeys(int(p["extensions"][DRACO]["bufferView"]) for p in primitives))
    arrays = decode_streams(path, [_stream(document, buffers, view) for view in views])
    added_buffer = _AddedBuffer(document, len(buffers))
    for p in primitives:
        extension = p["extensions"][DRACO]
        stream = views.index(int(extension["bufferView"]))
        accessors = document["accessors"]
        for name, number in extension["attributes"].items():
            placeholder = accessors[p["attributes"][name]] if name in p["attributes"] else {}
            p["attributes"][name] = added_buffer.accessor(f"{stream}_{int(number)}", arrays, placeholder)
        p["indices"] = added_buffer.accessor(f"faces_{stream}", arrays, {})
        p["mode"] = 4
        del p["extensions"][DRACO]
    return [*buffers, added_buffer.data()]


class _AddedBuffer:
    """An added buffer, with its views and accessors."""

    def __init__(self, document: dict[str, Any], buffer: int) -> None:
        self._document, self._buffer = document, buffer
        self._blocks: list[bytes] = []
        self._length = 0
        self._accessors: dict[tuple[str, int, bool], int] = {}

    def accessor(self, key: str, arrays: dict[str, NDArray[Any]], placeholder: dict[str, Any]) -> int:
        """Return the index of a new accessor for an array; faces become one row of indices.

        Parameters
        ----------
        key : str
            Name of the array, as returned by `decode_streams`.
        arrays : dict of str to array
            Decoded arrays.
        placeholder : dict
            Placeholder accessor in the document, whose component type and ``normalized`` apply: the decoder returns
            integers as floats.
        """
        array = arrays[key].reshape(-1, 1) if key.startswith("faces") else arrays[key]
        array = np.ascontiguousarray(array.reshape(len(array), -1))
        kind = int(
            placeholder.get(
                "componentType", COMPONENT_TYPES[array.dtype.char if array.dtype.char != "L" else "I"]
            )
        )
        normalized = bool(placeholder.get("normalized"))
        if (key, kind, normalized) in self._accessors:
            return self._accessors[key, kind, normalized]
        with np.errstate(invalid="ignore"):
            array = array.astype(COMPONENTS[kind])
        data = array.tobytes()
        self._document["bufferViews"].append(
            {"buffer": self._buffer, "byteOffset": self._length, "byteLength": len(data)}
        )
        self._document["accessors"].append(
            {
                "bufferView": len(self._document["bufferViews"]) - 1,
                "componentType": kind,
                "normalized": normalized,
                "count": len(array),
                "type": ACCESSOR_TYPES[array.shape[1]],
            }
        )
        self._blocks.append(data)
        self._length += len(data)
        self._accessors[key, kind, normalized] = len(self._document["accessors"]) - 1
        return self._accessors[key, kind, normalized]

    def data(self) -> bytes:
        """Return all arrays, concatenated."""
        return b"".join(self._blocks)


def _is_plain(document: dict[str, Any], primitive: dict[str, Any]) -> bool:
    """Return True if the uncompressed geometry is also present."""
    numbers = [
        primitive["attributes"]["POSITION"],
        *([primitive["indices"]] if "indices" in primitive else []),
    ]
    return all("bufferView" in document["accessors"][k] for k in numbers)


def _stream(document: dict[str, Any], buffers: list[bytes], number: int) -> bytes:
    view = document["bufferViews"][number]
    start = int(view.get("byteOffset", 0))
    data = buffers[view["buffer"]][start : start + int(view["byteLength"])]
    if start < 0 or len(data) != view["byteLength"]:
        raise ValueError("a packed mesh runs past the end of its buffer")
    return data


def decode_streams(
    path: Path, streams: list[bytes], max_bytes: int = MAX_RESULT_BYTES
) -> dict[str, NDArray[Any]]:
    """Return arrays by stream and attribute, named as in `draco_process`.

    Parameters
    ----------
    path : Path
        Path of the file, for messages.
    streams : list of bytes
        Draco streams.
    max_bytes : int, optional
        Limit on the total size, because a stream of a few bytes may request any size.

    Raises
    ------
    UserError
        If a stream cannot be decoded, or the total exceeds ``max_bytes``.
    """
    request = b"".join(len(s).to_bytes(8, "little") + s for s in streams)
    try:
        arrays = run_decoder("draco_process", [str(max_bytes)], request)
    except DecoderError as error:
        raise UserError(
            f"{path} is packed with Draco and cannot be unpacked: {error}; export it without mesh compression"
        ) from error
    with np.load(io.BytesIO(arrays), allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}
