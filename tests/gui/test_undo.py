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
    assert at.console.messages.waiting == []


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
    while console.opener.is_busy() or not console.flights.former:
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


def plan(at: Pointer) -> list[tuple[float, ...]]:
    return [(b.t_s, *b.delta_v_lvlh_m_s) for b in at.console.session.craft.steering.burns.burns]


def said(at: Pointer) -> str:
    return at.console.messages[-1].text


def test_burns_are_undone_in_order_and_named(at: Pointer) -> None:
    console = at.console
    console.do("picture.noise", False)
    console.do("burn.plan", 500.0, 0.0, 0.02, 0.0)
    console.do("burn.plan", 900.0, 0.0, 0.01, 0.0)
    # moved, as by a drag on the map
    console.do("burn.plan", 950.0, 0.0, 0.03, 0.0, 900.0)
    console.do("picture.exposure", 1.0)
    console.do("burn.cancel")
    assert plan(at) == []
    console.do("settings.undo")
    assert [t_s for t_s, *_ in plan(at)] == [500.0, 950.0]
    assert said(at).startswith("undone: cancel 2 burns")
    console.do("settings.undo")
    assert said(at).startswith("undone: exposure")
    console.do("settings.undo")
    assert plan(at) == [(500.0, 0.0, 0.02, 0.0), (900.0, 0.0, 0.01, 0.0)]
    assert said(at).startswith("undone: change the burn of 0.0100 m/s")
    console.do("settings.undo")
    assert plan(at) == [(500.0, 0.0, 0.02, 0.0)]
    console.do("settings.undo")
    assert plan(at) == []
    assert said(at).startswith("undone: plan a burn of 0.0200 m/s")
    console.do("settings.undo")
    assert console.options.settings.noise
    for _ in range(4):
        console.do("settings.redo")
    assert [t_s for t_s, *_ in plan(at)] == [500.0, 950.0]


def test_a_burn_that_was_flown_or_aborted_does_not_come_back(at: Pointer) -> None:
    console = at.console
    console.do("picture.noise", False)
    console.do("burn.plan", 500.0, 0.0, 0.02, 0.0)
    console.do("burn.plan", 900.0, 0.0, 0.01, 0.0)
    console.do("docking.abort")
    console.do("settings.undo")
    assert plan(at) == []
    assert "was flown or cancelled since" in said(at)
    console.do("settings.undo")
    assert plan(at) == []
    # only a step that can be taken back is
    console.do("settings.undo")
    assert said(at).startswith("undone: noise off")


@pytest.mark.parametrize(
    ("line", "name"),
    [
        ("docking.limits idss", "limits"),
        ("docking.axis-here", "port"),
        ("steer.lvlh on", "axes"),
        ("steer.pulses on", "thrust"),
    ],
)
def test_choices_of_the_flight_are_undone(at: Pointer, line: str, name: str) -> None:
    console = at.console
    before = getattr(console.session.craft.choices, name)
    console.do_line(line)
    after = getattr(console.session.craft.choices, name)
    assert after != before
    console.do("settings.undo")
    assert getattr(console.session.craft.choices, name) == before
    assert said(at).startswith("undone: ")
    console.do("settings.redo")
    assert getattr(console.session.craft.choices, name) == after


def test_an_undone_burn_asks_while_an_earlier_time_is_shown(at: Pointer) -> None:
    console = at.console
    console.pass_time(200)
    console.do("burn.plan", 500.0, 0.0, 0.02, 0.0)
    for _ in range(10):
        console.pass_time(200)
    console.do("timeline.seek", 1.0)
    console.do("settings.undo")
    assert console.asked is not None
    assert len(plan(at)) == 1
    console.answer(True)
    assert plan(at) == []
    assert not console.session.look_back.active
