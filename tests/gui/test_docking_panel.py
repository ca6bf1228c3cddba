"""The panel Docking: its buttons stay where they are while what it waits for changes."""

from __future__ import annotations

import pytest

from flyaround.gui.panels.docking import DockingPanel
from flyaround.simulator.piloting.docking_figures import PRESETS
from flyaround.simulator.piloting.docking_watch import Docking
from flyaround.simulator.piloting.readouts import speed_text
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow


def test_what_go_waits_for_moves_no_control(monkeypatch: pytest.MonkeyPatch) -> None:
    window, console = HeadlessWindow(), console_flying("tango-vbar-approach")
    panel, places = DockingPanel(window), []
    try:
        for waits in ((), ("too fast", "beside the axis")):
            monkeypatch.setattr(Docking, "not_ready", lambda *_, waits=waits: waits)
            for _ in range(2):
                window.noted.clear()
                with window.panel("docking", 420.0, 1400.0):
                    panel.draw(console)
            assert [n.label for n in window.noted].count("  too fast") == bool(waits)
            places.append({n.label: n.middle for n in window.noted if n.what == "control"})
    finally:
        window.close()
        console.close()
    assert len(places[0]) > 5
    assert places[0] == places[1]


@pytest.mark.parametrize(("command", "title"), [("docking.go", "Go"), ("docking.no-go", "No-go")])
def test_a_go_without_a_hold_point_says_what_happens_instead(command: str, title: str) -> None:
    console = console_flying("tango-vbar-approach")
    console.session.craft.docking.hold_points.begin(0.0)
    console.do(command)
    sentence = f"{title} has no effect: no hold point lies ahead, so Autopilot flies straight into the port"
    assert console.messages[-1].text == sentence
    console.close()


def test_figures_and_limits_are_read_without_hovering() -> None:
    window, console = HeadlessWindow(), console_flying("tango-vbar-approach")
    panel = DockingPanel(window)
    try:
        for _ in range(2):
            window.noted.clear()
            with window.panel("docking", 256.0, 1400.0):
                panel.draw(console)
        lines = [n.middle[1] for n in window.noted if n.label.endswith((" over", " out"))]
        heads = [n.middle[1] for n in window.noted if n.label.endswith(("[m/s]", "[°]", "[°/s]", "[m]"))]
        assert len(lines) > 3
        assert set(lines) <= set(heads), "a wrapped figure is lower than its name"
    finally:
        window.close()
        console.close()
    assert all(unit in PRESETS["two-tenths"].title for unit in ("m", "m/s", "°", "°/s"))


def test_the_panel_shows_the_delta_v_spent() -> None:
    window, console = HeadlessWindow(), console_flying("tango-vbar-approach")
    panel = DockingPanel(window)
    try:
        console.do("docking.approach", True)
        console.pass_time(2000)
        with window.panel("docking", 420.0, 1400.0):
            panel.draw(console)
        spent = console.session.craft.steering.propellant.delta_v_m_s
        labels = [n.label for n in window.noted]
        assert spent > 0.0
        assert labels[labels.index("Delta-v spent") + 1] == speed_text(spent)
    finally:
        window.close()
        console.close()
