"""OBJ's material libraries: diffuse colour, shininess and texture as metallic-roughness materials."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from simulator.errors import UserError
from simulator.runtime.untrusted_files import find_beside, read_regular
from simulator.targets.importing.read.textures import LARGEST_PICTURE_BYTES, PictureReader
from simulator.targets.model import Material, TextureImage

if TYPE_CHECKING:
    from pathlib import Path


OTHER_MAPS = (
    "map_ka",
    "map_ks",
    "map_ns",
    "map_d",
    "map_bump",
    "bump",
    "norm",
    "disp",
    "map_pr",
    "map_pm",
    "map_ke",
)


LARGEST_LIBRARY_BYTES = 16 << 20
MOST_LIBRARIES = 100


@dataclass(frozen=True, eq=False)
class ObjMaterial:
    """A material and its base-colour picture, if any; and what of it is not read."""

    material: Material
    picture: TextureImage | None
    lost: tuple[str, ...] = ()


class MaterialLibraries:
    """The materials of an OBJ's libraries by name; pictures are read for those that are asked for.

    Colours of .mtl files are taken as linear; the Phong exponent Ns becomes a roughness of (2 / (Ns + 2))^(1/4)
    (the width of the lobe; Karis 2013 gives alpha = roughness^2).

    Parameters
    ----------
    path : the model. libraries : the .mtl files that it names.

    Raises
    ------
    UserError
        If a library is missing, unreadable, or not within the model's folder.
    """

    def __init__(self, path: Path, libraries: list[str]) -> None:
        self._pictures: dict[Path, TextureImage] = {}
        self._reader = PictureReader(path)
        self._fields: dict[str, tuple[Path, dict[str, str]]] = {}
        names = list(dict.fromkeys(libraries))
        if len(names) > MOST_LIBRARIES:
            raise UserError(f"{path} names {len(names):,} material files; export it with one")
        for library in names:
            self._read(path, library)

    @property
    def notes(self) -> list[str]:
        """What was done to the pictures, a line each."""
        return self._reader.notes

    def __contains__(self, name: str) -> bool:
        return name in self._fields

    def __len__(self) -> int:
        return len(self._fields)

    def __getitem__(self, name: str) -> ObjMaterial:
        place, fields = self._fields[name]
        return self._material(place, name, fields)

    def _read(self, path: Path, library: str) -> None:
        place = find_beside(path, library, "material")
        try:
            text = read_regular(place, LARGEST_LIBRARY_BYTES).decode("utf-8", "replace")
        except OSError as error:
            raise UserError(
                f"{path}: material file {library[:80]!r} is missing; put it beside the model, or remove the line mtllib"
            ) from error
        name, fields = "", dict[str, str]()
        for line in [*text.splitlines(), "newmtl"]:
            word, _, rest = line.strip().partition(" ")
            if word.lower() == "newmtl":
                if name:
                    self._fields[name] = (place, fields)
                name, fields = rest.strip(), {}
            elif word:
                fields[word.lower()] = rest.strip()

    def _material(self, place: Path, name: str, fields: dict[str, str]) -> ObjMaterial:
        try:
            r, g, b = np.clip([float(x) for x in fields.get("kd", "0.6 0.6 0.6").split()[:3]], 0, 1).tolist()
            exponent = float(fields.get("ns", "10").split()[0])
            metallic = float(fields.get("pm", "0").split()[0])
            roughness = (
                float(fields["pr"].split()[0]) if "pr" in fields else (2 / (max(exponent, 0) + 2)) ** 0.25
            )
            if not np.isfinite([r, g, b, metallic, roughness]).all():
                raise ValueError("not finite")
        except (ValueError, IndexError) as error:
            raise UserError(
                f"{place}: material {name[:80]!r} has a value that is no number; correct it"
            ) from error
        found = self._picture(place, name, fields["map_kd"]) if fields.get("map_kd") else None
        surface = Material(
            name=name,
            base_color=(r, g, b),
            metallic=float(np.clip(metallic, 0, 1)),
            roughness=float(np.clip(roughness, 0.05, 1)),
            base_color_texture="" if found is None else found.name,
        )
        return ObjMaterial(surface, found, tuple(sorted(k for k in fields if k in OTHER_MAPS)))

    def _picture(self, place: Path, material: str, text: str) -> TextureImage:
        """The picture of a line map_Kd: options such as -s 1 1 1 stand before the name, which may hold spaces."""
        file = text.replace("\\", "/")
        for name in (file, file.split()[-1]):
            picture = find_beside(place, name, "texture")
            if picture in self._pictures:
                return self._pictures[picture]
            try:
                data = read_regular(picture, LARGEST_PICTURE_BYTES)
            except OSError:
                continue
            kept = self._reader.read(picture.relative_to(place.parent).as_posix(), data)
            self._pictures[picture] = kept
            return kept
        raise UserError(
            f"{place}: texture {file[:80]!r} of material {material[:80]!r} is missing; put it there, or remove the "
            "line map_Kd"
        )
