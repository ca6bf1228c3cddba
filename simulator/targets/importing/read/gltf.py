"""glTF 2.0, binary and JSON: nodes with their transforms, materials with factors, base-colour textures."""

from __future__ import annotations

import base64
import binascii
from dataclasses import replace
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.untrusted_files import find_beside, read_regular
from flyaround.simulator.targets.glb.read import (
    ANISOTROPY,
    GLTF_ERRORS,
    MAX_FILE_BYTES,
    parse_json,
    read_chunks,
)
from flyaround.simulator.targets.importing.read.brushed import (
    at_corners,
    common_grain,
    face_grain,
    read_anisotropy,
)
from flyaround.simulator.targets.importing.read.draco import unpack_draco
from flyaround.simulator.targets.importing.read.gltf_accessors import read_accessor
from flyaround.simulator.targets.importing.read.gltf_extensions import check_extensions
from flyaround.simulator.targets.importing.read.gltf_materials import GltfMaterials, transform, transform_uv
from flyaround.simulator.targets.importing.read.gltf_nodes import (
    FAN,
    STRIP,
    TRIANGLES,
    as_triangles,
    check_size,
    meshes_in_scene,
)
from flyaround.simulator.targets.importing.read.raw_model import (
    UNNAMED_SURFACE,
    RawModel,
    RawPart,
    unique_names,
)
from flyaround.simulator.targets.importing.read.textures import PictureReader

if TYPE_CHECKING:
    from pathlib import Path

    from flyaround.simulator.runtime.arrays import FloatArray, IntArray
    from flyaround.simulator.targets.model import Material

SKIPPED_PARTS = {"animations": "animations (the pose of the nodes is taken)", "cameras": "cameras"}
"""Parts of a document that are reported and skipped."""


def read_gltf(path: Path, data: bytes) -> RawModel:
    """Read one glTF model; each node with a mesh becomes a part.

    Raises
    ------
    UserError
        If a buffer or image is missing, the geometry is compressed, or the file violates glTF.
    """
    document: object
    if data[:4] == b"glTF":
        document, blob = read_chunks(data, path)
    else:
        try:
            document, blob = parse_json(data), b""
        except ValueError as error:
            raise UserError(f"{path} is not readable JSON ({error}); export it again") from error
    if not isinstance(document, dict) or not isinstance(document.get("asset"), dict):
        raise UserError(f"{path} holds JSON that is not a glTF document; export it again")
    if str(document["asset"].get("version", "2")).startswith("1"):
        raise UserError(f"{path} is glTF version 1; export it as version 2")
    lost, notes = check_extensions(path, document)
    try:
        return _Reader(path, document, blob, lost, notes).model()
    except GLTF_ERRORS as error:
        raise UserError(
            f"{path} breaks the rules of glTF 2.0 ({type(error).__name__}: {str(error)[:200]}); export it again"
        ) from error


class _Reader:
    """Converter of one glTF document to parts."""

    def __init__(
        self, path: Path, document: dict[str, Any], blob: bytes, lost: list[str], notes: list[str]
    ) -> None:
        self.path, self.document = path, document
        self.notes, self.lost = notes, set(lost)
        self.files: dict[Path, bytes] = {}
        buffers = [self._buffer(b, blob, k) for k, b in enumerate(document.get("buffers", []))]
        self.reader = PictureReader(path, self.notes)
        self.materials = GltfMaterials(document, self.reader, self._image, self.lost)
        self.grain: dict[int, FloatArray] = {}
        self.buffers = unpack_draco(path, document, buffers)

    def model(self) -> RawModel:
        document = self.document
        materials = self.materials.all()
        names = unique_names((m.name for m in materials), "material")
        materials = [replace(m, name=n) for m, n in zip(materials, names, strict=True)]
        materials.append(UNNAMED_SURFACE)
        nodes = meshes_in_scene(document, self.notes, self._read)
        check_size(document, nodes, sum(map(len, self.buffers)))
        meshes = {number for _, number, _ in nodes}
        if any("skin" in node for node in document.get("nodes", [])) or any(
            "targets" in p for number in meshes for p in document["meshes"][number]["primitives"]
        ):
            self.lost.add("skins and morph targets (the rest pose is taken)")
        self.lost |= {what for key, what in SKIPPED_PARTS.items() if document.get(key)}
        parts = []
        for name, (_, mesh, matrix) in zip(unique_names((f[0] for f in nodes), "part"), nodes, strict=True):
            part = self._part(name, document["meshes"][mesh], matrix, len(materials) - 1)
            if part is not None:
                parts.append(part)
        materials = self._with_grain(materials)
        material_indices = {int(k) for p in parts for k in np.unique(p.face_material)}
        if len(materials) - 1 in material_indices and document.get("materials"):
            self.notes.append("some faces name no material: given a mid-grey paint")
        if self.lost:
            self.notes.append(f"not carried over: {', '.join(sorted(self.lost))}")
        return RawModel(
            path=self.path, kind="gltf", parts=parts, materials=materials, in_metres=True, up="y", notes=self.notes,
            pictures=self.materials.pictures, faults=self.reader.faults,
        )  # fmt: skip

    def _part(self, name: str, mesh: dict[str, Any], matrix: FloatArray, no_material: int) -> RawPart | None:
        positions, normals, triangles, materials, colours, corners = [], [], [], [], [], []
        start = 0
        for primitive in mesh["primitives"]:
            mode = primitive.get("mode", TRIANGLES)
            if mode not in (TRIANGLES, STRIP, FAN):
                self.lost.add("points and lines")
                continue
            attributes = primitive["attributes"]
            p = self._read(attributes["POSITION"])
            index = (
                self._read(primitive["indices"]).astype(np.int64).ravel()
                if "indices" in primitive
                else np.arange(len(p))
            )
            t = as_triangles(index, mode)
            number = primitive.get("material", no_material)
            if not isinstance(number, int) or not 0 <= number <= no_material:
                raise ValueError(f"a primitive has material {number!r} of {no_material}")
            positions.append(p)
            normals.append(self._read(attributes["NORMAL"]) if "NORMAL" in attributes else None)
            triangles.append(t + start)
            materials.append(np.full(len(t), number, np.int64))
            colours.append(self._colours(primitive, t, len(p)))
            corners.append(self._coordinates(primitive, t))
            start += len(p)
            self._add_grain(primitive, t, p, corners[-1], matrix[:3, :3])
        if not positions:
            return None
        linear = matrix[:3, :3]
        all_triangles = np.concatenate(triangles)
        uv = _join_faces(corners, triangles, (3, 2))
        if np.linalg.det(linear) < 0:  # a mirrored node reverses the winding
            all_triangles = all_triangles[:, ::-1]
            uv = None if uv is None else uv[:, ::-1]
        all_normals = None
        if all(n is not None for n in normals):
            all_normals = np.concatenate([n for n in normals if n is not None]) @ np.linalg.pinv(linear)
        with np.errstate(invalid="ignore", over="ignore"):  # non-finite vertices are reported later
            scene_positions = np.concatenate(positions) @ linear.T + matrix[:3, 3]
        return RawPart(
            name=name,
            positions_m=scene_positions,
            triangles=all_triangles,
            face_material=np.concatenate(materials),
            normals=all_normals,
            face_colour=_join_faces(colours, triangles, (3,)),
            corner_uv=uv,
        )

    def _add_grain(
        self,
        primitive: dict[str, Any],
        triangles: IntArray,
        positions: FloatArray,
        corner_uv: FloatArray | None,
        linear: FloatArray,
    ) -> None:
        """Add the grain of a brushed material's faces."""
        if "material" not in primitive:
            return
        number = int(primitive["material"])
        strength, turn = read_anisotropy(self.document["materials"][number], ANISOTROPY)
        if strength == 0:
            return
        tangents = None
        if "TANGENT" in primitive["attributes"]:
            values = self._read(primitive["attributes"]["TANGENT"])
            tangents = at_corners(np.column_stack([values[:, :3] @ linear.T, values[:, 3]]), triangles)
        elif corner_uv is None and "TEXCOORD_0" in primitive["attributes"]:
            corner_uv = at_corners(self._read(primitive["attributes"]["TEXCOORD_0"]), triangles)
        corners = at_corners(positions @ linear.T, triangles)
        dyads = face_grain(corners, tangents, corner_uv, turn)
        self.grain[number] = self.grain.get(number, np.zeros((3, 3))) + dyads

    def _with_grain(self, materials: list[Material]) -> list[Material]:
        """Return the materials with their grain directions."""
        materials_with_grain = list(materials)
        for number, dyads in self.grain.items():
            grain = common_grain(dyads)
            if not grain.fits:
                self.lost.add(
                    "brushing that is neither straight nor around an axis (its mean direction is taken)"
                )
            if not any(grain.axis):
                self.lost.add("brushing of meshes without tangents or texture coordinates")
                materials_with_grain[number] = replace(materials_with_grain[number], anisotropy=0.0)
            else:
                materials_with_grain[number] = replace(
                    materials_with_grain[number], grain=grain.axis, turned=grain.turned
                )
        return [m if any(m.grain) else replace(m, anisotropy=0.0) for m in materials_with_grain]

    def _colours(self, primitive: dict[str, Any], triangles: IntArray, count: int) -> FloatArray | None:
        """Return (F, 3) face colours from the vertices, if the file has them and no texture."""
        attributes, factor = primitive["attributes"], np.ones(3)
        if "COLOR_0" not in attributes:
            return None
        if self.materials.textures(primitive):
            self.lost.add("colours of vertices beside textures")
            return None
        if "material" in primitive:
            pbr = self.document["materials"][primitive["material"]].get("pbrMetallicRoughness", {})
            factor = np.asarray(pbr.get("baseColorFactor", [1, 1, 1, 1])[:3], float)
        vertex = self._read(attributes["COLOR_0"])[:, :3]
        return np.asarray(vertex[np.clip(triangles, 0, count - 1)].mean(axis=1) * factor)

    def _coordinates(self, primitive: dict[str, Any], triangles: IntArray) -> FloatArray | None:
        """Return (F, 3, 2) texture coordinates of the corners for the material's textures."""
        textures = self.materials.textures(primitive)
        if not textures:
            return None
        change, number = transform(textures[0])
        if any(transform(other) != (change, number) for other in textures[1:]):
            self.lost.add("texture coordinates of their own for maps beside the base colour")
        key = f"TEXCOORD_{number}"
        if key not in primitive["attributes"]:
            return None
        uv = self._read(primitive["attributes"][key])[:, :2]
        with np.errstate(invalid="ignore"):
            corners = transform_uv(uv, change)[np.clip(triangles, 0, len(uv) - 1)]
        for reference in textures:
            self.materials.check_wrapping(reference, corners)
        return np.asarray(corners)

    def _image(self, image: dict[str, Any]) -> bytes | None:
        """Return the bytes of an embedded image; None if it is a separate file."""
        if "bufferView" in image:
            view = self.document["bufferViews"][image["bufferView"]]
            start = view.get("byteOffset", 0)
            return self.buffers[view["buffer"]][start : start + view["byteLength"]] if start >= 0 else b""
        return embedded_file(self.path, image["uri"], "texture")

    def _buffer(self, record: dict[str, Any], blob: bytes, number: int) -> bytes:
        length = int(record["byteLength"])
        data = self._file(record["uri"], "buffer", MAX_FILE_BYTES) if "uri" in record else blob
        if len(data) < length:
            raise UserError(
                f"{self.path}: buffer {number} has {len(data)} of {length} bytes; copy or export it again"
            )
        return data

    def _file(self, uri: str, what: str, max_bytes: int) -> bytes:
        data = embedded_file(self.path, uri, what)
        if data is not None:
            return data
        path = find_beside(self.path, unquote(uri), what)
        try:
            if path not in self.files:  # any number of buffers may name one file
                self.files[path] = read_regular(path, max_bytes)
            return self.files[path]
        except OSError as error:
            raise UserError(
                f"{self.path}: {what} file {unquote(uri)[:80]!r} is missing; put it beside the model, or export as .glb"
            ) from error

    def _read(self, number: int) -> FloatArray:
        return read_accessor(self.document, self.buffers, number)


def embedded_file(path: Path, uri: str, what: str) -> bytes | None:
    """Return the bytes of a data URI; None if it is not one.

    Raises
    ------
    UserError
        If it is damaged.
    """
    if not uri.startswith("data:"):
        return None
    try:
        return base64.b64decode(uri.partition(",")[2], validate=True)
    except binascii.Error as error:
        raise UserError(f"{path}: an embedded {what} is damaged; export it again") from error


def _join_faces(
    rows: list[FloatArray | None], triangles: list[IntArray], shape: tuple[int, ...]
) -> FloatArray | None:
    """Concatenate per-face values of all primitives, NaN where missing; None if all are missing."""
    if all(r is None for r in rows):
        return None
    blank = (np.full((len(t), *shape), np.nan) for t in triangles)
    return np.concatenate([b if r is None else r for b, r in zip(blank, rows, strict=True)])
