"""Every panel and view, in the order of tabs; `flyaround.gui.layout` opens, docks and names them."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from flyaround.gui.texts import texts

if TYPE_CHECKING:
    from flyaround.gui.widgets import Panel


def _class(name: str) -> type[Panel]:
    module, _, kind = name.partition(":")
    panel: type[Panel] = getattr(import_module(f"flyaround.gui.{module}"), kind)
    return panel


PANELS = tuple(_class(name) for name in texts("panels")["classes"])
