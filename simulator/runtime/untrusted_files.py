"""Reading of untrusted files: regular files only, of bounded size and nesting, from inside one folder.

Parsers of JSON, TOML and YAML recurse into brackets and take many times the file's memory, so the depth is measured
before parsing.
"""

from __future__ import annotations

import codecs
import errno
import math
import os
import re
import stat
from pathlib import Path, PureWindowsPath
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from flyaround.simulator.errors import UserError

MAX_DEPTH = 64  # brackets that may be open at once
MAX_DIGITS = 18  # such numbers fit into 64 bits; Python raises ValueError above 4300
MAX_INTEGER = 10**300  # from 1.8e308 on float() overflows

# Tables of bytes that open and close a JSON value.
_OPENING, _CLOSING = (np.isin(np.arange(256), list(kind)) for kind in (b"[{", b"]}"))
# strings, even unterminated, and comments: brackets inside do not nest; a linear-time pattern
JSON_TEXT = re.compile(rb'"(?:[^"\\]++|\\.?)*+"?+', re.DOTALL)
TOML_TEXT = re.compile(
    rb'"""(?:[^"\\]++|\\[\s\S]?|"(?!""))*+(?:"{3,5}+)?'
    rb"|'''(?:[^']++|'(?!''))*+(?:'{3,5}+)?"
    rb'|"(?:[^"\\\n]++|\\[^\n]?)*+"?'
    rb"|'[^'\n]*+'?"
    rb"|#[^\n]*+"
)
# the byte-order mark of UTF-32 starts with that of UTF-16
_MARKS = (
    (codecs.BOM_UTF32_LE, "UTF-32"),
    (codecs.BOM_UTF32_BE, "UTF-32"),
    (codecs.BOM_UTF16_LE, "UTF-16"),
    (codecs.BOM_UTF16_BE, "UTF-16"),
)


def read_regular(path: Path, max_bytes: int) -> bytes:
    """Return the bytes of a regular file. Pipes and devices are refused, because they would block or never end.

    Parameters
    ----------
    path : Path
        File to read.
    max_bytes : int
        Size limit; a longer file is refused before it is read.

    Returns
    -------
    bytes
        Content of the file.

    Raises
    ------
    OSError
        If the file cannot be opened.
    UserError
        If it is not a regular file, or too long.
    """
    # without O_NONBLOCK opening a pipe would wait for its writer
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    try:
        status = os.fstat(handle)
        if stat.S_ISDIR(status.st_mode):
            raise UserError(f"{path} is a folder; name a file")
        if not stat.S_ISREG(status.st_mode):
            raise UserError(f"{path} is a pipe or a device; name a regular file")
        if status.st_size > max_bytes:
            raise UserError(
                f"{path} has {_size(status.st_size)} and at most {_size(max_bytes)} are read; make it smaller"
            )
        with os.fdopen(handle, "rb", closefd=False) as file:
            return file.read(status.st_size)
    finally:
        os.close(handle)


def refuse_link_out(path: Path, folder: Path) -> None:
    """Raise if a symbolic link, of the file or of a folder above it, points outside ``folder``.

    Raises
    ------
    UserError
        If it does.
    """
    if not _is_within(path, folder):
        raise UserError(f"{path} is a link to a file outside {folder}; put the file itself there")


def find_beside(owner: Path, name: str, what: str, root: Path | None = None) -> Path:
    """Return the path of a file that another file names; it must lie in the same folder once links are resolved.

    Parameters
    ----------
    owner : Path
        File that contains the name.
    name : str
        Relative, with / or backslashes.
    what : str
        Kind of file, for messages.
    root : Path, optional
        Folder that must not be left; by default that of ``owner``.

    Returns
    -------
    Path
        Path of the existing file.

    Raises
    ------
    UserError
        If the name points outside the folder, or is a URL.
    """
    plain = name.replace("\\", "/")
    quoted = f"{owner}: {what} file {name[:80]!r}"
    if "\0" in name or not plain.strip():
        raise UserError(f"{quoted} is not a valid file name; export the model again")
    if "://" in plain or (urlsplit(plain).scheme and not PureWindowsPath(plain).drive):
        raise UserError(f"{quoted} is a URL, which is not fetched; put the file next to the model")
    folder = (root or owner.parent).resolve()
    if Path(plain).is_absolute() or PureWindowsPath(plain).anchor or PureWindowsPath(plain).drive:
        inside = False
    else:
        inside = _is_within(owner.parent.resolve() / plain, folder)
    if not inside:
        raise UserError(
            f"{quoted} is not within the model's folder; put it there and name it without its path"
        )
    return owner.parent / plain


def _is_within(path: Path, folder: Path) -> bool:
    """Return True if a file is in a folder once all links are resolved; False for circular links."""
    try:
        real = path.resolve(strict=True)
    except RuntimeError:  # circular links, before Python 3.13
        return False
    except OSError as error:
        if error.errno == errno.ELOOP:
            return False
        real = path.resolve()  # no such file
    return real.is_relative_to(folder.resolve())


def _size(n_bytes: int) -> str:
    if n_bytes < 2**20:
        return f"{n_bytes:,} bytes"
    return f"{n_bytes / 2**20:,.1f} MiB" if n_bytes < 2**30 else f"{n_bytes / 2**30:,.1f} GiB"


def without_mark(data: bytes, source: str) -> bytes:
    """Remove the byte-order mark that Windows' editors put before UTF-8.

    Returns
    -------
    bytes
        Text without the mark; it is not otherwise checked to be UTF-8.

    Raises
    ------
    UserError
        If the text is UTF-16 or UTF-32.
    """
    for mark, encoding in _MARKS:
        if data.startswith(mark):
            raise UserError(f"{source} is {encoding} text: save it as UTF-8")
    # PowerShell may omit the mark; text has no control codes below tab
    if len(data) > 1 and b"\0" in data[:2] and max(data[:2]) >= ord("\t"):
        raise UserError(f"{source} looks like UTF-16 text: save it as UTF-8")
    return data.removeprefix(codecs.BOM_UTF8)


def decode_text(data: bytes, source: str) -> str:
    """Decode a text file as UTF-8, with or without a byte-order mark.

    Returns
    -------
    str
        Text without the mark.

    Raises
    ------
    UserError
        If it has another encoding, or is binary.
    """
    text = without_mark(data, source)
    if b"\0" in text:
        raise UserError(f"{source} is a binary file, not UTF-8 text: save it as UTF-8")
    try:
        return text.decode("utf-8")
    except UnicodeDecodeError as error:
        line = text.count(b"\n", 0, error.start) + 1
        raise UserError(
            f"{source} is not UTF-8 text (line {line}: byte 0x{text[error.start]:02x}; it may be Latin-1 or "
            "Windows-1252): save it as UTF-8"
        ) from error


def refuse_deep(data: bytes, source: str, skip: re.Pattern[bytes] = JSON_TEXT) -> None:
    """Raise if brackets are nested too deeply, before the text is parsed.

    Parameters
    ----------
    data : bytes
        Text to check.
    source : str
        Name of the text, for the message.
    skip : Pattern, optional
        Pattern of the language's strings and comments, whose brackets do not count.

    Raises
    ------
    UserError
        If more than 64 are open at once.
    """
    numbers = np.frombuffer(skip.sub(b"", data), np.uint8)
    steps = _OPENING[numbers].astype(np.int8)
    steps -= _CLOSING[numbers]
    if np.cumsum(steps, dtype=np.int32).max(initial=0) > MAX_DEPTH:
        raise UserError(f"{source} nests more than {MAX_DEPTH} brackets, the limit of such a file")


def whole_number(text: str) -> int | None:
    """Convert decimal digits to a number.

    Returns
    -------
    int or None
        None for other text, or for more than `MAX_DIGITS`.
    """
    return int(text) if text.isdecimal() and len(text) <= MAX_DIGITS else None


def refuse_not_finite(value: Any, source: str, key: str = "") -> None:  # noqa: ANN401 - a document is anything
    """Raise if a TOML or JSON document holds NaN or infinity, which pass the bounds of a typed file, or a huge integer.

    Raises
    ------
    UserError
        If a number is not finite, or no float holds it; the message names its key.
    """
    if isinstance(value, dict):
        for name, inner in value.items():
            refuse_not_finite(inner, source, f"{key}.{name}" if key else str(name))
    elif isinstance(value, list):
        for k, inner in enumerate(value):
            refuse_not_finite(inner, source, f"{key}[{k}]")
    elif isinstance(value, float) and not math.isfinite(value):
        raise UserError(f"{source}: key {key} is {value}, allowed: a finite number")
    elif isinstance(value, int) and abs(value) > MAX_INTEGER:
        raise UserError(f"{source}: key {key} has {len(str(value))} digits, allowed: a number up to 1e300")
