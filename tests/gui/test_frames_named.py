"""Positions, speeds and places stand beside the name of the frame whose components they are."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from flyaround.gui.console import Console
from flyaround.gui.panels.all import PANELS
from flyaround.gui.panels.lights import LightsPanel
from flyaround.gui.picture.figures import FIGURES
from flyaround.gui.widgets import Panel
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow


@pytest.fixture(scope="module")
def console() -> Iterator[Console]:
    made = console_flying("tango-vbar-approach")
    made.do("burn.plan", 500.0, 0.0, 0.02, 0.0)
    yield made
    made.close()


def texts(window: HeadlessWindow, panel: Panel, console: Console) -> list[str]:
    for _ in range(2):
        window.noted.clear()
        with window.panel(panel.name, 420.0, 2000.0):
            panel.draw(console)
    return [" ".join(n.label.split()) for n in window.noted if n.what == "text"]


def panel_of(name: str, window: HeadlessWindow) -> Panel:
    return next(p for p in PANELS if p.name == name)(window)


def test_the_chasers_figures_stand_below_their_frames(window: HeadlessWindow, console: Console) -> None:
    shown = texts(window, panel_of("chaser", window), console)
    lvlh, position, camera, rate = map(
        shown.index, ("Target's LVLH", "Position [m]", "Camera axes", "Target [°/s]")
    )
    assert lvlh < position < camera < rate
    assert shown[lvlh + 1] == "radial along cross"
    assert shown[camera + 1] == "x right y down z ahead"


def test_points_and_burns_are_typed_below_frame_and_axes(window: HeadlessWindow, console: Console) -> None:
    drawn: list[str] = []
    window.imgui.separator_text = drawn.append
    shown = texts(window, panel_of("steering", window), console)
    assert {"Fly to, target's LVLH [m]", "Burns, target's LVLH [m/s]"} <= set(drawn)
    assert [shown.count(axis) for axis in ("radial", "along", "cross")] == [2, 2, 2]


@pytest.mark.parametrize(
    ("frame", "axes"), [("camera", "camera: right, down, ahead"), ("target", "target: x, y, z")]
)
def test_the_place_of_a_light_names_its_frame(window: HeadlessWindow, frame: str, axes: str) -> None:
    console = console_flying("tango-space-10m")
    console.do("light.add", "box")
    console.do("light.set", 0, "frame", frame)
    shown = texts(window, LightsPanel(window), console)
    assert {f"Place [m], {axes}", f"Direction, {axes}"} <= set(shown)
    console.close()


def test_a_plotted_vector_names_its_frame() -> None:
    assert all("LVLH" in FIGURES[name].title for name in ("Position [m]", "Velocity [m/s]"))
