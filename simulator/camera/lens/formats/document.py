"""Parsing of a camera file to a table of keys: JSON, YAML, OpenCV's XML, ROS's INI, COLMAP's list."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

from flyaround.simulator.camera.lens.formats.xml_text import parse_xml
from flyaround.simulator.camera.lens.formats.yaml_text import NUMBER, parse_yaml, scalar
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.untrusted_files import decode_text, refuse_deep, refuse_not_finite

Syntax = Literal["json", "yaml", "xml", "ini", "colmap"]
_LINK = re.compile(r"[_\- ]")
_BINARY = (
    (b"v/1\x01", "an OpenEXR picture"),
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"II*\0", "a TIFF picture"),
    (b"MM\0*", "a TIFF picture"),
    (b"\x93NUMPY", "a NumPy array: write its numbers as JSON, with .tolist()"),
    (b"PK\x03\x04", "a zip archive, as NumPy's .npz: write its arrays as JSON, with .tolist()"),
    (b"MATLAB", "a .mat file: write jsonencode(toStruct(cameraParams)) as text"),
    (b"\x89HDF", "an HDF5 or .mat file: write jsonencode(toStruct(cameraParams)) as text"),
    (b"\x80\x03", "a Python pickle, which is not opened: write the numbers as JSON"),
    (b"\x80\x04", "a Python pickle, which is not opened: write the numbers as JSON"),
    (b"glTF", "a glTF mesh"),
    (b"%PDF", "a PDF"),
)
_COLMAP_LINE = re.compile(r"\s*\d+\s+[A-Z][A-Z0-9_]+\s+\d+\s+\d+\s+[-+.\d]")
# lists as NumPy prints them, without commas
_BARE_LIST = re.compile(rf"\[\s*+({NUMBER}(?:\s++{NUMBER})++)\s*+\]")
_BARE_ROWS = re.compile(r"(?<=[\d.]\])\s*(?=\[)|(?<=[\d.] \])\s*(?=\[)")


@dataclass(frozen=True, eq=False)
class Document:
    """A parsed camera file.

    Parameters
    ----------
    table : dict
        Its top level.
    syntax : str
        Syntax of the text.
    several : bool
        True if the text holds further YAML documents, which are not parsed.
    """

    table: dict[str, Any]
    syntax: Syntax
    several: bool = False

    @cached_property
    def names(self) -> frozenset[str]:
        """Keys of the table in their plain spelling (`plain_name`)."""
        return frozenset(map(plain_name, self.table))


def plain_name(key: object) -> str:
    """Return a key in lower case without ``_``, ``-`` and blanks, because programs spell keys in many ways."""
    return _LINK.sub("", str(key).lower())


def parse_document(content: bytes, source: str) -> Document:
    """Parse the text of a camera file; every number in it is finite.

    Parameters
    ----------
    content : bytes
        Bytes of the file.
    source : str
        Name of the file in messages.

    Raises
    ------
    UserError
        If it is binary, too long or too deep, has a duplicate key, or is in none of the syntaxes.
    """
    for magic, kind in _BINARY:
        if content.startswith(magic):
            raise UserError(f"{source} is not a camera file but {kind}")
    text = decode_text(content, source)
    if "\0" in text:
        raise UserError(f"{source} is not text: give a camera file, for example JSON or YAML")
    document = _parse_text(text, content, source)
    refuse_not_finite(document.table, source)
    return document


def _parse_text(text: str, content: bytes, source: str) -> Document:
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if lines and all(_COLMAP_LINE.match(line) for line in lines):
        return Document({"cameras": [line.split() for line in lines]}, "colmap")
    if any(line.strip() == "camera matrix" for line in lines):
        return Document(_parse_ini(lines, source), "ini")
    start = text.lstrip()
    if start.startswith("<"):
        return Document(parse_xml(text, source), "xml")
    text = _BARE_ROWS.sub(", ", _BARE_LIST.sub(_with_commas, text))
    several = False
    # a printed Python dictionary is YAML, not JSON
    if start.startswith("{") and not start.startswith("{'"):
        syntax: Syntax = "json"
        table = _parse_json(text, content, source)
    else:
        syntax = "yaml"
        table, several = parse_yaml(text, source)
    if not isinstance(table, dict):
        raise UserError(f"{source} is not JSON or YAML with a table of keys: give a camera file")
    return Document(table, syntax, several)


def _with_commas(match: re.Match[str]) -> str:
    return f"[{', '.join(match[1].split())}]"


def _parse_json(text: str, content: bytes, source: str) -> Any:  # noqa: ANN401 - any JSON value
    def unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        table: dict[str, Any] = {}
        for key, value in pairs:
            if key in table:
                raise UserError(f"{source} has the key {key} twice in one table; delete one")
            table[key] = value
        return table

    refuse_deep(content, source)
    try:
        return json.loads(text, object_pairs_hook=unique_keys)
    except (ValueError, RecursionError) as error:
        raise UserError(f"{source} is not JSON: {error}") from error


def _parse_ini(lines: list[str], source: str) -> dict[str, Any]:
    """Parse ROS's INI calibration: a line of words names the numbers on the lines below it."""
    words: dict[str, list[str]] = {}
    camera, name = "", ""
    for line in (line.strip() for line in lines if not line.lstrip().startswith(";")):
        if line.startswith("["):
            section = line.strip("[]")
            if section not in ("image", "externals"):
                if camera:
                    raise UserError(f"{source} holds several cameras, the second is {section}; keep one")
                camera = section
        elif re.fullmatch(rf"{NUMBER}(?:\s++{NUMBER})*+", line):
            words.setdefault(name, []).append(line)
        elif line in words:
            raise UserError(f"{source} has the key {line} twice; delete one")
        else:
            name = line
            words[name] = []
    return {"camera_name": camera} | {
        key: scalar(values[0]) if len(values) == 1 else " ".join(values) for key, values in words.items()
    }
