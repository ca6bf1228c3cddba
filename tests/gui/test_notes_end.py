"""A note that states a present condition goes once it is untrue, and an answer outlasts news of the flight."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from flyaround.gui.console import Console
from flyaround.gui.status_line import ANSWER_MS, message_texts
from flyaround.simulator.piloting.cautions import NOTE_ENDS
from flyaround.simulator.piloting.docking_watch import Docking
from tests.gui.test_every_caution_ends import parsed, words
from tests.harness.flown_console import console_flying

EVENTS = (
    " has ended: you push",
    " is flown",
    "docked at ",
    "is put back onto",
    " cancelled",
    "go at ",
    "No-go has no effect",
    "limits: ",
    "keep-out sphere of ",
    "the docking axis now leads",
    "the jump has ended",
    "the replay has ended",
)
"""Parts of notes of what happened or was chosen, which stay true."""

ALREADY = {"at", "text", "f'{at}: the chaser waits at {point.name}'"}
"""Expressions of the end of a jump and of a planned burn, whose beginnings are assigned before."""


@pytest.fixture
def console() -> Iterator[Console]:
    made = console_flying("tango-vbar-approach")
    made.pass_time(20)
    yield made
    made.close()


def shown(console: Console, wall_ms: int = 20) -> str:
    """The message line, after some time."""
    console.pass_time(wall_ms)
    return " | ".join(text for text, _ in message_texts(console))


def test_every_note_of_a_flight_has_an_end_or_stays_true() -> None:
    notes = [
        (module, node)
        for module, node in parsed("simulator/piloting")
        if isinstance(node, ast.Tuple)
        and len(node.elts) == 2
        and getattr(node.elts[0], "value", "") == "note"
    ]
    assert len(notes) >= 15
    for module, node in notes:
        text = words(module, node.elts[1])
        ends = any(start.strip() in text for start in NOTE_ENDS) or "planned_text" in ast.unparse(node)
        name = ast.unparse(node.elts[1])
        assert ends or any(part in text for part in EVENTS) or name in ALREADY, f"{module}: {name}"


def test_armed_goes_once_the_hand_flies(console: Console) -> None:
    console.do("steer.arm", True)
    assert "hand control is armed: scenario's guidance flies" in shown(console)
    console.pass_time(100, frozenset({"steer.forward"}))
    assert "armed" not in shown(console)
    console.do("steer.arm", True)
    assert "keys, mouse and gamepad fly the chaser" in shown(console)
    console.do("guidance.hold")
    console.messages.pop()
    assert "fly the chaser" not in shown(console)


def test_at_rest_goes_once_it_moves(console: Console) -> None:
    console.do("guidance.drift")
    console.do("steer.stop")
    for _ in range(600):
        if "at rest" in shown(console, 200):
            break
    assert "at rest; it drifts from here" in shown(console)
    console.do("steer.pulse", "left")
    for _ in range(10):
        console.pass_time(100)
    assert np.linalg.norm(console.session.craft.world.velocity_lvlh_m_s) > 1e-3
    assert "at rest" not in shown(console)


@pytest.mark.parametrize(
    ("first", "then"),
    [
        ("guidance.vbar 12", "guidance.hold"),
        ("guidance.drift", "guidance.hold"),
        ("docking.approach off", "guidance.hold"),
        ("docking.no-go", "docking.approach off"),
        ("burn.plan 500 0 0.01 0", "burn.cancel"),
        ("time.next-hold-point", "time.jump-end"),
    ],
)
def test_a_note_ends_with_what_it_states(
    console: Console, first: str, then: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    console.do("docking.keep-out", "port")
    console.do("docking.approach", True)
    console.do("guidance.drift") if first.startswith("burn") else None
    console.do_line(first)
    console.pass_time(20)
    note = console.messages[-1]
    assert note.level == "note"
    assert not note.acknowledged
    if first == "docking.no-go":
        console.session.craft.docking.hold_points.begin(0.0)
    console.do_line(then)
    console.pass_time(20)
    assert note.acknowledged, note.text


def test_the_autopilots_destination_is_the_next_one(
    console: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    console.do("docking.keep-out", "port")
    console.do("docking.approach", True)
    assert "the autopilot flies to H1, 20 m before the port" in shown(console)
    assert "flies to H1" in shown(console)
    monkeypatch.setattr(Docking, "not_ready", lambda *_: ())
    hold_points = console.session.craft.docking.hold_points
    hold_points.points = tuple(replace(p, decision="passed") for p in hold_points.points)
    assert "flies to H1" not in shown(console)


def test_an_answer_outlasts_news_of_the_flight(console: Console) -> None:
    console.say("flies on from T+00:00:05.0 at 1x")
    console.say("the burn of 0.01 m/s at T+00:00:05.1 is flown")
    console.messages[-1].news = True
    assert shown(console).startswith("flies on from")
    for _ in range(ANSWER_MS // 200):
        console.pass_time(200)
    assert shown(console).startswith("the burn")
    # a later answer replaces both at once
    console.say("saved a picture", of="window.screenshot")
    assert shown(console) == "saved a picture"


def test_an_answer_that_has_ended_leaves_the_line_to_news(console: Console) -> None:
    ended: list[bool] = []
    console.say("opening tango ...", over=lambda: bool(ended))
    console.say("the burn is flown")
    console.messages[-1].news = True
    assert shown(console) == "opening tango ..."
    ended.append(True)
    assert shown(console) == "the burn is flown"
