"""Textures of a target on the GPU, with mipmaps, and plain texels for materials without."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import moderngl
import numpy as np

from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import ByteArray
    from flyaround.simulator.targets.model import Material, Target

GL_SRGB8 = 0x8C41
LARGEST_PX = 8192
"""Larger images are halved until they fit: every OpenGL 4.1 takes 16384, but 8192 squared are 256 MB."""
PLAIN = {"color": (255, 255, 255), "data": (255, 255, 255), "normal": (128, 128, 255)}


class Textures:
    """The images of one target as textures, by name and use.

    Raises
    ------
    UserError
        If an image cannot be decoded.
    """

    def __init__(self, context: moderngl.Context, target: Target) -> None:
        self._context = context
        self._plain = {kind: self._texture(np.array([[rgb]], np.uint8), kind) for kind, rgb in PLAIN.items()}
        self._made: dict[tuple[str, str], moderngl.Texture] = {}
        pictures = {p.name: p.data for p in target.pictures}
        for material in target.materials:
            for name, kind in zip(material.textures, PLAIN, strict=True):
                if name and (name, kind) not in self._made:
                    self._made[name, kind] = self._texture(_decoded(target, name, pictures[name]), kind)

    def of(self, material: Material | None) -> tuple[moderngl.Texture, moderngl.Texture, moderngl.Texture]:
        """Return base colour, metalness and roughness, and normals of a material, or one plain texel."""
        names = ("", "", "") if material is None else material.textures
        color, data, normal = (
            self._made[name, kind] if name else self._plain[kind]
            for name, kind in zip(names, PLAIN, strict=True)
        )
        return color, data, normal

    def _texture(self, image: ByteArray, kind: str) -> moderngl.Texture:
        height, width = image.shape[:2]
        if kind == "color":  # decoded from sRGB before filtering
            texture = self._context.texture((width, height), 3, image.tobytes(), internal_format=GL_SRGB8)
        else:
            texture = self._context.texture((width, height), 3, image.tobytes())
        texture.repeat_x = texture.repeat_y = True
        texture.build_mipmaps()
        texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        return texture

    def release(self) -> None:
        """Free the textures."""
        for texture in (*self._plain.values(), *self._made.values()):
            texture.release()


def _decoded(target: Target, name: str, data: bytes) -> ByteArray:
    """Decode an image to (H, W, 3) RGB, rows from the top."""
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    if image is None:
        raise UserError(
            f"texture {name!r} of target {target.name} is damaged; export the model again with a PNG picture"
        )
    while max(image.shape[:2]) > LARGEST_PX:
        image = cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    return np.ascontiguousarray(image[..., ::-1], np.uint8)
