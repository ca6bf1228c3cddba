"""Icons of commands: glyphs of Font Awesome 6 Free Solid, included in the imgui-bundle wheel (SIL OFL 1.1)."""

from __future__ import annotations

from flyaround.gui.texts import texts

FONT = "Font_Awesome_6_Free-Solid-900.otf"
ICONS = {name: chr(int(code, 16)) for name, code in texts("icons").items()}
"""Glyphs by the name of a command, or of a state of its button."""
PRIMARY = frozenset({"capture.start", "hil.start"})
"""Commands that are always the primary one of their panel, with filled buttons."""


def labelled(name: str, text: str) -> str:
    """Return a label preceded by the icon of a command, if there is one."""
    return f"{ICONS[name]}  {text}".strip() if name in ICONS else text
