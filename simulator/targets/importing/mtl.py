"""OBJ's material libraries: diffuse colour, shininess and texture as metallic-roughness materials."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from simulator.errors import UserError
from simulator.targets.importing.texture import picture_of
from simulator.targets.model import Material, Picture

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


@dataclass(frozen=True, eq=False)
class ObjMaterial:
    """A material and its base-colour picture, if any; what of it is not read, and what was done to the picture."""

    material: Material
    picture: Picture | None
    lost: tuple[str, ...] = ()
    note: str = ""


def read_mtl(path: Path, libraries: list[str]) -> dict[str, ObjMaterial]:
    """Materials of an OBJ's libraries by name.

    Colours of .mtl files are taken as linear; the Phong exponent Ns becomes a roughness of (2 / (Ns + 2))^(1/4)
    (the width of the lobe; Karis 2013 gives alpha = roughness^2).

    Raises
    ------
    UserError
        If a library or a texture is missing or unreadable.
    """
    found: dict[str, ObjMaterial] = {}
    for library in dict.fromkeys(libraries):
        place = path.parent / library.replace("\\", "/")
        try:
            text = place.read_text("utf-8", "replace")
        except OSError as error:
            raise UserError(
                f"{path}: material file {library!r} is missing; put it beside the model, or remove the line mtllib"
            ) from error
        name, fields = "", dict[str, str]()
        for line in [*text.splitlines(), "newmtl"]:
            word, _, rest = line.strip().partition(" ")
            if word.lower() == "newmtl":
                if name:
                    found[name] = _material(place, name, fields)
                name, fields = rest.strip(), {}
            elif word:
                fields[word.lower()] = rest.strip()
    return found


def _material(place: Path, name: str, fields: dict[str, str]) -> ObjMaterial:
    try:
        kd = [float(x) for x in fields.get("kd", "0.6 0.6 0.6").split()[:3]]
        exponent = float(fields.get("ns", "10").split()[0])
        metallic = float(fields.get("pm", "0").split()[0])
        roughness = float(fields["pr"].split()[0]) if "pr" in fields else (2 / (max(exponent, 0) + 2)) ** 0.25
        r, g, b = (float(np.clip(c, 0, 1)) for c in kd)
    except (ValueError, IndexError) as error:
        raise UserError(f"{place}: material {name!r} has a value that is no number; correct it") from error
    found, note = None, ""
    if "map_kd" in fields:
        # options such as -s 1 1 1 stand before the name, which may itself hold spaces
        file = fields["map_kd"].replace("\\", "/")
        picture = next(
            (p for p in (place.parent / file, place.parent / file.split()[-1]) if p.is_file()), None
        )
        if picture is None:
            raise UserError(
                f"{place}: texture {file!r} of material {name!r} is missing; put it there, or remove the line map_Kd"
            )
        found, note = picture_of(picture.relative_to(place.parent).as_posix(), picture.read_bytes())
        if found is None:
            raise UserError(f"{picture} is not a picture that can be read; convert it to PNG")
    surface = Material(
        name=name,
        base_color=(r, g, b),
        metallic=float(np.clip(metallic, 0, 1)),
        roughness=float(np.clip(roughness, 0.05, 1)),
        base_color_texture="" if found is None else found.name,
    )
    lost = tuple(sorted(k for k in fields if k in OTHER_MAPS))
    return ObjMaterial(surface, found, lost, note)
