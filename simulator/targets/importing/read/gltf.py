"""glTF 2.0, binary and JSON: nodes with their transforms, materials with factors, base-colour textures."""

from __future__ import annotations

import base64
import binascii
from dataclasses import replace
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

import numpy as np

from simulator.errors import UserError
from simulator.runtime.untrusted_files import find_beside, read_regular
from simulator.targets.glb.read import (
    ANISOTROPY,
    BROKEN,
    CLEARCOAT,
    LARGEST_FILE_BYTES,
    parse_json,
    read_chunks,
)
from simulator.targets.importing.read.brushed import anisotropy_of, common_grain, corners_of, face_grain
from simulator.targets.importing.read.draco import DRACO, unpack_draco
from simulator.targets.importing.read.gltf_accessors import read_accessor
from simulator.targets.importing.read.gltf_nodes import (
    FAN,
    STRIP,
    TRIANGLES,
    as_triangles,
    check_weight,
    placed_meshes,
)
from simulator.targets.importing.read.raw_model import (
    UNNAMED_SURFACE,
    RawModel,
    RawPart,
    unique_name,
    unique_names,
)
from simulator.targets.importing.read.textures import LARGEST_PICTURE_BYTES, PictureReader
from simulator.targets.model import Material, TextureImage

if TYPE_CHECKING:
    from pathlib import Path

    from simulator.runtime.arrays import FloatArray, IntArray

COMPRESSED = {"EXT_meshopt_compression": "meshopt"}
UNDERSTOOD = (
    DRACO,
    "KHR_materials_",
    "KHR_mesh_quantization",
    "KHR_lights",
    "KHR_texture_transform",
    "EXT_texture_",
)
SPECULAR = "KHR_materials_pbrSpecularGlossiness"


def read_gltf(path: Path, data: bytes) -> RawModel:
    """Read one glTF model; each node with a mesh becomes a part.

    Raises
    ------
    UserError
        If a buffer or picture is missing, the geometry is compressed, or the file breaks glTF's rules.
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
    required = document.get("extensionsRequired") or []
    for name in map(str, required if isinstance(required, list) else [required]):
        if name in COMPRESSED:
            raise UserError(
                f"{path} is compressed with {COMPRESSED[name]}; export it without mesh compression"
            )
        if not name.startswith(UNDERSTOOD):
            raise UserError(
                f"{path} requires the glTF extension {name}, which is not read; export it without"
            )
    try:
        return _Reader(path, document, blob).model()
    except BROKEN as error:
        raise UserError(
            f"{path} breaks the rules of glTF 2.0 ({type(error).__name__}: {str(error)[:200]}); export it again"
        ) from error


class _Reader:
    """One document on its way to parts."""

    def __init__(self, path: Path, document: dict[str, Any], blob: bytes) -> None:
        self.path, self.document = path, document
        self.notes: list[str] = []
        self.files: dict[Path, bytes] = {}
        packed = [self._buffer(b, blob, k) for k, b in enumerate(document.get("buffers", []))]
        self.pictures: dict[int, TextureImage] = {}
        self.reader = PictureReader(path, self.notes)
        self.lost: set[str] = set()
        self.grain: dict[int, FloatArray] = {}
        self.buffers = unpack_draco(path, document, packed)

    def model(self) -> RawModel:
        document = self.document
        materials = [self._material(m) for m in document.get("materials", [])]
        names = unique_names((m.name for m in materials), "material")
        materials = [replace(m, name=n) for m, n in zip(materials, names, strict=True)]
        materials.append(UNNAMED_SURFACE)
        found = placed_meshes(document, self.notes)
        check_weight(document, found, sum(map(len, self.buffers)))
        meshes = {number for _, number, _ in found}
        if any("skin" in node for node in document.get("nodes", [])) or any(
            "targets" in p for number in meshes for p in document["meshes"][number]["primitives"]
        ):
            self.lost.add("skins and morph targets (the rest pose is taken)")
        parts = []
        for name, (_, mesh, matrix) in zip(unique_names((f[0] for f in found), "part"), found, strict=True):
            part = self._part(name, document["meshes"][mesh], matrix, len(materials) - 1)
            if part is not None:
                parts.append(part)
        materials = self._brushed(materials)
        used = {int(k) for p in parts for k in np.unique(p.face_material)}
        if len(materials) - 1 in used and document.get("materials"):
            self.notes.append("some faces name no material: given a mid-grey paint")
        if self.lost:
            self.notes.append(f"not carried over: {', '.join(sorted(self.lost))}")
        return RawModel(
            path=self.path, kind="gltf", parts=parts, materials=materials, in_metres=True, up="y", notes=self.notes,
            pictures={p.name: p for p in self.pictures.values()},
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
        uv = _joined(corners, triangles, (3, 2))
        if np.linalg.det(linear) < 0:  # a mirrored node turns the winding round
            all_triangles = all_triangles[:, ::-1]
            uv = None if uv is None else uv[:, ::-1]
        whole = None
        if all(n is not None for n in normals):
            whole = np.concatenate([n for n in normals if n is not None]) @ np.linalg.pinv(linear)
        with np.errstate(invalid="ignore", over="ignore"):  # vertices that are not finite are named later
            places = np.concatenate(positions) @ linear.T + matrix[:3, 3]
        return RawPart(
            name=name,
            positions_m=places,
            triangles=all_triangles,
            face_material=np.concatenate(materials),
            normals=whole,
            face_colour=_joined(colours, triangles, (3,)),
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
        """Note in which directions the faces of a brushed material are brushed."""
        if "material" not in primitive:
            return
        number = int(primitive["material"])
        strength, turn = anisotropy_of(self.document["materials"][number], ANISOTROPY)
        if strength == 0:
            return
        tangents = None
        if "TANGENT" in primitive["attributes"]:
            read = self._read(primitive["attributes"]["TANGENT"])
            tangents = corners_of(np.column_stack([read[:, :3] @ linear.T, read[:, 3]]), triangles)
        elif corner_uv is None and "TEXCOORD_0" in primitive["attributes"]:
            corner_uv = corners_of(self._read(primitive["attributes"]["TEXCOORD_0"]), triangles)
        places = corners_of(positions @ linear.T, triangles)
        dyads = face_grain(places, tangents, corner_uv, turn)
        self.grain[number] = self.grain.get(number, np.zeros((3, 3))) + dyads

    def _brushed(self, materials: list[Material]) -> list[Material]:
        """The materials with the directions in which they are brushed."""
        out = list(materials)
        for number, dyads in self.grain.items():
            grain = common_grain(dyads)
            if not grain.fits:
                self.lost.add(
                    "brushing that is neither straight nor around an axis (its mean direction is taken)"
                )
            if not any(grain.axis):
                self.lost.add("brushing of meshes without tangents or texture coordinates")
                out[number] = replace(out[number], anisotropy=0.0)
            else:
                out[number] = replace(out[number], grain=grain.axis, turned=grain.turned)
        return [m if any(m.grain) else replace(m, anisotropy=0.0) for m in out]

    def _colours(self, primitive: dict[str, Any], triangles: IntArray, count: int) -> FloatArray | None:
        """(F, 3) colour of each face from its vertices, where the file gives them one and no texture."""
        attributes, factor = primitive["attributes"], np.ones(3)
        if "COLOR_0" not in attributes or self._textures(primitive):
            return None
        if "material" in primitive:
            pbr = self.document["materials"][primitive["material"]].get("pbrMetallicRoughness", {})
            factor = np.asarray(pbr.get("baseColorFactor", [1, 1, 1, 1])[:3], float)
        vertex = self._read(attributes["COLOR_0"])[:, :3]
        return np.asarray(vertex[np.clip(triangles, 0, count - 1)].mean(axis=1) * factor)

    def _coordinates(self, primitive: dict[str, Any], triangles: IntArray) -> FloatArray | None:
        """(F, 3, 2) texture coordinates of the corners for the material's textures."""
        textures = self._textures(primitive)
        if not textures:
            return None
        change, number = _transform(textures[0])
        if any(_transform(other) != (change, number) for other in textures[1:]):
            self.lost.add("texture coordinates of their own for maps beside the base colour")
        key = f"TEXCOORD_{number}"
        if key not in primitive["attributes"]:
            return None
        uv = self._read(primitive["attributes"][key])[:, :2]
        (su, sv), angle, (ou, ov) = change
        c, s = np.cos(angle), np.sin(angle)
        # KHR_texture_transform: offset x rotation x scale
        turned = np.stack(
            [c * su * uv[:, 0] + s * sv * uv[:, 1], -s * su * uv[:, 0] + c * sv * uv[:, 1]], axis=1
        )
        with np.errstate(invalid="ignore"):
            return np.asarray((turned + np.array((ou, ov)))[np.clip(triangles, 0, len(uv) - 1)])

    def _textures(self, primitive: dict[str, Any]) -> list[dict[str, Any]]:
        """References of the primitive's material to pictures, the base colour first."""
        if "material" not in primitive:
            return []
        m = self.document["materials"][primitive["material"]]
        pbr = m.get("pbrMetallicRoughness", {})
        old = m.get("extensions", {}).get(SPECULAR, {})
        found = (
            pbr.get("baseColorTexture") or old.get("diffuseTexture"),
            pbr.get("metallicRoughnessTexture"),
            m.get("normalTexture"),
        )
        return [f for f in found if f is not None]

    def _material(self, m: dict[str, Any]) -> Material:
        pbr, extensions = m.get("pbrMetallicRoughness", {}), m.get("extensions", {})
        coat = extensions.get(CLEARCOAT, {})
        metallic, roughness = float(pbr.get("metallicFactor", 1.0)), float(pbr.get("roughnessFactor", 1.0))
        base = pbr.get("baseColorFactor", [1, 1, 1, 1])
        if SPECULAR in extensions:
            old = extensions[SPECULAR]
            base, metallic = old.get("diffuseFactor", [1, 1, 1, 1]), 0.0
            roughness = 1.0 - float(old.get("glossinessFactor", 1.0))
        diffuse = pbr.get("baseColorTexture") or extensions.get(SPECULAR, {}).get("diffuseTexture")
        for key, what in (("emissiveTexture", "emission"), ("occlusionTexture", "occlusion maps")):
            if key in m or (what == "emission" and any(m.get("emissiveFactor", ()))):
                self.lost.add(what)
        if any(key.endswith("Texture") for key in (*coat, *extensions.get(ANISOTROPY, {}))):
            self.lost.add("textures of clear coats and of brushing (their factors are taken)")
        if m.get("normalTexture", {}).get("scale", 1) != 1:
            self.lost.add("scales of normal maps (1 is taken)")
        if m.get("alphaMode", "OPAQUE") != "OPAQUE":
            self.lost.add("transparency (drawn opaque)")
        r, g, b = (float(np.clip(c, 0, 1)) for c in base[:3])
        return Material(
            name=str(m.get("name") or ""),
            base_color=(r, g, b),
            metallic=float(np.clip(metallic, 0, 1)),
            roughness=float(np.clip(roughness, 0.03, 1)),
            clearcoat=float(np.clip(coat.get("clearcoatFactor", 0.0), 0, 1)),
            clearcoat_roughness=float(
                np.clip(coat.get("clearcoatRoughnessFactor", Material.clearcoat_roughness), 0, 1)
            ),
            anisotropy=anisotropy_of(m, ANISOTROPY)[0],
            base_color_texture=self._picture(diffuse),
            metallic_roughness_texture=self._picture(pbr.get("metallicRoughnessTexture")),
            normal_texture=self._picture(m.get("normalTexture")),
        )

    def _picture(self, reference: dict[str, Any] | None) -> str:
        """The name under which the picture of a texture is kept; empty when there is none."""
        if reference is None:
            return ""
        record = self.document["textures"][reference["index"]]
        source = record.get("source")
        if source is None:
            source = next((e["source"] for e in record.get("extensions", {}).values() if "source" in e), None)
        if source is None:
            return ""
        if source not in self.pictures:
            image = self.document["images"][source]
            if "bufferView" in image:
                view = self.document["bufferViews"][image["bufferView"]]
                start = view.get("byteOffset", 0)
                raw = self.buffers[view["buffer"]][start : start + view["byteLength"]] if start >= 0 else b""
            else:
                raw = self._file(image["uri"], "texture", LARGEST_PICTURE_BYTES)
            what = str(image.get("name") or image.get("uri", "") or f"image {source}")[:60]
            name = unique_name(what, {p.name for p in self.pictures.values()})
            self.pictures[source] = self.reader.read(name, raw)
        return self.pictures[source].name

    def _buffer(self, record: dict[str, Any], blob: bytes, number: int) -> bytes:
        length = int(record["byteLength"])
        data = self._file(record["uri"], "buffer", LARGEST_FILE_BYTES) if "uri" in record else blob
        if len(data) < length:
            raise UserError(
                f"{self.path}: buffer {number} has {len(data)} of {length} bytes; copy or export it again"
            )
        return data

    def _file(self, uri: str, what: str, most_bytes: int) -> bytes:
        if uri.startswith("data:"):
            try:
                return base64.b64decode(uri.partition(",")[2], validate=True)
            except binascii.Error as error:
                raise UserError(f"{self.path}: an embedded {what} is damaged; export it again") from error
        place = find_beside(self.path, unquote(uri), what)
        try:
            if place not in self.files:  # as many buffers and pictures as are written may name one file
                self.files[place] = read_regular(place, most_bytes)
            return self.files[place]
        except OSError as error:
            raise UserError(
                f"{self.path}: {what} file {unquote(uri)[:80]!r} is missing; put it beside the model, or export as .glb"
            ) from error

    def _read(self, number: int) -> FloatArray:
        return read_accessor(self.document, self.buffers, number)


def _transform(
    reference: dict[str, Any],
) -> tuple[tuple[tuple[float, float], float, tuple[float, float]], int]:
    """Scale, rotation and offset of a texture reference, and the number of its coordinates."""
    change = reference.get("extensions", {}).get("KHR_texture_transform", {})
    (su, sv), (ou, ov) = change.get("scale", (1.0, 1.0)), change.get("offset", (0.0, 0.0))
    number = change.get("texCoord", reference.get("texCoord", 0))
    return ((float(su), float(sv)), float(change.get("rotation", 0.0)), (float(ou), float(ov))), int(number)


def _joined(
    rows: list[FloatArray | None], triangles: list[IntArray], shape: tuple[int, ...]
) -> FloatArray | None:
    """What each face of all primitives has, NaN for those without; None when none has any."""
    if all(r is None for r in rows):
        return None
    blank = (np.full((len(t), *shape), np.nan) for t in triangles)
    return np.concatenate([b if r is None else r for b, r in zip(blank, rows, strict=True)])
