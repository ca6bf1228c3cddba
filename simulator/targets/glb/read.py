"""Reader of target files: a Target from binary glTF 2.0, exact to the bit.

Mesh data are in the model frame: the rotation of the root node, which is for viewers, is ignored.
"""

from __future__ import annotations

import json
import math
import struct
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.untrusted_files import read_regular
from flyaround.simulator.targets.check_target import check_keypoints_on_mesh, check_target
from flyaround.simulator.targets.convert import (
    content_sha256,
    frames_from,
    keypoints_from,
    mass_from,
    occluders_from,
    wireframe_from,
)
from flyaround.simulator.targets.model import Material, Part, Target, TextureImage, split_level
from flyaround.simulator.targets.records import TargetRecord
from flyaround.simulator.targets.textures import embedded_pictures, texture_name

if TYPE_CHECKING:
    from numpy.typing import NDArray


CLEARCOAT, ANISOTROPY = "KHR_materials_clearcoat", "KHR_materials_anisotropy"
TYPES = {5126: "<f4", 5125: "<u4", 5123: "<u2", 5121: "u1"}  # glTF 2.0 specification, section 3.6.2.2
MAX_FILE_BYTES = 2 << 30  # largest file; it is read into memory as a whole
GLTF_ERRORS = (LookupError, TypeError, AttributeError, ValueError, ArithmeticError, RecursionError)
"""Exceptions raised when reading a document that violates glTF."""


def load_glb(path: str | Path) -> Target:
    """Read a target file.

    Returns
    -------
    Target
        Checked target.

    Raises
    ------
    UserError
        If it cannot be read, is not a target file, is damaged, or does not match its own hash.
    """
    path = Path(path)
    try:
        data = read_regular(path, MAX_FILE_BYTES)
    except OSError as error:
        raise UserError(f"cannot read target {path}: {error.strerror}; check the path") from error
    return target_from(data, path)


def target_from(data: bytes, path: Path, *, checked: bool = False) -> Target:
    """Return the target of a target file's contents.

    Parameters
    ----------
    data : bytes
        Contents of the file.
    path : Path
        Name of the file in messages.
    checked : bool, optional
        True to skip the checks, for a file that was checked when it was written and whose checksum is right.

    Raises
    ------
    UserError
        As in `load_glb`.
    """
    document, blob = read_chunks(data, path)
    record = _record(document, path)
    try:
        pictures = embedded_pictures(document, blob)
        materials = tuple(_material(document, m, record, pictures) for m in document.get("materials", []))
        parts = tuple(_parts(document, blob, materials, path))
        target = Target(
            name=record.name,
            title=record.title,
            sha256=record.sha256,
            materials=materials,
            parts=parts,
            keypoints=keypoints_from(record),
            wireframe=wireframe_from(record),
            mass=mass_from(record),
            frames=frames_from(record),
            symmetry=record.symmetry_wxyz,
            notes=record.notes,
            occluders=occluders_from(record),
            pictures=pictures,
            part_classes=record.part_classes or {},
        )
    except GLTF_ERRORS as error:
        raise UserError(
            f"{path} breaks the rules of glTF 2.0 ({type(error).__name__}: {error}); export it again"
        ) from error
    if checked:
        return target
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
    """Return True if a GLB file claims to be a target file, valid or not."""
    try:
        document, _ = read_chunks(read_regular(path, MAX_FILE_BYTES), path)
    except (OSError, UserError):
        return False
    return _extras(document) is not None


def read_chunks(data: bytes, path: Path) -> tuple[dict[str, Any], bytes]:
    """Return the JSON and the binary chunk of a GLB file (glTF 2.0 specification, section 4.4).

    Raises
    ------
    UserError
        If it is not a GLB file of version 2, or truncated.
    """
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
    offset = 12
    while offset + 8 <= length:
        size, kind = struct.unpack_from("<I4s", data, offset)
        if offset + 8 + size > length:
            raise UserError(f"{path} has a chunk that runs past its end; copy or export it again")
        chunks.setdefault(kind, data[offset + 8 : offset + 8 + size])
        offset += 8 + size
    try:
        document = parse_json(chunks[b"JSON"])
    except KeyError as error:
        raise UserError(f"{path} has no JSON chunk; copy or export it again") from error
    except ValueError as error:
        raise UserError(f"{path} has no readable JSON chunk ({error}); copy or export it again") from error
    if not isinstance(document, dict):
        raise UserError(f"{path} holds JSON that is not a glTF document; export it again")
    return document, chunks.get(b"BIN\0", b"")


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
    """Return the target data in a document's scene, unchecked; None in a plain model."""
    scenes = document.get("scenes")
    first = scenes[0] if isinstance(scenes, list) and scenes else None
    extras = first.get("extras") if isinstance(first, dict) else None
    return extras.get("flyaround") if isinstance(extras, dict) else None


def _material(
    document: dict[str, Any], m: dict[str, Any], record: TargetRecord, pictures: tuple[TextureImage, ...]
) -> Material:
    pbr = m.get("pbrMetallicRoughness", {})
    r, g, b = (float(c) for c in pbr.get("baseColorFactor", [1, 1, 1, 1])[:3])
    coat = m.get("extensions", {}).get(CLEARCOAT, {})
    brushed = float(m.get("extensions", {}).get(ANISOTROPY, {}).get("anisotropyStrength", 0.0))
    # glTF's defaults for factors that a file omits
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


MAX_VALUES = 2_000_000
"""Largest number of values and brackets in a document, because Python objects take tens of times the file's size."""


def parse_json(data: bytes) -> object:
    """Parse a JSON text.

    Raises
    ------
    ValueError
        If it is not JSON, holds NaN or Infinity, nests too deep, or has more values than any model needs.
    """
    if len(data) > MAX_VALUES:
        count = sum(data.count(sign) for sign in (b",", b"[", b"{"))
        if count > MAX_VALUES:
            raise ValueError(f"it has {count:,} values, and {MAX_VALUES:,} are the most that is read")
    try:
        return json.loads(data, parse_constant=_refuse_constant, parse_float=_finite)
    except RecursionError as error:
        raise ValueError("its brackets nest too deep") from error


def _finite(text: str) -> float:
    """Return a number; raise for one like 1e999, which Python's reader takes for infinity."""
    value = float(text)
    if math.isinf(value):
        raise ValueError(f"{text[:40]} is too large for a number")
    return value


def _refuse_constant(text: str) -> None:
    """Raise for NaN and Infinity, which JSON lacks but Python's reader accepts."""
    raise ValueError(f"{text} is not a JSON number")
