"""Textures in a target file: pictures embedded in the buffer, and the references of materials to them."""

from __future__ import annotations

from typing import Any

import pygltflib as gl

from simulator.targets.model import Material, Picture

MIME = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg"}


def mime_of(data: bytes) -> str:
    """The type of a picture's bytes, by their first ones; empty for what glTF 2.0 does not hold."""
    return next((mime for magic, mime in MIME.items() if data.startswith(magic)), "")


def append_pictures(document: gl.GLTF2, blob: bytearray, pictures: tuple[Picture, ...]) -> None:
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


def add_textures(written: gl.Material, m: Material, pictures: tuple[Picture, ...]) -> None:
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


def pictures_of(document: dict[str, Any], blob: bytes) -> tuple[Picture, ...]:
    """The embedded pictures of a document."""
    out = []
    for k, image in enumerate(document.get("images") or []):
        view = document["bufferViews"][image["bufferView"]]
        start = view.get("byteOffset", 0)
        data = blob[start : start + view["byteLength"]]
        if len(data) < view["byteLength"]:
            raise ValueError("a picture runs past the end of its buffer")
        out.append(Picture(name=str(image.get("name") or f"picture-{k + 1}"), data=data))
    return tuple(out)


def texture_name(document: dict[str, Any], info: dict[str, Any] | None, pictures: tuple[Picture, ...]) -> str:
    """The name of the picture that a texture reference means; empty when there is none."""
    if info is None:
        return ""
    return pictures[document["textures"][info["index"]]["source"]].name
