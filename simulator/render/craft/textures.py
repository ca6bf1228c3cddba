"""Textures of a target on the GPU, with mipmaps; a material without textures uses single neutral texels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import moderngl
import numpy as np

from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import ByteArray
    from flyaround.simulator.targets.model import Material, Target

GL_SRGB8 = 0x8C41  # constant of OpenGL
MAX_TEXTURE_PX = 8192
"""Larger images are halved until they fit. OpenGL 4.1 guarantees 16384, but 8192 x 8192 texels take 268 MB."""
NEUTRAL_TEXELS = {"color": (255, 255, 255), "data": (255, 255, 255), "normal": (128, 128, 255)}


class Textures:
    """The images of one target as textures, by name and use.

    Raises
    ------
    UserError
        If an image cannot be decoded.
    """

    def __init__(self, context: moderngl.Context, target: Target) -> None:
        self._context = context
        self._neutral = {
            kind: self._texture(np.array([[rgb]], np.uint8), kind) for kind, rgb in NEUTRAL_TEXELS.items()
        }
        self._textures: dict[tuple[str, str], moderngl.Texture] = {}
        pictures = {p.name: p.data for p in target.pictures}
        for material in target.materials:
            for name, kind in zip(material.textures, NEUTRAL_TEXELS, strict=True):
                if name and (name, kind) not in self._textures:
                    self._textures[name, kind] = self._texture(_decode(target, name, pictures[name]), kind)

    def for_material(
        self, material: Material | None
    ) -> tuple[moderngl.Texture, moderngl.Texture, moderngl.Texture]:
        """Return a material's textures: base colour; metalness and roughness; normals.

        A texture that the material lacks is a single neutral texel.
        """
        names = ("", "", "") if material is None else material.textures
        color, data, normal = (
            self._textures[name, kind] if name else self._neutral[kind]
            for name, kind in zip(names, NEUTRAL_TEXELS, strict=True)
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
        for texture in (*self._neutral.values(), *self._textures.values()):
            texture.release()


def _decode(target: Target, name: str, data: bytes) -> ByteArray:
    """Decode an image to (H, W, 3) RGB, rows from the top."""
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    if image is None:
        raise UserError(
            f"texture {name!r} of target {target.name} is damaged; export the model again with a PNG picture"
        )
    while max(image.shape[:2]) > MAX_TEXTURE_PX:
        image = cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    return np.ascontiguousarray(image[..., ::-1], np.uint8)
