"""Reader of TOML files. It limits size and nesting before parsing, because `tomllib` does not."""

from __future__ import annotations

import re
import tomllib
from typing import TYPE_CHECKING, Any

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.untrusted_files import (
    MAX_DEPTH,
    TOML_TEXT,
    decode_text,
    read_regular,
    refuse_deep,
    refuse_not_finite,
)

if TYPE_CHECKING:
    from pathlib import Path

MAX_TOML_BYTES = 1_000_000  # hundreds of times the longest built-in file; it bounds the time to parse
MAX_DOTS = 16  # dots in a key, which the parser's recursion follows
# dotted keys nest like brackets, and tomllib's time grows with the square of the number of dots
_DOTTED = re.compile(
    rb"""(?<![\w\-."'])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){%d}""" % (MAX_DOTS + 1)
)


def read_toml(path: Path, name: str, advice: str) -> bytes:
    """Read the contents of a TOML file.

    Parameters
    ----------
    path : Path
        File to read.
    name : str
        Name of the file in messages.
    advice : str
        Remedy if it cannot be read.

    Returns
    -------
    bytes
        Content of the file.

    Raises
    ------
    UserError
        If it cannot be read.
    """
    try:
        return read_regular(path, MAX_TOML_BYTES)
    except OSError as error:
        raise UserError(f"{name} cannot be read: {error.strerror or error}; {advice}") from error


def parse_toml(content: bytes, source: str) -> dict[str, Any]:
    """Parse the contents of a TOML file; a byte-order mark at its start is accepted.

    Parameters
    ----------
    content : bytes
        Bytes of the file.
    source : str
        Name of the file in messages.

    Returns
    -------
    dict
        The document. Every number in it is finite, and no table lies deeper than 64 others.

    Raises
    ------
    UserError
        If it is longer than 1 MB, nested too deeply, not UTF-8, not TOML, or holds NaN or infinity.
    """
    if len(content) > MAX_TOML_BYTES:
        raise UserError(
            f"{source} is longer than {MAX_TOML_BYTES / 1e6:g} MB, the limit of such a file; shorten it"
        )
    text = decode_text(content, source)
    refuse_deep(content, source, skip=TOML_TEXT)
    if _DOTTED.search(content):
        raise UserError(f"{source} has a key of more than {MAX_DOTS} dots, the limit of such a file")
    try:
        document = tomllib.loads(text)
    except ValueError as error:  # also integers of thousands of digits
        raise UserError(f"{source} is not valid TOML: {error}") from error
    except RecursionError as error:
        raise UserError(f"{source} is not valid TOML: it nests too deep") from error
    if _is_deep(document):  # dotted keys within brackets multiply the depth
        raise UserError(f"{source} nests more than {MAX_DEPTH} tables, the limit of such a file")
    refuse_not_finite(document, source)
    return document


def _is_deep(document: dict[str, Any]) -> bool:
    level: list[Any] = [document]
    for _ in range(MAX_DEPTH):
        level = [
            inner
            for value in level
            for inner in (value.values() if isinstance(value, dict) else value)
            if isinstance(inner, dict | list)
        ]
    return bool(level)
