"""Text files that others wrote: how deeply they nest, known before they are parsed.

A parser of JSON, TOML or YAML follows nested brackets by calling itself, and takes many times the file's memory.
"""

from __future__ import annotations

import re

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
