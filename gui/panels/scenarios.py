"""Panel of the built-in scenarios, each with a picture."""

from __future__ import annotations

from importlib.resources import files
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.gui import style
from flyaround.gui.widgets import Panel
from flyaround.simulator.scenario.load import list_scenarios, load_scenario

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.simulator.runtime.arrays import ByteArray

CARD = 168.0
"""Width of a card at scale 1."""


class ScenarioChooser(Panel):
    """Cards of the built-in scenarios; a click flies one."""

    name, title, place, shown = "scenarios", "Scenarios", "left", False

    _query = ""
    _cards: tuple[tuple[str, str, ByteArray], ...] = ()
    _recent: tuple[str, ...] = ()

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w, imgui = self._w, self._w.imgui
        imgui.set_next_item_width(-1)
        flags, hint = imgui.InputTextFlags_.enter_returns_true, "find, or the path of a TOML file"
        entered, self._query = imgui.input_text_with_hint("##find", hint, self._query, flags)
        w.tip("a few letters of a scenario's name or title, or the path of a TOML file to be flown")
        query = self._query.strip()
        if query.endswith(".toml"):
            if imgui.button("Open this file", w.vec(w.width, 0)) or entered:
                console.do("scenario.open", query)
            w.command_tip(console, "scenario.open", query)
        if not self._cards:
            self._cards = tuple((name, *_card(name)) for name in list_scenarios())
        words = [] if query.endswith(".toml") else query.lower().split()
        cards = [c for c in self._cards if all(x in f"{c[0]} {c[1]}".lower() for x in words)]
        # recently flown ones first; the order stays while the panel is in sight
        if imgui.is_window_appearing():
            self._recent = tuple(console.recent)
        cards = sorted(cards, key=lambda card: (*self._recent, card[0]).index(card[0]))
        if not cards:
            w.text(f"no scenario has {query!r} in its name or title", style.QUIET)
        # the search field stays visible while the list scrolls
        with w.ctx.begin_child("scenarios"):
            for card, width in zip(cards, w.grid(len(cards), CARD), strict=True):
                self._draw_card(console, *card, width)

    def _draw_card(self, console: Console, name: str, title: str, picture: ByteArray, width: float) -> None:
        w, imgui = self._w, self._w.imgui
        with w.ctx.begin_group():
            texture = w.window.show_picture(f"scenario/{name}", name, picture)
            height = width * picture.shape[0] / picture.shape[1]
            size = w.vec(width - 2 * imgui.get_style().frame_padding.x, height)
            if imgui.image_button(f"##{name}", texture, size):
                console.do("scenario.open", name)
            w.tip(f"{title}\nflyaround sim {name}")
            here = name == console.session.plan.scenario.name
            w.cut_line(name, width, style.ACCENT if here else style.INK)


def _card(name: str) -> tuple[str, ByteArray]:
    """Return a scenario's title and picture; a grey one if there is none."""
    scenario = load_scenario(name)
    place = files("flyaround.assets").joinpath("scenarios", f"{name}.jpg")
    if not place.is_file():
        return scenario.title or name, np.full((150, 240, 3), 40, np.uint8)
    picture = cv2.imdecode(np.frombuffer(place.read_bytes(), np.uint8), cv2.IMREAD_COLOR_RGB)
    return scenario.title or name, np.asarray(picture, np.uint8)
