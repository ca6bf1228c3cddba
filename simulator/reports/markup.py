"""HTML as values: every string is escaped unless it is markup already."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Iterable


class Markup(str):
    """HTML that is inserted unchanged."""

    __slots__ = ()


Content: TypeAlias = "str | int | float | Iterable[Content] | None"
"""Contents of an element: text and numbers, which are escaped, `Markup`, None, or several of these."""

VOID = frozenset({"br", "img", "link", "meta"})
"""Elements without an end tag."""


def markup(*content: Content) -> Markup:
    """Concatenate contents.

    Returns
    -------
    Markup
        HTML in which every text and number is escaped, except `Markup`; None is left out.
    """
    return Markup("".join(_parts(content)))


def element(name: str, /, *content: Content, **attributes: str | float | bool | None) -> Markup:
    """Return an HTML element.

    Parameters
    ----------
    name : str
        Name of the element.
    content : Content
        Texts, which are escaped, and mark-up.
    attributes : str, float or bool or None
        Attributes by name, with ``class_`` for ``class`` and ``text_anchor`` for ``text-anchor``; ``None`` and
        ``False`` are omitted, ``True`` has no value.

    Returns
    -------
    Markup
        Element with escaped text and attributes.
    """
    attribute_text = "".join(
        f" {key.rstrip('_').replace('_', '-')}" + ("" if value is True else f'="{html.escape(str(value))}"')
        for key, value in attributes.items()
        if value is not None and value is not False
    )
    return Markup(f"<{name}{attribute_text}>" + ("" if name in VOID else f"{markup(*content)}</{name}>"))


def _parts(content: Iterable[Content]) -> Iterable[str]:
    for part in content:
        match part:
            case None:
                pass
            case Markup():
                yield part
            case str() | int() | float():
                yield html.escape(str(part))
            case _:
                yield from _parts(part)
