"""Text files that others wrote, read within bounds: a size, and a depth of nesting, known before they are parsed.

A parser of JSON, TOML or YAML follows nested brackets by calling itself, and takes many times the file's memory.
"""

from __future__ import annotations

import re
import stat
from typing import TYPE_CHECKING

import numpy as np

from simulator.errors import UserError

if TYPE_CHECKING:
    from pathlib import Path

MOST_DEEP = 64
_OPENING, _CLOSING = (np.isin(np.arange(256), list(kind)) for kind in (b"[{", b"]}"))
# a.b.c = 1 in TOML nests as well, and a long one takes the square of its length
_DOTTED = re.compile(rb"""(?<![\w\-."'])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){17}""")


def read_bounded(path: Path, most_bytes: int) -> bytes:
    """A file's content.

    Parameters
    ----------
    most_bytes : that it may hold; what is far larger than any such file is none.

    Raises
    ------
    UserError
        If it is no file (a device or a pipe may never end), or holds more. OSError : if it cannot be read.
    """
    mode = path.stat().st_mode
    if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):  # reading a folder says so itself
        raise UserError(f"{path} is no file but a device or a pipe: give a file")
    with path.open("rb") as file:
        data = file.read(most_bytes + 1)
    if len(data) > most_bytes:
        raise UserError(f"{path} holds more than {most_bytes / 1e6:g} MB, which is too large for such a file")
    return data


def refuse_deep(data: bytes, where: str) -> None:
    """Look for brackets nested too deeply, in JSON, TOML or YAML, before the text is parsed.

    Raises
    ------
    UserError
        If there are more than 64 open at once.
    """
    numbers = np.frombuffer(data, np.uint8)
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
