"""Writer of target files: a Target as binary glTF 2.0, exact to the bit.

Each part is a node with a mesh. A root node rotates the model's z axis to glTF's y, for viewers. The JSON document is
built directly (glTF 2.0 specification, sections 3 and 5), because the classes of glTF libraries are slow.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.targets.convert import target_record
from flyaround.simulator.targets.glb.read import ANISOTROPY, CLEARCOAT
from flyaround.simulator.targets.textures import mime_type

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.targets.model import Material, Part, Target, TextureImage

# glTF 2.0 specification: sections 5.11.5 (use of a buffer), 3.6.2.2 (numbers), 5.24.4 (triangles), 5.26 (samplers)
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER, FLOAT, UNSIGNED_INT, TRIANGLES = 34962, 34963, 5126, 5125, 4
LINEAR, LINEAR_MIPMAP_LINEAR, REPEAT = 9729, 9987, 10497
# -90 degrees about x: glTF is y up (section 3.4), targets are z up.
Y_UP_FROM_Z_UP_XYZW = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]


Json = dict[str, Any]


def write_glb(target: Target, path: str | Path) -> None:
    """Write ``target`` as a target file (docs/formats/target.md).

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    write_atomic(Path(path), glb_bytes(target))


def glb_bytes(target: Target) -> bytes:
    """Encode a target as a target file (docs/formats/target.md).

    Returns
    -------
    bytes
        Contents of a binary glTF file.
    """
    document: Json = {
        "asset": {"version": "2.0", "generator": "flyaround"},
        "accessors": [],
        "bufferViews": [],
        "materials": [_gltf_material(m, target.pictures) for m in target.materials],
        "meshes": [],
        "nodes": [],
    }
    blob = bytearray()
    index = {m.name: k for k, m in enumerate(target.materials)}
    grain = {m.name: m for m in target.materials if m.anisotropy > 0}
    for part in target.parts:
        attributes = {
            "POSITION": _append(document, blob, np.ascontiguousarray(part.positions_m, "<f4"), ARRAY_BUFFER),
            "NORMAL": _append(document, blob, np.ascontiguousarray(part.normals, "<f4"), ARRAY_BUFFER),
        }
        triangles = np.ascontiguousarray(part.triangles, "<u4")
        indices = _append(document, blob, triangles, ELEMENT_ARRAY_BUFFER)
        if part.uv is not None:
            uv = np.ascontiguousarray(part.uv, "<f4")
            attributes["TEXCOORD_0"] = _append(document, blob, uv, ARRAY_BUFFER)
        if part.material in grain:
            tangents = _tangents(part, grain[part.material])
            attributes["TANGENT"] = _append(document, blob, tangents, ARRAY_BUFFER)
        primitive = {
            "attributes": attributes,
            "indices": indices,
            "material": index[part.material],
            "mode": TRIANGLES,
        }
        document["meshes"].append({"name": part.name, "primitives": [primitive]})
        document["nodes"].append({"name": part.name, "mesh": len(document["meshes"]) - 1})
    _append_pictures(document, blob, target.pictures)
    children = list(range(len(document["nodes"])))
    document["nodes"].append({"name": target.name, "children": children, "rotation": Y_UP_FROM_Z_UP_XYZW})
    extras = {"flyaround": msgspec.to_builtins(target_record(target))}
    document["scenes"] = [{"name": target.name, "nodes": [len(children)], "extras": extras}]
    document["scene"] = 0
    document["buffers"] = [{"byteLength": len(blob)}]
    in_use = {CLEARCOAT: any(m.clearcoat > 0 for m in target.materials), ANISOTROPY: bool(grain)}
    if any(in_use.values()):
        document["extensionsUsed"] = [name for name, is_used in in_use.items() if is_used]
    return _chunks(document, bytes(blob))


def _chunks(document: Json, blob: bytes) -> bytes:
    """Return a GLB file of a document and its buffer (glTF 2.0 specification, section 4.4)."""
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    blob += b"\0" * (-len(blob) % 4)
    chunks = b"".join(
        struct.pack("<I4s", len(data), kind) + data for kind, data in ((b"JSON", text), (b"BIN\0", blob))
    )
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _gltf_material(m: Material, pictures: tuple[TextureImage, ...]) -> Json:
    pbr: Json = {
        "baseColorFactor": [*m.base_color, 1.0],
        "metallicFactor": m.metallic,
        "roughnessFactor": m.roughness,
    }
    gltf_material: Json = {"name": m.name, "pbrMetallicRoughness": pbr, "alphaMode": "OPAQUE"}
    extensions: Json = {}
    if m.clearcoat > 0:
        extensions[CLEARCOAT] = {
            "clearcoatFactor": m.clearcoat,
            "clearcoatRoughnessFactor": m.clearcoat_roughness,
        }
    if m.anisotropy > 0:
        extensions[ANISOTROPY] = {"anisotropyStrength": m.anisotropy}
    if extensions:
        gltf_material["extensions"] = extensions
    number = {p.name: k for k, p in enumerate(pictures)}
    for owner, key, texture in (
        (pbr, "baseColorTexture", m.base_color_texture),
        (pbr, "metallicRoughnessTexture", m.metallic_roughness_texture),
        (gltf_material, "normalTexture", m.normal_texture),
    ):
        if texture:
            owner[key] = {"index": number[texture]}
    return gltf_material


def _tangents(part: Part, brushed: Material) -> NDArray[Any]:
    """Return the glTF tangents (N, 4) of a brushed part: across the grain, the direction in which highlights widen."""
    axis = np.asarray(brushed.grain, float) / np.linalg.norm(brushed.grain)
    normals = part.normals.astype(float)
    tangent = axis - (normals @ axis)[:, None] * normals if brushed.turned else np.cross(normals, axis)
    length = np.linalg.norm(tangent, axis=1, keepdims=True)
    # if a face is normal to the grain, any direction serves
    fallback = np.cross(part.normals, np.roll(part.normals, 1, axis=1) * (1, -1, 1) + (0.1, 0.2, 0.3))
    tangent = np.where(length > 1e-6, tangent, fallback)
    tangent = tangent / np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    return np.column_stack([tangent, np.ones(len(tangent))]).astype("<f4")


def _append(document: Json, blob: bytearray, data: NDArray[Any], use: int) -> int:
    """Append an array to the buffer and return the index of its accessor."""
    view = {"buffer": 0, "byteOffset": len(blob), "byteLength": data.nbytes, "target": use}
    document["bufferViews"].append(view)
    accessor: Json = {"bufferView": len(document["bufferViews"]) - 1, "byteOffset": 0}
    if use == ARRAY_BUFFER:
        low, high = (f(data, axis=0).astype(float).tolist() for f in (np.min, np.max))
        kind = {2: "VEC2", 3: "VEC3", 4: "VEC4"}[data.shape[1]]
        accessor |= {"componentType": FLOAT, "count": len(data), "type": kind, "min": low, "max": high}
    else:
        accessor |= {"componentType": UNSIGNED_INT, "count": data.size, "type": "SCALAR"}
    document["accessors"].append(accessor)
    blob += data.tobytes()
    return len(document["accessors"]) - 1


def _append_pictures(document: Json, blob: bytearray, pictures: tuple[TextureImage, ...]) -> None:
    """Embed the images after the vertex data, as one texture each, in order."""
    if not pictures:
        return
    document["samplers"] = [
        {"magFilter": LINEAR, "minFilter": LINEAR_MIPMAP_LINEAR, "wrapS": REPEAT, "wrapT": REPEAT}
    ]
    document["images"], document["textures"] = [], []
    for k, picture in enumerate(pictures):
        view = {"buffer": 0, "byteOffset": len(blob), "byteLength": len(picture.data)}
        document["bufferViews"].append(view)
        image = {
            "name": picture.name,
            "mimeType": mime_type(picture.data),
            "bufferView": len(document["bufferViews"]) - 1,
        }
        document["images"].append(image)
        document["textures"].append({"sampler": 0, "source": k})
        blob += picture.data + b"\0" * (-len(picture.data) % 4)
