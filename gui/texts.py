"""Texts for the operator, by subject: the tables of `texts.toml`."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import Any

from flyaround.simulator.runtime.toml_file import parse_toml


@cache
def texts(subject: str) -> dict[str, Any]:
    """Return the texts of a subject, each a string or a list of strings, in the order of the file."""
    name = "texts.toml"
    table: dict[str, Any] = parse_toml(files("flyaround.gui").joinpath(name).read_bytes(), name)[subject]
    return table
