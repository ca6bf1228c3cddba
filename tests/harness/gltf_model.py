"""glTF files put together by hand: a mesh to be changed before it is written, and GLBs taken apart and joined."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np


class Gltf:
    """A mesh as glTF whose buffer is embedded."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        self.blob = b""
        self.document: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0, "name": "hull"}],
            "meshes": [{"primitives": [{"attributes": {}}]}],
            "accessors": [],
            "bufferViews": [],
        }
        self.attribute("POSITION", np.asarray(vertices, "<f4"))
        self.primitive["indices"] = self.accessor(np.asarray(faces, "<u4").reshape(-1, 1))

    @property
    def primitive(self) -> dict[str, Any]:
        return self.document["meshes"][0]["primitives"][0]

    def view(self, data: bytes) -> int:
        self.blob += bytes(-len(self.blob) % 4)
        self.document["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.blob), "byteLength": len(data)}
        )
        self.blob += data
        return len(self.document["bufferViews"]) - 1

    def accessor(self, array: np.ndarray, **more: Any) -> int:
        kinds = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
        record = {
            "bufferView": self.view(array.tobytes()),
            "componentType": kinds[array.dtype.str[1:]],
            "count": len(array),
            "type": {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}[array.shape[1]],
        }
        self.document["accessors"].append(record | more)
        return len(self.document["accessors"]) - 1

    def attribute(self, name: str, array: np.ndarray, **more: Any) -> None:
        self.primitive["attributes"][name] = self.accessor(array, **more)

    def paint(self, **material: Any) -> None:
        """Give the mesh one material."""
        self.document["materials"] = [material]
        self.primitive["material"] = 0

    def whole(self) -> dict[str, Any]:
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.blob).decode()
        return self.document | {"buffers": [{"byteLength": len(self.blob), "uri": uri}]}

    def write(self, path: Path) -> Path:
        path.write_text(json.dumps(self.whole()))
        return path


def split_glb(path: Path) -> tuple[dict[str, Any], bytes]:
    """JSON and binary chunk, read with the standard library alone."""
    data = path.read_bytes()
    (size,) = struct.unpack_from("<I", data, 12)
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def join_glb(path: Path, document: dict[str, Any] | bytes, blob: bytes = b"") -> Path:
    """Write a GLB of a document, or of its text whatever that is, and a binary chunk."""
    text = document if isinstance(document, bytes) else json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    blob += bytes(-len(blob) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(blob), b"BIN\0") + blob if blob else b""
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    return path
