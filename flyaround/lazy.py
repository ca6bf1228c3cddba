"""Lazy module attributes, imported on first use."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def lazy_names(module: str, homes: Mapping[str, str]) -> Callable[[str], Any]:
    """Return a module's ``__getattr__`` (PEP 562) that imports names from their home modules.

    Parameters
    ----------
    module : str
        ``__name__`` of the module.
    homes : mapping
        Module that defines each name.
    """

    def get(name: str) -> Any:  # noqa: ANN401 - type checkers read the module's own imports
        if name not in homes:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        value = getattr(import_module(homes[name]), name)
        setattr(sys.modules[module], name, value)
        return value

    return get
