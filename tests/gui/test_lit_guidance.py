"""The guidance that flies is lit on each of its buttons and in the menu, and an abort has one colour everywhere."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from flyaround.gui import style
from flyaround.gui.panels.steering import GUIDANCE
from flyaround.gui.picture.figures import flown_colour
from flyaround.gui.views.camera import mode_badge
from flyaround.gui.views.docking_hud import status
from tests.harness.flown_console import console_flying
from tests.harness.pointer import Pointer


@pytest.fixture
def at() -> Iterator[Pointer]:
    made = Pointer("tango-vbar-approach", panels=False, opened=("chaser", "steering"))
    yield made
    made.close()


def test_one_mode_is_on() -> None:
    console = console_flying("tango-vbar-approach")
    for name in GUIDANCE:
        console.do(name)
        on = [n for n in GUIDANCE if (state := console.table[n].state) is not None and state(console)]
        assert on == [name], console.messages[-1].text
    console.do("docking.approach", True)
    state = console.table["guidance.drift"].state
    assert state is not None
    assert not state(console)
    console.do("steer.stop")
    state = console.table["steer.stop"].state
    assert state is not None
    assert state(console)
    console.close()


def test_station_keeping_lights_both_its_buttons(at: Pointer) -> None:
    at.console.do("steer.toggle")
    fills: dict[str, tuple[float, ...] | None] = {}
    for panel in at.layout.panels:
        widgets, real = panel._w, panel._w.filled_button

        def filled_button(
            label: str, width: float, fill: style.Rgba | None, real=real, who=panel.name
        ) -> bool:  # type: ignore[no-untyped-def]
            if label.endswith("guidance.hold "):
                fills[who] = fill
            return bool(real(label, width, fill))

        widgets.filled_button = filled_button  # type: ignore[method-assign]
    at.turn()
    assert fills == {"chaser": None, "steering": None}
    at.console.do("guidance.hold")
    at.turn()
    assert fills == {"chaser": style.LIT, "steering": style.LIT}


def test_an_abort_has_one_colour(at: Pointer) -> None:
    at.console.do("docking.approach", True)
    at.console.do("guidance.hold")
    session = at.console.session
    assert {mode_badge(session)[1], status(at.console)[1], flown_colour(session, style.QUIET)} == {
        style.ACCENT
    }
    craft = session.craft
    craft.steering.abort()
    assert {mode_badge(session)[1], status(at.console)[1], flown_colour(session, style.QUIET)} == {
        style.OUTSIDE
    }
    at.turn()
    assert at.framed(style.BAD), "the button of the abort is lit"


def test_tracking_has_one_name_and_centres_the_target(at: Pointer) -> None:
    console = at.console
    console.do("steer.attitude", "hold")
    at.turn()
    names = {n.label.split("##")[0] for n in at.window.noted if n.what == "control"}
    assert [name for name in names if "Track" in name or name == "Target"] == ["Track target"]
    for _ in range(5):
        console.do("steer.pulse", "yaw-right")
    for _ in range(40):
        console.pass_time(200)
    assert console.telemetry.off_boresight_deg > 0.5
    at.press("Track target")
    for _ in range(50):
        console.pass_time(200)
    assert console.telemetry.off_boresight_deg < 0.1
    assert "TRACK TARGET" in mode_badge(console.session)[0]
    assert "OFF" not in mode_badge(console.session)[0]
    for _ in range(5):
        console.do("steer.pulse", "yaw-right")
    for _ in range(40):
        console.pass_time(200)
    assert mode_badge(console.session)[0].endswith("TRACK, 1.0° OFF")
