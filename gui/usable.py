"""Commands with nothing to act on, which menus and panels show grey."""

from __future__ import annotations

from operator import attrgetter
from typing import TYPE_CHECKING

from flyaround.gui.texts import texts

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.gui.console import Console

NEEDS: dict[str, Callable[[Console], object]] = {
    "help.tour-next": lambda c: c.shown.get("tour") and c.help.tour_step < len(texts("tour")),
    "help.tour-back": lambda c: c.shown.get("tour") and c.help.tour_step,
    "help.tour-end": lambda c: c.shown.get("tour"),
    **{name: attrgetter(path) for name, path in texts("needs").items()},
}
"""Function by command that returns what it acts on from the console, or a function that tells if there is anything."""


def is_usable(console: Console, name: str) -> bool:
    """Return True if a command has something to act on, for example the job that it ends."""
    found = NEEDS[name](console) if name in NEEDS else True
    return bool(found() if callable(found) else found)
