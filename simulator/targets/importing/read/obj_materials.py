"""OBJ's material libraries: diffuse colour, shininess and texture as metallic-roughness materials."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.importing.read.named_files import (
    NotReadError,
    read_named,
    split_word,
    text_lines,
    unquoted,
)
from flyaround.simulator.targets.importing.read.textures import PictureReader
from flyaround.simulator.targets.model import Material, TextureImage

if TYPE_CHECKING:
    from pathlib import Path


MAX_LIBRARY_BYTES = 16 << 20
MAX_LIBRARIES = 100
"""Largest size of a material library [bytes] and largest number of them; they bound time and memory."""
MAX_OPTIONS = 64
"""Largest number of option words before a texture's name."""
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?", re.IGNORECASE)
_LIBRARY_NAME = re.compile(r"\S.*?\.mtl[\"']?(?=\s|$)", re.IGNORECASE)
OPTION_WORDS = {
    "-s": 3, "-o": 3, "-t": 3, "-mm": 2, "-blendu": 1, "-blendv": 1, "-boost": 1, "-cc": 1, "-clamp": 1, "-texres": 1,
    "-bm": 1, "-imfchan": 1, "-type": 1,
}  # fmt: skip
"""Options of a texture by name, with the words that follow each: up to three of -s, -o and -t."""
HARMLESS_OPTIONS = {
    "-blendu": "on",
    "-blendv": "on",
    "-cc": "off",
    "-clamp": "off",
    "-mm": "0 1",
    "-t": "0 0 0",
}
"""Default values of options, which may be ignored."""
UNUSED_OPTIONS = ("-boost", "-texres", "-bm")
READ_WORDS = ("kd", "ns", "pm", "pr", "pc", "pcr", "map_kd")
IGNORED_WORDS = ("ka", "ks", "ni", "illum", "sharpness", "map_ka", "map_aat", "ps", "anisor")
"""Statements that are ignored silently: ambient and specular colours belong to another lighting model."""


@dataclass(frozen=True, eq=False)
class ObjMaterial:
    """A material of an OBJ model.

    Parameters
    ----------
    material : Material
        Metallic-roughness material.
    picture : TextureImage or None
        Base-colour image.
    lost : tuple of str, optional
        Statements that are not supported.
    scale : tuple of float, optional
        Scale of the texture coordinates.
    offset : tuple of float, optional
        Offset of the texture coordinates.
    """

    material: Material
    picture: TextureImage | None
    lost: tuple[str, ...] = ()
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)


@dataclass
class _MapLine:
    """A parsed map statement."""

    name: str
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    lost: list[str] = field(default_factory=list)


class MaterialLibraries:
    """The materials of an OBJ's libraries by name; images are read on demand.

    Colours of .mtl files are interpreted as linear; the Phong exponent Ns becomes a roughness of (2 / (Ns + 2))^(1/4),
    by the width of the lobe (Karis 2013: alpha = roughness^2).

    Parameters
    ----------
    path : Path
        Path of the model.
    libraries : list of str
        Texts after ``mtllib`` in each of its lines.

    Raises
    ------
    UserError
        If there are too many.
    """

    def __init__(self, path: Path, libraries: list[str]) -> None:
        self._path = path
        self._missing: list[str] = []
        self._reader = PictureReader(path)
        self._fields: dict[str, tuple[Path, dict[str, str]]] = {}
        lines = list(dict.fromkeys(libraries))
        if len(lines) > MAX_LIBRARIES:
            raise UserError(f"{path} names {len(lines):,} material files; export it with one")
        for line in lines:
            self._read_line(unquoted(line))

    @property
    def notes(self) -> list[str]:
        """Notes on changes to the images."""
        return self._reader.notes

    @property
    def faults(self) -> list[str]:
        """Libraries and images that could not be read."""
        return [f"{why}: its materials are drawn grey" for why in self._missing] + self._reader.faults

    def __contains__(self, name: str) -> bool:
        return name in self._fields

    def __len__(self) -> int:
        return len(self._fields)

    def __getitem__(self, name: str) -> ObjMaterial:
        path, fields = self._fields[name]
        return self._material(path, name, fields)

    def _read_line(self, line: str) -> None:
        """Read the libraries of one line: one whose name contains blanks, or several."""
        several = [unquoted(n) for n in (_LIBRARY_NAME.findall(line) or line.split())][:MAX_LIBRARIES]
        failures = []
        for names in [[line], several] if several != [line] else [[line]]:
            failures = [why for name in names if (why := self._read(name))]
            if len(failures) < len(names):
                break
        self._missing += failures

    def _read(self, library: str) -> str:
        """Read a library; return why it could not be read, or an empty string."""
        try:
            path, data = read_named(self._path, self._path, library, "material", MAX_LIBRARY_BYTES)
        except NotReadError as error:
            return str(error)
        name, fields = "", dict[str, str]()
        for line in [*text_lines(data), "newmtl"]:
            word, rest = split_word(line)
            if word.lower() == "newmtl":
                if name:
                    self._fields[name] = (path, fields)
                name, fields = unquoted(rest), {}
            elif word and not word.startswith("#"):
                fields[word.lower()] = rest
        return ""

    def _material(self, path: Path, name: str, fields: dict[str, str]) -> ObjMaterial:
        unsupported = _lost_words(fields)
        try:
            colour = _colour(fields.get("kd", "0.6 0.6 0.6"))
            exponent = _number(fields, "ns", 10.0)
            metallic, coat, coat_roughness = (
                _number(fields, key, default)
                for key, default in (("pm", 0.0), ("pc", 0.0), ("pcr", Material.clearcoat_roughness))
            )
            roughness = _number(fields, "pr", (2 / (max(exponent, 0) + 2)) ** 0.25)
            if not np.isfinite([*colour, metallic, roughness, coat, coat_roughness]).all():
                raise ValueError("not finite")
        except (ValueError, IndexError) as error:
            raise UserError(
                f"{path}: material {name[:80]!r} has a value that is not a number; correct it"
            ) from error
        map_line = _map_line(fields.get("map_kd", ""))
        picture = None
        if map_line.name:
            picture = self._reader.from_file(path, map_line.name.replace("\\", "/"), name)
            unsupported += map_line.lost
        if picture is not None and not any(colour):
            colour = (1.0, 1.0, 1.0)
            unsupported.append("Kd 0 0 0 beside a texture (the texture is drawn as it is)")
        if max(colour) > 1:
            unsupported.append("colours above 1 (clipped)")
        r, g, b = np.clip(colour, 0, 1).tolist()
        surface = Material(
            name=name,
            base_color=(r, g, b),
            metallic=float(np.clip(metallic, 0, 1)),
            roughness=float(np.clip(roughness, 0.05, 1)),
            clearcoat=float(np.clip(coat, 0, 1)),
            clearcoat_roughness=float(np.clip(coat_roughness, 0, 1)),
            base_color_texture="" if picture is None else picture.name,
        )
        return ObjMaterial(surface, picture, tuple(unsupported), map_line.scale, map_line.offset)


def _colour(text: str) -> tuple[float, ...]:
    """Return the colour of a statement: three numbers, or one grey value."""
    values = [float(x) for x in text.split()[:3]]
    if len(values) == 1:
        values *= 3
    if len(values) != 3:
        raise ValueError("a colour has three numbers")
    return tuple(values)


def _number(fields: dict[str, str], key: str, default: float) -> float:
    return float(fields[key].split()[0]) if key in fields else default


def _lost_words(fields: dict[str, str]) -> list[str]:
    """Return a material's statements that are not carried over."""
    unsupported = []
    for word, rest in fields.items():
        value = next((x for x in rest.split() if not x.startswith("-")), "")
        number = float(value) if _NUMBER.fullmatch(value) else None
        if word in READ_WORDS or word in IGNORED_WORDS:
            continue
        if word in ("d", "tr"):
            if number is None or (number < 1 if word == "d" else number > 0):
                unsupported.append(f"transparency ({'Tr' if word == 'tr' else 'd'}: drawn opaque)")
        elif word == "ke":
            if any(x.strip("0.+-") for x in rest.split()):
                unsupported.append("emission (Ke)")
        elif word == "tf":
            if set(rest) - set("1.0 \t"):
                unsupported.append("transmission (Tf)")
        elif word.startswith("map_") or word in ("bump", "disp", "decal", "refl", "norm"):
            unsupported.append(f"maps {word}")
        elif word == "aniso":
            unsupported.append("brushing (aniso)")
        else:
            unsupported.append(f"statements {word[:20]!r}")
    return unsupported


def _map_line(text: str) -> _MapLine:
    """Parse a map statement: options precede the name, which may contain blanks."""
    map_line, rest = _MapLine(""), text.strip()
    for _ in range(MAX_OPTIONS):
        word, after = split_word(rest)
        option = word.lower()
        if option not in OPTION_WORDS:
            break
        values = _option_values(after, OPTION_WORDS[option], option)
        rest = after
        for _value in values:
            rest = split_word(rest)[1]
        numbers = [float(v) for v in values] if option in ("-s", "-o") else []
        if option == "-s" and numbers:
            map_line.scale = (numbers[0], numbers[1] if len(numbers) > 1 else 1.0)
        elif option == "-o" and numbers:
            map_line.offset = (numbers[0], numbers[1] if len(numbers) > 1 else 0.0)
        elif option not in UNUSED_OPTIONS and not _is_default(option, values):
            map_line.lost.append(f"option {option} of map_Kd")
    if rest.startswith("-") and len(rest.split()) > 1:
        map_line.lost.append(f"option {rest.split()[0][:20]} of map_Kd")
        rest = rest.split()[-1]
    map_line.name = unquoted(rest)
    return map_line


def _option_values(after: str, max_words: int, option: str) -> list[str]:
    """Return the words that belong to an option."""
    words = after.split(None, max_words)[:max_words]
    if option not in ("-s", "-o", "-t", "-mm"):
        return words
    count = 0
    while count < len(words) and re.fullmatch(
        r"[+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?", words[count], re.IGNORECASE
    ):
        count += 1
    return words[:count]


def _is_default(option: str, values: list[str]) -> bool:
    default = HARMLESS_OPTIONS.get(option, "").split()
    try:
        return [float(v) for v in values] == [float(v) for v in default[: len(values)]]
    except ValueError:
        return [v.lower() for v in values] == default
