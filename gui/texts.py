"""Texts for the operator, by subject: the tables of `texts.toml`."""

from __future__ import annotations

import re
from functools import cache
from importlib.resources import files
from typing import Any

from flyaround.simulator.piloting.readouts import duration_text
from flyaround.simulator.runtime.toml_file import parse_toml


@cache
def texts(subject: str) -> dict[str, Any]:
    """Return the texts of a subject, each a string or a list of strings, in the order of the file."""
    name = "texts.toml"
    table: dict[str, Any] = parse_toml(files("flyaround.gui").joinpath(name).read_bytes(), name)[subject]
    return table


NOTES: dict[str, str] = texts("notes")
"""Explanations in panels, by subject."""


@cache
def titles() -> dict[str, str]:
    """Return the titles, with units, of parameters of sensor and lights by their keys in a scenario's file."""
    return {key: title for panel in ("sensor", "lights") for key, (title, _) in texts(panel).items()}


def with_titles(sentence: str) -> str:
    """Return a sentence in which the key of a scenario's file is replaced by its title."""
    key = rf"(?:light: key |sensor\.(?:detector\.)?)({'|'.join(titles())})\b"
    return re.sub(key, lambda m: titles()[m[1]], sentence)


def left_text(seconds: float | None) -> str:
    """Return a remaining time as the end of a sentence; empty while it is unknown."""
    return "" if seconds is None else f", {duration_text(seconds)} left"
