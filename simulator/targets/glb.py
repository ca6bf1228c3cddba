"""Target files: a Target as binary glTF 2.0, written and read back to the same bits.

One node and one mesh per part; a root node turns the model's z axis to glTF's y for viewers. Mesh data
stay in the model frame, and reading ignores the root's rotation.
"""

from __future__ import annotations

import json
import struct
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
import pygltflib as gl

from simulator.errors import UserError
from simulator.files import write_atomic
from simulator.targets.check import check_keypoints_on_mesh, check_target
from simulator.targets.convert import (
    content_sha256,
    frames_of,
    keypoints_of,
    mass_of,
    occluders_of,
    record_of,
    wireframe_of,
)
from simulator.targets.detail import split_level
from simulator.targets.glb_pictures import add_textures, append_pictures, pictures_of, texture_name
from simulator.targets.model import Material, Part, Picture, Target
from simulator.targets.records import TargetRecord

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

CLEARCOAT, ANISOTROPY = "KHR_materials_clearcoat", "KHR_materials_anisotropy"
Y_UP_FROM_Z_UP_XYZW = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]
TYPES = {gl.FLOAT: "<f4", gl.UNSIGNED_INT: "<u4", gl.UNSIGNED_SHORT: "<u2", gl.UNSIGNED_BYTE: "u1"}


def write_glb(target: Target, path: Path) -> None:
    """Write ``target`` as a target file (docs/formats/target.md).

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    document, blob = gl.GLTF2(asset=gl.Asset(version="2.0", generator="flyaround")), bytearray()
    document.materials = [_gltf_material(m, target.pictures) for m in target.materials]
    index = {m.name: k for k, m in enumerate(target.materials)}
    grain = {m.name: m for m in target.materials if m.anisotropy > 0}
    for part in target.parts:
        at = [
            _append(document, blob, np.ascontiguousarray(part.positions_m, "<f4"), gl.ARRAY_BUFFER),
            _append(document, blob, np.ascontiguousarray(part.normals, "<f4"), gl.ARRAY_BUFFER),
            _append(document, blob, np.ascontiguousarray(part.triangles, "<u4"), gl.ELEMENT_ARRAY_BUFFER),
        ]
        uv = None
        if part.uv is not None:
            uv = _append(document, blob, np.ascontiguousarray(part.uv, "<f4"), gl.ARRAY_BUFFER)
        tangent = None
        if part.material in grain:
            tangent = _append(document, blob, _tangents(part, grain[part.material]), gl.ARRAY_BUFFER)
        primitive = gl.Primitive(
            attributes=gl.Attributes(POSITION=at[0], NORMAL=at[1], TANGENT=tangent, TEXCOORD_0=uv),
            indices=at[2],
            material=index[part.material],
        )
        document.meshes.append(gl.Mesh(name=part.name, primitives=[primitive]))
        document.nodes.append(gl.Node(name=part.name, mesh=len(document.meshes) - 1))
    append_pictures(document, blob, target.pictures)
    children = list(range(len(document.nodes)))
    document.nodes.append(gl.Node(name=target.name, children=children, rotation=Y_UP_FROM_Z_UP_XYZW))
    extras = {"flyaround": msgspec.to_builtins(record_of(target))}
    document.scenes = [gl.Scene(name=target.name, nodes=[len(children)], extras=extras)]
    document.scene = 0
    document.buffers = [gl.Buffer(byteLength=len(blob))]
    used = {CLEARCOAT: any(m.clearcoat > 0 for m in target.materials), ANISOTROPY: bool(grain)}
    if any(used.values()):
        document.extensionsUsed = [name for name, is_used in used.items() if is_used]
    document.set_binary_blob(bytes(blob))
    write_atomic(path, b"".join(document.save_to_bytes()))


def _gltf_material(m: Material, pictures: tuple[Picture, ...]) -> gl.Material:
    pbr = gl.PbrMetallicRoughness(
        baseColorFactor=[*m.base_color, 1.0], metallicFactor=m.metallic, roughnessFactor=m.roughness
    )
    extensions = {}
    if m.clearcoat > 0:
        extensions[CLEARCOAT] = {
            "clearcoatFactor": m.clearcoat,
            "clearcoatRoughnessFactor": m.clearcoat_roughness,
        }
    if m.anisotropy > 0:
        extensions[ANISOTROPY] = {"anisotropyStrength": m.anisotropy}
    written = gl.Material(name=m.name, pbrMetallicRoughness=pbr, alphaMode=gl.OPAQUE, extensions=extensions)
    add_textures(written, m, pictures)
    return written


def _tangents(part: Part, brushed: Material) -> NDArray[Any]:
    """(N, 4) glTF tangents of a brushed part: across the grain, the way in which its highlight is wide."""
    axis = np.asarray(brushed.grain, float) / np.linalg.norm(brushed.grain)
    n = part.normals.astype(float)
    across = axis - (n @ axis)[:, None] * n if brushed.turned else np.cross(n, axis)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    # where a face looks along the grain any direction will do
    other = np.cross(part.normals, np.roll(part.normals, 1, axis=1) * (1, -1, 1) + (0.1, 0.2, 0.3))
    across = np.where(length > 1e-6, across, other)
    across = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    return np.column_stack([across, np.ones(len(across))]).astype("<f4")


def _append(document: gl.GLTF2, blob: bytearray, data: NDArray[Any], use: int) -> int:
    """Append an array to the buffer; returns the number of its accessor."""
    document.bufferViews.append(
        gl.BufferView(buffer=0, byteOffset=len(blob), byteLength=data.nbytes, target=use)
    )
    accessor = gl.Accessor(bufferView=len(document.bufferViews) - 1, count=data.size, type=gl.SCALAR)
    accessor.componentType = gl.UNSIGNED_INT if use == gl.ELEMENT_ARRAY_BUFFER else gl.FLOAT
    if use == gl.ARRAY_BUFFER:
        accessor.type, accessor.count = ({2: gl.VEC2, 3: gl.VEC3, 4: gl.VEC4}[data.shape[1]]), len(data)
        accessor.min, accessor.max = (f(data, axis=0).astype(float).tolist() for f in (np.min, np.max))
    document.accessors.append(accessor)
    blob += data.tobytes()
    return len(document.accessors) - 1


def load_glb(path: Path) -> Target:
    """Read a target file.

    Raises
    ------
    UserError
        If it is not one, is damaged, or does not match its own hash.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UserError(f"cannot read target {path}: {error.strerror}; check the path") from error
    document, blob = read_chunks(data, path)
    record = _record(document, path)
    try:
        pictures = pictures_of(document, blob)
        materials = tuple(_material(document, m, record, pictures) for m in document.get("materials", []))
        parts = tuple(_parts(document, blob, materials, path))
    except (KeyError, IndexError, TypeError, AttributeError, ValueError) as error:
        raise UserError(
            f"{path} breaks the rules of glTF 2.0 ({type(error).__name__}: {error}); export it again"
        ) from error
    target = Target(
        name=record.name,
        title=record.title,
        sha256=record.sha256,
        materials=materials,
        parts=parts,
        keypoints=keypoints_of(record),
        wireframe=wireframe_of(record),
        mass=mass_of(record),
        frames=frames_of(record),
        symmetry=record.symmetry_wxyz,
        notes=record.notes,
        occluders=occluders_of(record),
        pictures=pictures,
    )
    check_target(target, str(path))
    if split_level(record.name)[1] == "full":
        check_keypoints_on_mesh(target, str(path))
    digest = content_sha256(materials, parts, target.keypoints, target.wireframe, target.occluders, pictures)
    if digest != record.sha256:
        raise UserError(
            f"{path} does not match its own hash (says {record.sha256[:12]}, is {digest[:12]}): it was "
            "changed after export; export it again"
        )
    return target


def holds_target(path: Path) -> bool:
    """Whether a GLB file says that it is a target file, sound or not."""
    try:
        document, _ = read_chunks(path.read_bytes(), path)
    except (OSError, UserError):
        return False
    return _extras(document) is not None


def read_chunks(data: bytes, path: Path) -> tuple[dict[str, Any], bytes]:
    """The JSON and the binary chunk of a GLB file (glTF 2.0 specification, section 4.4)."""
    if data[:4] != b"glTF":
        raise UserError(f"{path} is not a binary glTF file (.glb); export the model as one")
    if len(data) < 20:
        raise UserError(f"{path} is cut short ({len(data)} bytes); copy or export it again")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise UserError(f"{path} is glTF version {version}; export it as version 2")
    if len(data) < length:
        raise UserError(f"{path} is cut short ({len(data)} of {length} bytes); copy or export it again")
    chunks: dict[bytes, bytes] = {}
    at = 12
    while at + 8 <= length:
        size, kind = struct.unpack_from("<I4s", data, at)
        if at + 8 + size > length:
            raise UserError(f"{path} has a chunk that runs past its end; copy or export it again")
        chunks.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    try:
        document = json.loads(chunks[b"JSON"], parse_constant=_refuse_constant)
    except (KeyError, ValueError) as error:
        raise UserError(f"{path} has no readable JSON chunk; copy or export it again") from error
    if not isinstance(document, dict):
        raise UserError(f"{path} holds JSON that is not a glTF document; export it again")
    return document, chunks.get(b"BIN\0", b"")


def _refuse_constant(text: str) -> None:
    """JSON has no NaN and no Infinity, though Python's reader would take them."""
    raise ValueError(text)


def _record(document: dict[str, Any], path: Path) -> TargetRecord:
    extras = _extras(document)
    if extras is None:
        raise UserError(
            f"{path} is a plain glTF model: its scene has no `flyaround` extras with keypoints and "
            "wireframe; make a target file as in docs/formats/target.md"
        )
    try:
        return msgspec.convert(extras, TargetRecord)
    except msgspec.ValidationError as error:
        raise UserError(f"{path}, `flyaround` extras: {error}; see docs/formats/target.md") from error


def _extras(document: dict[str, Any]) -> object:
    """What a target file keeps in its scene, unchecked; None in a plain model."""
    scenes = document.get("scenes")
    first = scenes[0] if isinstance(scenes, list) and scenes else None
    extras = first.get("extras") if isinstance(first, dict) else None
    return extras.get("flyaround") if isinstance(extras, dict) else None


def _material(
    document: dict[str, Any], m: dict[str, Any], record: TargetRecord, pictures: tuple[Picture, ...]
) -> Material:
    pbr = m.get("pbrMetallicRoughness", {})
    r, g, b = (float(c) for c in pbr.get("baseColorFactor", [1, 1, 1, 1])[:3])
    coat = m.get("extensions", {}).get(CLEARCOAT, {})
    brushed = float(m.get("extensions", {}).get(ANISOTROPY, {}).get("anisotropyStrength", 0.0))
    # glTF's own defaults, where a file leaves a factor out
    return Material(
        name=m["name"],
        base_color=(r, g, b),
        metallic=float(pbr.get("metallicFactor", 1.0)),
        roughness=float(pbr.get("roughnessFactor", 1.0)),
        clearcoat=float(coat.get("clearcoatFactor", 0.0)),
        clearcoat_roughness=float(coat.get("clearcoatRoughnessFactor", Material.clearcoat_roughness)),
        crinkle=record.crinkle.get(m["name"], 0.0),
        anisotropy=brushed,
        grain=record.grain.get(m["name"], Material.grain),
        turned=m["name"] in record.turned,
        base_color_texture=texture_name(document, pbr.get("baseColorTexture"), pictures),
        metallic_roughness_texture=texture_name(document, pbr.get("metallicRoughnessTexture"), pictures),
        normal_texture=texture_name(document, m.get("normalTexture"), pictures),
    )


def _parts(document: dict[str, Any], blob: bytes, materials: tuple[Material, ...], path: Path) -> list[Part]:
    parts = []
    for node in document["nodes"]:
        if "mesh" not in node:
            continue
        mesh = document["meshes"][node["mesh"]]
        (primitive,) = mesh["primitives"]
        attributes = primitive["attributes"]
        if "NORMAL" not in attributes:
            raise UserError(f"{path}, part {node['name']!r}: no normals; export the model with normals")
        uv = None
        if "TEXCOORD_0" in attributes:
            uv = _array(document, blob, attributes["TEXCOORD_0"], 2).astype(np.float32)
        parts.append(
            Part(
                name=node["name"],
                material=materials[primitive["material"]].name,
                positions_m=_array(document, blob, attributes["POSITION"], 3).astype(np.float32),
                normals=_array(document, blob, attributes["NORMAL"], 3).astype(np.float32),
                triangles=_array(document, blob, primitive["indices"], 1).astype(np.int64).reshape(-1, 3),
                uv=uv,
            )
        )
    if not parts:
        raise UserError(f"{path} holds no mesh; export the model again")
    return parts


def _array(document: dict[str, Any], blob: bytes, number: int, width: int) -> NDArray[Any]:
    accessor = document["accessors"][number]
    view = document["bufferViews"][accessor["bufferView"]]
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    dtype = np.dtype(TYPES[accessor["componentType"]])
    if view.get("byteStride", width * dtype.itemsize) != width * dtype.itemsize:
        raise ValueError("interleaved vertex data are not read")
    return np.frombuffer(blob, dtype, accessor["count"] * width, start).reshape(-1, width)
