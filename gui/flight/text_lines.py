"""Where in a scenario's text a mistake is: the line that a sentence of the loader is about."""

from __future__ import annotations

import re

_HEADER = re.compile(r"^\s*\[+\s*([\w.]+)\s*\]+")
_AT_LINE = re.compile(r"\bat line (\d+)\b")
_UNKNOWN = re.compile(r"unknown key (\w+) (?:in section \[([\w.]+)[\]\[]|at the top level)")
_LACKS = re.compile(r"section \[([\w.]+)[^\]]*\] lacks")
_KEY = re.compile(r"\bkey ([\w.]+)")
_DOTTED = re.compile(r"\b([a-z]\w*(?:\.\w+)+)\b")


def line_of(message: str, text: str) -> int | None:
    """The line of a text that the loader's sentence about it means, from 1; None where it cannot be told."""
    if match := _AT_LINE.search(message):
        return int(match[1])
    if match := _UNKNOWN.search(message):
        return _line_of_key(text, f"{match[2]}.{match[1]}" if match[2] else match[1])
    if match := _LACKS.search(message):
        return _line_of_section(text, match[1])
    for pattern in (_KEY, _DOTTED):
        for match in pattern.finditer(message):
            if (line := _line_of_key(text, match[1])) is not None:
                return line
    return None


def _line_of_key(text: str, path: str) -> int | None:
    """Line of a key such as ``sensor.exposure_s``; of its section where the key is not written."""
    section, _, key = path.rpartition(".")
    here = ""
    assignment = re.compile(rf"^\s*{re.escape(key)}\s*(?:=|\.)")
    for number, line in enumerate(text.splitlines(), 1):
        if header := _HEADER.match(line):
            here = header[1]
            if here == path:
                return number
        elif here == section and assignment.match(line):
            return number
    return _line_of_section(text, section) if section else None


def _line_of_section(text: str, section: str) -> int | None:
    for number, line in enumerate(text.splitlines(), 1):
        header = _HEADER.match(line)
        if header and header[1] == section:
            return number
    return None
