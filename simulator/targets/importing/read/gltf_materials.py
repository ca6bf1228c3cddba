"""glTF materials: metallic-roughness factors, textures and their coordinates; also the older specular-glossiness."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

import numpy as np

from flyaround.simulator.runtime.arrays import Vec3, vec3
from flyaround.simulator.targets.glb.read import ANISOTROPY, CLEARCOAT
from flyaround.simulator.targets.importing.read.brushed import read_anisotropy
from flyaround.simulator.targets.importing.read.gltf_extensions import SPECULAR_GLOSSINESS, TEXTURE_TRANSFORM
from flyaround.simulator.targets.importing.read.raw_model import unique_name
from flyaround.simulator.targets.model import Material, TextureImage

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.targets.importing.read.textures import PictureReader

REPEAT = 10497  # wrap mode and default of glTF 2.0, section 5.26
DIELECTRIC = 0.04
"""Reflectance of a dielectric at normal incidence (glTF 2.0, appendix B)."""
Change = tuple[tuple[float, float], float, tuple[float, float]]
"""Scale, rotation and offset of texture coordinates."""


class GltfMaterials:
    """The materials of a document.

    Parameters
    ----------
    document : dict
        Parsed JSON.
    reader : PictureReader
        Reader of images.
    image_bytes : callable
        Function that returns the bytes of an embedded image; None for a separate file.
    lost : set of str
        Set to which properties are added that are not carried over.
    """

    def __init__(
        self,
        document: dict[str, Any],
        reader: PictureReader,
        image_bytes: Callable[[dict[str, Any]], bytes | None],
        lost: set[str],
    ) -> None:
        self._document, self._reader, self._bytes, self._lost = document, reader, image_bytes, lost
        self._pictures: dict[int, TextureImage | None] = {}

    @property
    def pictures(self) -> dict[str, TextureImage]:
        """The textures read, by name."""
        return {p.name: p for p in self._pictures.values() if p is not None}

    def all(self) -> list[Material]:
        """Return the document's materials in their order."""
        return [self._material(m) for m in self._document.get("materials", [])]

    def textures(self, primitive: dict[str, Any]) -> list[dict[str, Any]]:
        """Return the readable texture references of a primitive's material, base colour first."""
        if "material" not in primitive:
            return []
        m = self._document["materials"][primitive["material"]]
        pbr = m.get("pbrMetallicRoughness", {})
        references = (_base_texture(m), pbr.get("metallicRoughnessTexture"), m.get("normalTexture"))
        return [f for f in references if f is not None and self._picture(f, "")]

    def check_wrapping(self, reference: dict[str, Any], uv: FloatArray) -> None:
        """Report a texture that clamps or mirrors at coordinates outside 0..1, because ours repeat."""
        record = self._document["textures"][reference["index"]]
        samplers = self._document.get("samplers", [])
        sampler = samplers[record["sampler"]] if "sampler" in record else {}
        wraps = (sampler.get("wrapS", REPEAT), sampler.get("wrapT", REPEAT))
        # a thousandth beyond 0..1 is rounding
        is_outside = [
            bool(((axis < -1e-3) | (axis > 1.001)).any()) for axis in np.nan_to_num(uv).reshape(-1, 2).T
        ]
        if any(wrap != REPEAT and out for wrap, out in zip(wraps, is_outside, strict=True)):
            self._lost.add("textures that clamp or mirror at their edges (they repeat)")

    def _material(self, m: dict[str, Any]) -> Material:
        pbr, extensions = m.get("pbrMetallicRoughness", {}), m.get("extensions", {})
        coat = extensions.get(CLEARCOAT, {})
        metallic, roughness = float(pbr.get("metallicFactor", 1.0)), float(pbr.get("roughnessFactor", 1.0))
        base = np.asarray(pbr.get("baseColorFactor", [1, 1, 1, 1])[:3], float)
        name = str(m.get("name") or "")
        if SPECULAR_GLOSSINESS in extensions:
            colour, metallic, roughness = self._from_specular(extensions[SPECULAR_GLOSSINESS])
            base = np.asarray(colour)
        self._report(m, coat)
        r, g, b = np.clip(base, 0, 1).tolist()
        return Material(
            name=name,
            base_color=(r, g, b),
            metallic=float(np.clip(metallic, 0, 1)),
            roughness=float(np.clip(roughness, 0.03, 1)),
            clearcoat=float(np.clip(coat.get("clearcoatFactor", 0.0), 0, 1)),
            clearcoat_roughness=float(
                np.clip(coat.get("clearcoatRoughnessFactor", Material.clearcoat_roughness), 0, 1)
            ),
            anisotropy=read_anisotropy(m, ANISOTROPY)[0],
            base_color_texture=self._picture(_base_texture(m), name),
            metallic_roughness_texture=self._picture(pbr.get("metallicRoughnessTexture"), name),
            normal_texture=self._picture(m.get("normalTexture"), name),
        )

    def _report(self, m: dict[str, Any], coat: dict[str, Any]) -> None:
        """Note the properties of a material that are not carried over."""
        for key, what in (("emissiveTexture", "emission"), ("occlusionTexture", "occlusion maps")):
            if key in m or (what == "emission" and any(m.get("emissiveFactor", ()))):
                self._lost.add(what)
        if any(key.endswith("Texture") for key in (*coat, *m.get("extensions", {}).get(ANISOTROPY, {}))):
            self._lost.add("textures of clear coats and of brushing (their factors are taken)")
        if m.get("normalTexture", {}).get("scale", 1) != 1:
            self._lost.add("scales of normal maps (1 is taken)")
        if m.get("alphaMode", "OPAQUE") != "OPAQUE":
            self._lost.add("transparency (drawn opaque)")

    def _from_specular(self, extension: dict[str, Any]) -> tuple[Vec3, float, float]:
        """Convert a specular-glossiness material to base colour, metalness and roughness.

        The metalness m solves, with brightnesses of both colours, diffuse = base (1 - 0.04) (1 - m) / (1 - specular)
        and specular = 0.04 (1 - m) + base m.

        References
        ----------
        Khronos Group (2017), KHR_materials_pbrSpecularGlossiness, appendix.
        """
        if "specularGlossinessTexture" in extension:
            self._lost.add("maps of specular colour and glossiness (their factors are taken)")
        diffuse = np.asarray(extension.get("diffuseFactor", [1, 1, 1, 1])[:3], float)
        specular = np.asarray(extension.get("specularFactor", [1, 1, 1])[:3], float)
        roughness = 1.0 - float(extension.get("glossinessFactor", 1.0))
        if (
            _base_texture({"extensions": {SPECULAR_GLOSSINESS: extension}})
            or "specularGlossinessTexture" in extension
        ):
            return vec3(diffuse), 0.0, roughness  # the factors alone do not identify a metal
        d, s, strength = _brightness(diffuse), _brightness(specular), float(specular.max())
        metallic = 0.0
        if s >= DIELECTRIC:
            b = d * (1 - strength) / (1 - DIELECTRIC) + s - 2 * DIELECTRIC
            root = np.sqrt(max(b * b - 4 * DIELECTRIC * (DIELECTRIC - s), 0.0))
            metallic = float(np.clip((root - b) / (2 * DIELECTRIC), 0, 1))
        dielectric_color = diffuse * ((1 - strength) / (1 - DIELECTRIC) / max(1 - metallic, 1e-6))
        metal_color = (specular - DIELECTRIC * (1 - metallic)) / max(metallic, 1e-6)
        return (
            vec3(np.clip(dielectric_color + (metal_color - dielectric_color) * metallic**2, 0, 1)),
            metallic,
            roughness,
        )

    def _picture(self, reference: dict[str, Any] | None, material: str) -> str:
        """Return the name of a texture's image; empty if there is none."""
        if reference is None:
            return ""
        number = int(reference["index"])
        record = self._document["textures"][number]
        source = record.get("source")
        if source is None:
            source = next((e["source"] for e in record.get("extensions", {}).values() if "source" in e), None)
        if source is None:
            self._reader.missing[f"texture {number}"] = f"texture {number} names no image"
            return ""
        if source not in self._pictures:
            image = self._document["images"][source]
            names = set(self.pictures)
            raw = self._bytes(image)
            what = str(image.get("name") or image.get("uri", "") or f"image {source}")[:60]
            if raw is not None:
                picture = self._reader.from_bytes(unique_name(what, names), raw)
            else:
                picture = self._reader.from_file(self._reader.model, unquote(str(image["uri"])), material)
            self._pictures[source] = picture
        picture = self._pictures[source]
        return picture.name if picture is not None else ""


def transform(reference: dict[str, Any]) -> tuple[Change, int]:
    """Return the coordinate transform of a texture reference, and the index of its coordinate set."""
    change = reference.get("extensions", {}).get(TEXTURE_TRANSFORM, {})
    (su, sv), (ou, ov) = change.get("scale", (1.0, 1.0)), change.get("offset", (0.0, 0.0))
    number = change.get("texCoord", reference.get("texCoord", 0))
    return ((float(su), float(sv)), float(change.get("rotation", 0.0)), (float(ou), float(ov))), int(number)


def transform_uv(uv: FloatArray, change: Change) -> FloatArray:
    """Return texture coordinates (N, 2) after KHR_texture_transform: offset x rotation x scale."""
    (su, sv), angle, (ou, ov) = change
    c, s = np.cos(angle), np.sin(angle)
    u, v = su * uv[:, 0], sv * uv[:, 1]
    return np.stack([c * u + s * v + ou, c * v - s * u + ov], axis=1)


def _base_texture(m: dict[str, Any]) -> dict[str, Any] | None:
    old = m.get("extensions", {}).get(SPECULAR_GLOSSINESS)
    reference: dict[str, Any] | None = (
        old.get("diffuseTexture")
        if old is not None
        else m.get("pbrMetallicRoughness", {}).get("baseColorTexture")
    )
    return reference


def _brightness(rgb: FloatArray) -> float:
    """Return the perceived brightness of a colour, as in the extension's appendix."""
    return float(np.sqrt(0.299 * rgb[0] ** 2 + 0.587 * rgb[1] ** 2 + 0.114 * rgb[2] ** 2))
