"""The panel Plots: figures over time, and a row of figures that is dragged into it."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from flyaround.gui.panels.chaser import ChaserPanel
from flyaround.gui.panels.plots import PlotsPanel
from flyaround.simulator.piloting.telemetry import Telemetry
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow

HALF = 420.0


def telemetry(t_s: float) -> Telemetry:
    three = (1.0, 2.0, 3.0)
    return Telemetry(
        epoch_utc="2026-01-01T00:00:00.000Z",
        t_s=t_s,
        range_m=10.0 + t_s,
        closing_m_s=-1.0,
        lateral_m_s=0.5,
        off_boresight_deg=0.1,
        relative_rate_deg_s=three,
        camera_rate_deg_s=three,
        position_lvlh_m=three,
        velocity_lvlh_m_s=three,
        phase_deg=70.0,
        sun_visible_fraction=1.0,
        altitude_km=700.0,
    )


def test_plots_are_drawn_before_the_first_picture():
    window = HeadlessWindow()
    console = console_flying("tango-space-10m")
    console.feed = SimpleNamespace(newest=None)
    panel, imgui = PlotsPanel(window), window.plain
    for _ in range(2):
        imgui.get_io().delta_time = 0.2
        imgui.new_frame()
        imgui.begin("panel")
        panel.draw(console)
        imgui.end()
        imgui.render()
    assert any("no picture yet" in text for text in texts(window))
    window.close()


@pytest.fixture
def scene():
    window, console = HeadlessWindow(), console_flying("tango-space-10m")
    panels = ChaserPanel(window), PlotsPanel(window)
    pictures = (SimpleNamespace(telemetry=telemetry(float(k))) for k in range(1000))

    def turn():
        imgui = window.plain
        console.feed.newest = next(pictures)
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

    console.feed = SimpleNamespace(newest=None)
    yield window, turn
    window.close()


def texts(window):
    return [n.label for n in window.noted if n.what == "text"]


def test_the_newest_number_stands_beside_the_plot(scene):
    window, turn = scene
    for _ in range(4):
        turn()
    assert "range [m]: 13" in texts(window)


def test_a_row_of_figures_is_dragged_into_a_plot(scene):
    window, turn = scene
    for _ in range(2):
        turn()
    assert not any(text.startswith("off the boresight") for text in texts(window))
    name = next(k for k, n in enumerate(window.noted) if n.label == "Off axis")
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
    assert any(text.startswith("off the boresight [°]: ") for text in texts(window))


def test_figures_of_an_old_picture_carry_its_age(scene):
    window, turn = scene
    turn()
    assert not any("old" in text for text in texts(window))
    for _ in range(5):
        turn()
    assert "5 s old" in texts(window)
