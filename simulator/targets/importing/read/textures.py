"""Textures of imported meshes: kept, or baked to a few plain colours if faces lose their texture coordinates."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.targets.importing.read.named_files import NotReadError, read_named
from flyaround.simulator.targets.importing.read.raw_model import unique_names
from flyaround.simulator.targets.model import Material, TextureImage
from flyaround.simulator.targets.textures import check_picture, mime_type, picture_size

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import ByteArray, FloatArray, IntArray
    from flyaround.simulator.targets.importing.read.raw_model import RawModel

MAX_TEXTURE_SIDE_PX = 4096
"""Side beyond which an image is reduced."""
MAX_PIXELS_OF_ALL = 512 << 20
"""Largest total size of a model's images: 32 of 4096 on a side."""
MAX_PICTURE_BYTES, MAX_BYTES_OF_ALL = 256 << 20, 512 << 20
"""Largest size of an image file, and of all of them: the files are held in memory, and copied into the target."""
MAX_PICTURES = 1000
"""Largest number of images, for files that name very many tiny ones."""
NOT_READ = {
    b"\xabKTX": "a KTX texture (KHR_texture_basisu), which is not supported",
    b"DDS ": "a DDS texture, which is not supported",
    b"ftypavi": "an AVIF picture, which is not supported",
    b"8BPS": "a Photoshop file, which is not supported",
    b"<svg": "an SVG drawing, which is not supported",
}
"""Signatures of image formats that are not supported."""
MAX_COLOURS = 6
"""Largest number of plain colours that replace a material's texture; each becomes a material."""
COLOUR_TOLERANCE = 0.04
"""RMS distance in linear RGB within which faces have the same colour."""
# barycentric weights (not normalised) of the sampled points of a triangle
BARYCENTRIC = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]], float)


def decode_image(data: bytes) -> ByteArray | None:
    """Decode an (H, W, 3) sRGB image; None if OpenCV cannot read it."""
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error:
        return None
    return None if image is None else np.ascontiguousarray(image[..., ::-1])


def linear_from_srgb(value: FloatArray) -> FloatArray:
    """Convert sRGB to linear light, both 0..1 (IEC 61966-2-1)."""
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


@dataclass(eq=False)
class PictureReader:
    """Reader of one model's textures: PNG or JPEG files, not too large, each read once.

    Parameters
    ----------
    model : Path
        Path of the model.
    notes : list of str
        Changes made to the images.
    missing : dict
        Unreadable textures by name, with the reason; their materials keep their factor colour.
    count : int
        Number of images so far.
    pixels : int
        Number of their pixels.
    n_bytes : int
        Number of their bytes.
    """

    model: Path
    notes: list[str] = field(default_factory=list)
    missing: dict[str, str] = field(default_factory=dict)
    count: int = 0
    pixels: int = 0
    n_bytes: int = 0
    _read: dict[Path, TextureImage] = field(default_factory=dict)

    @property
    def faults(self) -> list[str]:
        """One sentence about the textures that were not read, if any."""
        if not self.missing:
            return []
        (_, why), *other_textures = self.missing.items()
        other_names = ", ".join(repr(n) for n, _ in other_textures[:5]) + ", ..." * (len(other_textures) > 5)
        others = f" (and {len(other_textures)} more: {other_names})" if other_textures else ""
        return [f"{why}{others}: drawn in the factor colour of the material"]

    def from_file(self, owner: Path, name: str, material: str) -> TextureImage | None:
        """Read the texture that ``owner`` names; None if it is unreadable, which `faults` then reports.

        Raises
        ------
        UserError
            If the textures are too large.
        """
        try:
            path, data = read_named(self.model, owner, name, "texture", MAX_PICTURE_BYTES)
        except NotReadError as error:
            self.missing[name] = str(error).replace(
                f"texture file {name[:80]!r}", f"texture {name[:80]!r} of material {material[:80]!r}"
            )
            return None
        if path not in self._read:
            picture = self.from_bytes(path.relative_to(self.model.parent).as_posix(), data)
            if picture is None:
                return None
            self._read[path] = picture
        return self._read[path]

    def from_bytes(self, name: str, data: bytes) -> TextureImage | None:
        """Return an image as a texture; None if it is unreadable, which `faults` then reports.

        Raises
        ------
        UserError
            If this image, or all together, have too many pixels; checked before decoding.
        """
        source = f"{self.model}: texture {name[:80]!r}"
        description = next((what for magic, what in NOT_READ.items() if magic in data[:16]), "")
        if description or picture_size(data) is None:
            self.missing[name] = _unreadable(name, description)
            return None
        check_picture(data, source)
        width, height = picture_size(data) or (0, 0)
        self.count += 1
        self.pixels += width * height
        self.n_bytes += len(data)
        if self.pixels > MAX_PIXELS_OF_ALL or self.n_bytes > MAX_BYTES_OF_ALL or self.count > MAX_PICTURES:
            raise UserError(
                f"{self.model}: its textures are more than {MAX_PICTURES}, or have together more than "
                f"{MAX_PIXELS_OF_ALL >> 20} million pixels or {MAX_BYTES_OF_ALL >> 20} MiB; make them fewer or smaller"
            )
        image = decode_image(data)
        if image is None:
            self.missing[name] = _unreadable(name)
            return None
        if max(image.shape[:2]) > MAX_TEXTURE_SIDE_PX:
            original_size = f"{image.shape[1]} x {image.shape[0]}"
            factor = MAX_TEXTURE_SIDE_PX / max(image.shape[:2])
            size = (max(1, round(image.shape[1] * factor)), max(1, round(image.shape[0] * factor)))
            image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
            self.notes.append(f"texture {name!r} reduced from {original_size} to {size[0]} x {size[1]}")
        elif mime_type(data):
            return TextureImage(name=name, data=data)
        encoded = cv2.imencode(".png", image[..., ::-1])[1]
        return TextureImage(name=name, data=np.asarray(encoded).tobytes())


def _unreadable(name: str, kind: str = "") -> str:
    return f"texture {name[:80]!r} is {kind or 'not a picture that can be read'}; convert it to PNG"


def face_colours(image: ByteArray, corner_uv: FloatArray) -> FloatArray:
    """Return the (F, 3) linear colour of each face: the mean of four texture samples.

    Parameters
    ----------
    image : (H, W, 3) uint8 array
        Texture, sRGB.
    corner_uv : (F, 3, 2) array
        Texture coordinates, origin at the image's top left as in glTF; they repeat outside 0..1.
    """
    height, width = image.shape[:2]
    weights = BARYCENTRIC / BARYCENTRIC.sum(axis=1, keepdims=True)
    samples = np.einsum("sk,fkc->fsc", weights, np.nan_to_num(corner_uv)) % 1.0
    x = np.minimum((samples[..., 0] * width).astype(int), width - 1)
    y = np.minimum((samples[..., 1] * height).astype(int), height - 1)
    return np.asarray(linear_from_srgb(image[y, x] / 255.0).mean(axis=1))


def bake_textures(model: RawModel) -> None:
    """Bake base-colour textures to face colours, for meshes whose faces will change."""
    for part in model.parts:
        if part.corner_uv is None:
            continue
        colour = part.face_colour
        if colour is None:
            colour = np.full((len(part.triangles), 3), np.nan)
        for number in np.unique(part.face_material):
            material = model.materials[int(number)]
            faces = np.flatnonzero(
                (part.face_material == number) & ~np.isnan(part.corner_uv).any(axis=(1, 2))
            )
            if material.base_color_texture and len(faces):
                image = decode_image(model.pictures[material.base_color_texture].data)
                if image is not None:
                    colour[faces] = face_colours(image, part.corner_uv[faces]) * material.base_color
        part.face_colour, part.corner_uv = (None if np.isnan(colour).all() else colour), None
    model.materials = [without_textures(m) for m in model.materials]
    bake_colours(model)


def without_textures(material: Material) -> Material:
    """Return the material with its factors only."""
    return replace(material, base_color_texture="", metallic_roughness_texture="", normal_texture="")


def mean_colour(picture: TextureImage) -> FloatArray:
    """Return the (3,) mean linear colour of a texture."""
    image = decode_image(picture.data)
    if image is None:
        return np.ones(3)
    return np.asarray(linear_from_srgb(image / 255.0).mean(axis=(0, 1)))


def bake_colours(model: RawModel) -> None:
    """Replace face colours by a few materials for each of the file's."""
    coloured = [p for p in model.parts if p.face_colour is not None]
    if not coloured:
        return
    n_original = len(model.materials)
    for number in range(n_original):
        picks = [(p, np.flatnonzero((p.face_material == number) & ~np.isnan(p.face_colour[:, 0])))
                 for p in coloured if p.face_colour is not None]  # fmt: skip
        picks = [(p, f) for p, f in picks if len(f)]
        if not picks:
            continue
        colours = np.concatenate([p.face_colour[f] for p, f in picks if p.face_colour is not None])
        centres, label = group_colours(colours)
        base = model.materials[number]
        first = len(model.materials)
        for k, centre in enumerate(centres):
            rgb = vec3(np.clip(centre, 0.0, 1.0))
            model.materials.append(replace(base, name=f"{base.name}-{k + 1}", base_color=rgb))
        start = 0
        for p, f in picks:
            p.face_material[f] = first + label[start : start + len(f)]
            start += len(f)
        model.notes.append(
            f"material {base.name!r}: its texture or its vertices' colours became {len(centres)} plain "
            f"colour{'s' * (len(centres) > 1)}; detail finer than a face is lost"
        )
    names = unique_names((m.name for m in model.materials), "material")
    model.materials = [replace(m, name=n) for m, n in zip(model.materials, names, strict=True)]


def group_colours(colours: FloatArray) -> tuple[FloatArray, IntArray]:
    """Cluster colours within `COLOUR_TOLERANCE`, in at most `MAX_COLOURS` clusters.

    Parameters
    ----------
    colours : (F, 3) array
        Linear RGB.

    Returns
    -------
    tuple of array
        Centres (K, 3) and cluster index of each colour (F,).
    """
    distinct, inverse = np.unique(np.round(colours, 3), axis=0, return_inverse=True)
    if len(distinct) == 1:
        return distinct, inverse.ravel()
    sample = colours if len(colours) <= 20_000 else colours[:: len(colours) // 20_000 + 1]
    centres, label = sample, np.zeros(len(colours), np.int64)
    for k in range(1, MAX_COLOURS + 1):
        centres = _lloyd(sample, _spread(sample, k))
        label = np.argmin(((colours[:, None] - centres) ** 2).sum(axis=2), axis=1)
        if float(np.sqrt(((colours - centres[label]) ** 2).sum(axis=1).mean())) <= COLOUR_TOLERANCE:
            break
    clusters, label = np.unique(label, return_inverse=True)
    return centres[clusters], label.ravel()


def _lloyd(points: FloatArray, centres: FloatArray) -> FloatArray:
    """Run ten Lloyd iterations: move each centre to the mean of its nearest points."""
    for _ in range(10):
        label = np.argmin(((points[:, None] - centres) ** 2).sum(axis=2), axis=1)
        centres_now = [points[label == k].mean(axis=0) for k in range(len(centres)) if (label == k).any()]
        centres = np.array(centres_now)
    return centres


def _spread(points: FloatArray, k: int) -> FloatArray:
    """Select k points, each far from those before, as a deterministic start."""
    indices = [int(np.argmax(((points - points.mean(axis=0)) ** 2).sum(axis=1)))]
    distance = ((points - points[indices[0]]) ** 2).sum(axis=1)
    for _ in range(k - 1):
        indices.append(int(np.argmax(distance)))
        distance = np.minimum(distance, ((points - points[indices[-1]]) ** 2).sum(axis=1))
    return points[indices]
