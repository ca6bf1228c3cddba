"""Target files written: a Target as binary glTF 2.0, which `glb` reads back to the same bits.

One node and one mesh per part; a root node turns the model's z axis to glTF's y for viewers. Apart from the reading,
because pygltflib takes long to import and a picture needs none of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
import pygltflib as gl

from simulator.files import write_atomic
from simulator.targets.convert import record_of
from simulator.targets.glb import ANISOTROPY, CLEARCOAT
from simulator.targets.glb_pictures import mime_of

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from simulator.targets.model import Material, Part, Picture, Target

Y_UP_FROM_Z_UP_XYZW = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]


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
    _append_pictures(document, blob, target.pictures)
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
    _add_textures(written, m, pictures)
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


def _append_pictures(document: gl.GLTF2, blob: bytearray, pictures: tuple[Picture, ...]) -> None:
    """Embed the pictures after the vertex data, as one texture each, in order."""
    if not pictures:
        return
    document.samplers = [
        gl.Sampler(magFilter=gl.LINEAR, minFilter=gl.LINEAR_MIPMAP_LINEAR, wrapS=gl.REPEAT, wrapT=gl.REPEAT)
    ]
    for k, picture in enumerate(pictures):
        document.bufferViews.append(
            gl.BufferView(buffer=0, byteOffset=len(blob), byteLength=len(picture.data))
        )
        document.images.append(
            gl.Image(
                name=picture.name,
                mimeType=mime_of(picture.data),
                bufferView=len(document.bufferViews) - 1,
            )
        )
        document.textures.append(gl.Texture(sampler=0, source=k))
        blob += picture.data + b"\0" * (-len(picture.data) % 4)


def _add_textures(written: gl.Material, m: Material, pictures: tuple[Picture, ...]) -> None:
    """Let a glTF material refer to the pictures that ``m`` names."""
    number = {p.name: k for k, p in enumerate(pictures)}
    if m.base_color_texture:
        written.pbrMetallicRoughness.baseColorTexture = gl.TextureInfo(index=number[m.base_color_texture])
    if m.metallic_roughness_texture:
        written.pbrMetallicRoughness.metallicRoughnessTexture = gl.TextureInfo(
            index=number[m.metallic_roughness_texture]
        )
    if m.normal_texture:
        written.normalTexture = gl.NormalMaterialTexture(index=number[m.normal_texture])
