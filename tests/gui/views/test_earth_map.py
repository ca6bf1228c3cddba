"""The Earth map: a map that cannot be read is said in its place, and the track is drawn all the same."""

from __future__ import annotations

import pytest

from flyaround.gui.canvas import Canvas
from flyaround.gui.views import earth_map
from flyaround.gui.views.earth_map import EarthMap
from flyaround.simulator.errors import UserError
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow

pytest.importorskip("imgui_bundle", reason="the gui extra is not installed")


def test_a_map_that_cannot_be_read_is_said_in_its_place(monkeypatch: pytest.MonkeyPatch) -> None:
    def damaged(_body: str) -> None:
        raise UserError("earth/day.jpg is damaged; install flyaround again")

    written: list[str] = []
    write = Canvas.text

    def noted(canvas: Canvas, at: tuple[float, float], text: str, *rest: object) -> None:
        written.append(text)
        write(canvas, at, text, *rest)

    monkeypatch.setattr(earth_map, "load_ground_map", damaged)
    monkeypatch.setattr(Canvas, "text", noted)
    console = console_flying()
    window = HeadlessWindow()
    try:
        view = EarthMap(window)
        for _ in range(2):
            with window.panel("Earth map", 800, 400):
                view.draw(console)
            view._maps["earth"].exception(timeout=120)  # until it was tried
        assert "no map of the Earth: earth/day.jpg is damaged; install flyaround again" in written
    finally:
        window.close()
