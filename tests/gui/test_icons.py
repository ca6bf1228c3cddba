"""Icons belong to commands, and their font has them."""

from __future__ import annotations

from importlib.resources import files

import pytest

from flyaround.gui.app import command_table
from flyaround.gui.icons import FONT, ICONS, PRIMARY, labelled

STATES = {"play", "hand-on", "hand-off"}


def test_every_icon_is_of_a_command_or_of_a_state() -> None:
    known = {c.name for c in command_table()} | STATES
    assert set(ICONS) <= known
    assert set(ICONS) >= PRIMARY


def test_a_label_without_an_icon_stays_as_it_is() -> None:
    assert labelled("overlay.box", "Box") == "Box"
    assert labelled("capture.start", "Capture").endswith("  Capture")
    # an icon alone leaves no room for letters
    assert labelled("map.fit", "") == ICONS["map.fit"]


def test_the_font_has_every_icon() -> None:
    pytest.importorskip("imgui_bundle")
    from PIL import ImageFont

    path = files("imgui_bundle") / "assets" / "fonts" / FONT
    font = ImageFont.truetype(str(path), 16)
    missing = bytes(font.getmask("\ue999"))
    assert [name for name, glyph in ICONS.items() if bytes(font.getmask(glyph)) == missing] == []
