"""The JSON of glTF files as Python values: bounded before it is read, every fault a ValueError."""

from __future__ import annotations

import json

MOST_VALUES = 2_000_000
"""Values and brackets of a document: as Python objects they take a hundred times the bytes of the file."""


def parse_json(data: bytes) -> object:
    """The value of a JSON text.

    Raises
    ------
    ValueError
        If it is no JSON, holds NaN or Infinity, nests too deep, or has more values than any model needs.
    """
    if len(data) > MOST_VALUES:
        count = sum(data.count(sign) for sign in (b",", b"[", b"{"))
        if count > MOST_VALUES:
            raise ValueError(f"it has {count:,} values, and {MOST_VALUES:,} are the most that is read")
    try:
        return json.loads(data, parse_constant=_refuse_constant)
    except RecursionError as error:
        raise ValueError("its brackets nest too deep") from error


def _refuse_constant(text: str) -> None:
    """JSON has no NaN and no Infinity, though Python's reader would take them."""
    raise ValueError(f"{text} is no number of JSON")
