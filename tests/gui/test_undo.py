"""Undo and redo of settings say what they act on, in their message and in the menu."""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy

import pytest

from tests.harness.pointer import Pointer


@pytest.fixture
def at() -> Iterator[Pointer]:
    made = Pointer(panels=False)
    yield made
    made.close()


def test_the_message_says_what_was_undone(at: Pointer) -> None:
    console = at.console
    exposure_ms = 1e3 * console.session.plan.scenario.sensor.exposure_s
    console.do("picture.exposure", 1.0)
    console.clock_ms += 5000
    console.do("picture.noise", False)
    console.do("settings.undo")
    assert console.messages[-1].text == "undone: noise off (Ctrl+Y redoes it)"
    console.do("settings.undo")
    assert console.messages[-1].text == f"undone: exposure {2 * exposure_ms:.2f} ms (Ctrl+Y redoes it)"
    console.do("settings.redo")
    assert console.messages[-1].text == f"redone: exposure {2 * exposure_ms:.2f} ms"


def test_a_drag_is_named_by_its_end(at: Pointer) -> None:
    console = at.console
    for stops in (0.5, 1.0, 2.0):
        console.do("picture.exposure", stops)
        console.clock_ms += 30
    exposure_ms = 4e3 * console.session.plan.scenario.sensor.exposure_s
    assert console.history.next("settings.undo") == f"exposure {exposure_ms:.2f} ms"


def test_a_change_of_a_number_is_undone_with_its_old_and_new_value(at: Pointer) -> None:
    console = at.console
    console.do("light.add", "box")
    lines = {
        "light.set 0 radiance_w_m2_sr 4000": "Radiance [W/m2 sr] of the box from 500 to 4000",
        "light.set 0 position_m 1,2,3": "Place [m] of the box from 2, -2, 0 to 1, 2, 3",
        "light.switch 0 off": "box off",
        "sensor.set bits 10": "Depth [bit] from 8 to 10",
        "light.remove 0": "remove box",
    }
    for line, change in lines.items():
        console.clock_ms += 5000
        console.do_line(line)
        assert console.history.next("settings.undo") == change


def test_the_menu_says_what_it_would_undo(at: Pointer) -> None:
    def entries() -> list[str]:
        at.click(at.menus["File"])
        labels = [n.label for n in at.window.noted if n.label.endswith(("settings.undo", "settings.redo"))]
        at.escape()
        return labels

    assert entries() == ["Undo###settings.undo", "Redo###settings.redo"]
    at.console.do("picture.noise", False)
    assert entries() == ["Undo noise off###settings.undo", "Redo###settings.redo"]
    at.console.do("settings.undo")
    assert entries() == ["Undo###settings.undo", "Redo noise off###settings.redo"]


@pytest.mark.parametrize("command", ["settings.undo", "settings.redo"])
def test_nothing_to_undo_is_no_caution(at: Pointer, command: str) -> None:
    at.console.do(command)
    assert at.console.messages[-1].text.startswith("there is no")
    assert at.console.waiting == []


def test_undo_changes_only_what_it_names(at: Pointer) -> None:
    console = at.console
    console.do("picture.noise", False)
    # by the view of the map, and by another command on the way
    console.options.map.width_m = 77.0
    console.do("docking.approach", True)
    assert console.options.overlays.docking
    assert console.history.next("settings.undo") == "noise off"
    console.do("settings.undo")
    assert console.options.settings.noise
    assert (console.options.map.width_m, console.options.overlays.docking) == (77.0, True)


def test_commands_of_the_flight_are_no_steps(at: Pointer) -> None:
    console = at.console
    for _ in range(5):
        console.pass_time(200)
    for command in ("docking.approach", "timeline.seek 0", "timeline.fly-on", "time.restart", "layout.dock"):
        console.do_line(command)
        assert console.history.next("settings.undo") == "", command


def test_another_flight_begins_with_nothing_to_undo(at: Pointer) -> None:
    console = at.console
    console.do("picture.exposure", 2.0)
    console.do("scenario.open", "tango-flyaround")
    while console.opener.is_busy() or not console.former:
        console.stand()
    console.do("scenario.back")
    assert console.options.settings.exposure_stops == 0.0
    assert console.history.next("settings.undo") == ""


@pytest.mark.parametrize(("panel", "part"), [("lvlh-map", "map"), ("orbit-camera", "orbit")])
def test_a_drag_is_undone_alone(at: Pointer, panel: str, part: str) -> None:
    console = at.console
    console.open_panel(panel, shown=True)
    for _ in range(5):
        at.turn()
    before = deepcopy(getattr(console.options, part))
    console.do("picture.noise", False)
    x, y, wide, tall = at.rect(panel)
    at.drag((x + 0.5 * wide, y + 0.4 * tall), (x + 0.6 * wide, y + 0.45 * tall))
    assert getattr(console.options, part) != before
    console.do("settings.undo")
    assert getattr(console.options, part) == before
    assert not console.options.settings.noise
