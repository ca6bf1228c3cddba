"""Textures in a target file: pictures embedded in the buffer, and the references of materials to them."""

from __future__ import annotations

from typing import Any

from simulator.targets.model import Picture

MIME = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg"}


def mime_of(data: bytes) -> str:
    """The type of a picture's bytes, by their first ones; empty for what glTF 2.0 does not hold."""
    return next((mime for magic, mime in MIME.items() if data.startswith(magic)), "")


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
