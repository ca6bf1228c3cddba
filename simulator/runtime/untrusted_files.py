"""Reading files that others wrote or name: regular files alone, of a bounded size and nesting, from inside one folder.

A parser of JSON, TOML or YAML follows nested brackets by calling itself, and takes many times the file's memory; so
the depth of a text is measured before it is parsed.
"""

from __future__ import annotations

import math
import os
import re
import stat
from pathlib import Path, PureWindowsPath
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from simulator.errors import UserError

MOST_DEEP = 64
_OPENING, _CLOSING = (np.isin(np.arange(256), list(kind)) for kind in (b"[{", b"]}"))
# strings, even without an end, and comments: brackets in them nest nothing; no byte is looked at twice
_JSON_TEXT = re.compile(rb'"(?:[^"\\]++|\\.?)*+"?+', re.DOTALL)
_TOML_TEXT = re.compile(
    rb'"""(?:[^"\\]++|\\[\s\S]?|"(?!""))*+(?:"{3,5}+)?'
    rb"|'''(?:[^']++|'(?!''))*+(?:'{3,5}+)?"
    rb'|"(?:[^"\\\n]++|\\[^\n]?)*+"?'
    rb"|'[^'\n]*+'?"
    rb"|#[^\n]*+"
)
# a.b.c = 1 in TOML nests as well, and a long one takes the square of its length
_DOTTED = re.compile(rb"""(?<![\w\-."'])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){17}""")


def read_regular(path: Path, most_bytes: int) -> bytes:
    """A file's bytes; what is no regular file is not opened for good: a pipe would wait, a device never ends.

    Parameters
    ----------
    most_bytes : a longer file is refused before it is read.

    Raises
    ------
    OSError
        As of opening a file.
    UserError
        If it is no regular file, or longer.
    """
    # without O_NONBLOCK the opening of a pipe waits for its writer
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    try:
        status = os.fstat(handle)
        if stat.S_ISDIR(status.st_mode):
            raise UserError(f"{path} is a folder; name a file")
        if not stat.S_ISREG(status.st_mode):
            raise UserError(f"{path} is no regular file but a pipe or a device; name a file")
        if status.st_size > most_bytes:
            raise UserError(
                f"{path} has {_size(status.st_size)} and at most {_size(most_bytes)} are read; make it smaller"
            )
        with os.fdopen(handle, "rb", closefd=False) as file:
            return file.read(status.st_size)
    finally:
        os.close(handle)


def find_beside(owner: Path, name: str, what: str, root: Path | None = None) -> Path:
    """Where a file lies that another names: within that one's folder, whatever links there are.

    Parameters
    ----------
    owner : the file that names it. name : as it stands there, relative, with / or backslashes. what : it is.
    root : folder that must not be left; the owner's by default.

    Raises
    ------
    UserError
        If the name leads out of the folder, or is an address.
    """
    plain = name.replace("\\", "/")
    quoted = f"{owner}: {what} file {name[:80]!r}"
    if "\0" in name or not plain.strip():
        raise UserError(f"{quoted} has no name that a file can have; export the model again")
    if "://" in plain or (urlsplit(plain).scheme and not PureWindowsPath(plain).drive):
        raise UserError(f"{quoted} is an address, which is not fetched; put the file beside the model")
    folder = (root or owner.parent).resolve()
    if Path(plain).is_absolute() or PureWindowsPath(plain).anchor or PureWindowsPath(plain).drive:
        inside = False
    else:
        try:
            inside = (owner.parent.resolve() / plain).resolve().is_relative_to(folder)
        except (OSError, RuntimeError):  # links in a circle
            inside = False
    if not inside:
        raise UserError(
            f"{quoted} is not within the model's folder, from which alone files are read; put it there and "
            "name it without its path"
        )
    return owner.parent / plain


def _size(n_bytes: int) -> str:
    if n_bytes < 2**20:
        return f"{n_bytes:,} bytes"
    return f"{n_bytes / 2**20:,.1f} MB" if n_bytes < 2**30 else f"{n_bytes / 2**30:,.1f} GB"


def refuse_deep(data: bytes, where: str, *, toml: bool = False) -> None:
    """Look for brackets nested too deeply, in JSON or TOML, before the text is parsed.

    Parameters
    ----------
    toml : whether strings and comments are TOML's; else they are JSON's.

    Raises
    ------
    UserError
        If there are more than 64 open at once, not counting those in strings.
    """
    numbers = np.frombuffer((_TOML_TEXT if toml else _JSON_TEXT).sub(b"", data), np.uint8)
    steps = _OPENING[numbers].astype(np.int8)
    steps -= _CLOSING[numbers]
    if np.cumsum(steps, dtype=np.int32).max(initial=0) > MOST_DEEP:
        raise UserError(
            f"{where} nests more than {MOST_DEEP} brackets in each other, which no such file does"
        )


def refuse_dotted(data: bytes, where: str) -> None:
    """Look for a key of TOML that leads through too many tables, before the text is parsed.

    Raises
    ------
    UserError
        If one has more than 16 dots.
    """
    if _DOTTED.search(data):
        raise UserError(f"{where} has a key of more than 16 dots, which no such file has")


def refuse_not_finite(value: Any, where: str, key: str = "") -> None:  # noqa: ANN401 - a document is anything
    """Look for NaN and infinity in a document of TOML or JSON: they would pass the bounds of a typed file.

    Raises
    ------
    UserError
        With the key.
    """
    if isinstance(value, dict):
        for name, inner in value.items():
            refuse_not_finite(inner, where, f"{key}.{name}" if key else str(name))
    elif isinstance(value, list):
        for k, inner in enumerate(value):
            refuse_not_finite(inner, where, f"{key}[{k}]")
    elif isinstance(value, float) and not math.isfinite(value):
        raise UserError(f"{where}: key {key} is {value}, allowed: a finite number")
