"""The panel Plots: figures over time, and a row of figures that is dragged into it."""

from __future__ import annotations

import pytest

from flyaround.gui.panels.chaser import ChaserPanel
from flyaround.gui.panels.plots import PlotsPanel
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow

HALF = 420.0


@pytest.fixture
def scene():
    window, console = HeadlessWindow(), console_flying("tango-space-10m")
    panels = ChaserPanel(window), PlotsPanel(window)

    def turn():
        imgui = window.plain
        console.pass_time(100)
        imgui.get_io().delta_time = 0.2
        window.noted.clear()
        imgui.new_frame()
        for k, panel in enumerate(panels):
            imgui.set_next_window_pos(imgui.ImVec2(k * HALF, 0))
            imgui.set_next_window_size(imgui.ImVec2(HALF, 780))
            imgui.begin(f"panel {k}")
            panel.draw(console)
            imgui.end()
        imgui.render()

    yield window, turn, console
    window.close()


def texts(window):
    return [n.label for n in window.noted if n.what == "text"]


def test_the_newest_number_stands_beside_the_plot_before_any_picture(scene):
    window, turn, console = scene
    console.do("time.rate", "500")
    for _ in range(4):
        turn()
        assert f"Range [m]: {console.session.craft.world.range_m:.4g}" in texts(window)


def test_a_row_of_figures_is_dragged_into_a_plot(scene):
    window, turn, _ = scene
    for _ in range(2):
        turn()
    assert not any(text.startswith("off the boresight") for text in texts(window))
    name = next(k for k, n in enumerate(window.noted) if n.label == "Off boresight")
    row = window.noted[name + 1].middle
    io = window.plain.get_io()
    io.add_mouse_pos_event(*row)
    turn()
    io.add_mouse_button_event(0, True)
    turn()
    for x in (0.3, 0.7, 1.0):
        io.add_mouse_pos_event(row[0] + x * (1.5 * HALF - row[0]), 600.0)
        turn()
    io.add_mouse_button_event(0, False)
    turn()
    turn()
    assert any(text.startswith("Off the boresight [°]: ") for text in texts(window))
