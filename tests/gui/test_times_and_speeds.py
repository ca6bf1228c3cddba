"""Mission times are hh:mm:ss and speeds m/s in every panel and message, and a time is typed as it is shown."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest

from flyaround.gui.console import Console
from flyaround.gui.panels.all import PANELS
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow

MIXED = re.compile(r"T\+\d+(\.\d+)? s|T\+\d+:\d\d(?!:)|mm/s|cm/s|\d deg\b")
SPEED = re.compile(r"(\d+\.?\d*) m/s")


@pytest.fixture(scope="module")
def console() -> Iterator[Console]:
    made = console_flying("tango-vbar-approach")
    made.do("burn.plan", 500.0, 0.0, 0.02, 0.0)
    made.pass_time(200)
    yield made
    made.close()


@pytest.mark.parametrize(
    "name", ["steering", "chaser", "docking", "plots", "capture", "log", "timeline", "keys"]
)
def test_a_panel_mixes_no_formats(name: str, console: Console, window: HeadlessWindow) -> None:
    panel = next(p for p in PANELS if p.name == name)(window)
    for _ in range(2):
        window.noted.clear()
        with window.panel(name, 420.0, 2000.0):
            panel.draw(console)
    labels = [n.label for n in window.noted]
    assert labels
    assert [label for label in labels if MIXED.search(label)] == []


def test_no_command_names_another_unit(console: Console) -> None:
    texts = {c.name: c.hover_text() for c in console.table}
    assert {name: text for name, text in texts.items() if MIXED.search(text)} == {}


def test_messages_mix_no_formats(console: Console) -> None:
    refusals = [
        console.attempt("burn.plan", 0.0, 0.0, 0.02, 0.0),
        console.attempt("burn.plan", 600.0, 0.0, 0.0, 0.0),
    ]
    console.do("time.next-eclipse")
    console.do("time.jump-end")
    texts = [*refusals, *(m.text for m in console.messages), console.session.jump_text]
    assert all(refusals)
    assert [text for text in texts if MIXED.search(text)] == []
    speeds = [number for text in texts for number in SPEED.findall(text)]
    assert "0.0200" in speeds
    assert {len(number.partition(".")[2]) for number in speeds} == {4}
    assert any("T+00:08:20.0" in text for text in texts)


@pytest.mark.parametrize(("typed", "at_s"), [("0:12:30", 750.0), ("T+00:12:31.5", 751.5), ("752", 752.0)])
def test_a_script_and_a_field_take_a_time_as_it_is_shown(console: Console, typed: str, at_s: float) -> None:
    now_s = console.session.craft.steering.burns.burns[0].t_s
    assert console.attempt("burn.plan", typed, 0.0, 0.02, 0.0, now_s) == ""
    assert console.session.craft.steering.burns.burns[0].t_s == at_s


def test_a_time_that_is_none_is_refused_with_what_is_allowed(console: Console) -> None:
    refusal = console.attempt("timeline.seek", "1:99")
    assert "'1:99'" in refusal
    assert "h:min:s, or seconds" in refusal
