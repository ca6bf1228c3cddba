"""Nested tables and values as the text of a TOML file."""

from __future__ import annotations

import json
from typing import Any


def to_toml(table: dict[str, Any], path: str = "") -> str:
    """Write a nested table as TOML.

    Returns
    -------
    str
        Plain keys first, then the nested tables under their full paths; keys whose value is None are left out.
    """
    nested = {k: v for k, v in table.items() if isinstance(v, dict) or _is_tables(v)}
    plain = {k: v for k, v in table.items() if v is not None and k not in nested}
    text = "".join(f"{key} = {toml_value(value)}\n" for key, value in plain.items())
    for key, value in nested.items():
        name = f"{path}.{key}" if path else key
        if isinstance(value, dict):
            text += f"\n[{name}]\n{to_toml(value, name)}"
        else:
            text += "".join(f"\n[[{name}]]\n{to_toml(item, name)}" for item in value)
    return text


def _is_tables(value: Any) -> bool:  # noqa: ANN401 - a TOML value is anything
    return isinstance(value, list | tuple) and bool(value) and all(isinstance(v, dict) for v in value)


def toml_value(value: Any) -> str:  # noqa: ANN401 - a TOML value is anything
    """Write a value as TOML does.

    Returns
    -------
    str
        Value on one line: a list, number, boolean or quoted string.
    """
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(v) for v in value) + "]"
    if isinstance(value, float):
        return repr(value)
    if not isinstance(value, str):
        return json.dumps(value)
    # JSON escapes strings as TOML does, except surrogate pairs and DEL
    text = value.encode(errors="replace").decode()
    return json.dumps(text, ensure_ascii=max(text, default="") <= "\uffff").replace("\x7f", "\\u007f")
