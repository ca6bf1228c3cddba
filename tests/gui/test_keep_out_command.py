"""The keep-out sphere: its corridor turns with the port, or it is lifted, after a question, by one command."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from flyaround.gui.console import Console
from flyaround.gui.script import Script
from flyaround.simulator.piloting.recorder import FlightRecorder
from flyaround.simulator.scenario.load import load_scenario
from tests.harness.flown_console import console_flying
from tests.harness.pointer import Pointer

TUMBLING = "tango-vbar-approach"


@pytest.fixture
def screen() -> Iterator[Pointer]:
    made = Pointer(TUMBLING, panels=False, opened=("docking",))
    yield made
    made.close()


def dock(console: Console, longest_s: float = 400.0) -> Console:
    """Fly by the autopilot, with a go at each hold point."""
    session = console.session
    docking = session.craft.docking
    console.do("docking.approach", True)
    console.do("time.rate", "50")
    while session.t_s < longest_s and not docking.contacts:
        ready = not docking.not_ready(session.craft.chaser, session.flight)
        if docking.hold_points.next is not None and ready:
            console.do("docking.go")
            console.do("time.rate", "50")
        console.pass_time(100)
    return console


@pytest.mark.parametrize("guard", ["scenario", "port", "lifted"])
def test_the_autopilot_reaches_a_tumbling_port_unless_the_corridor_is_fixed(guard: str) -> None:
    console = console_flying(TUMBLING)
    for m in console.attempt("docking.keep-out", guard, asks=False), console.attempt("time.rate", "1"):
        assert not m
    dock(console)
    contact = console.session.craft.docking.contact
    if contact is not None:
        assert console.session.clock.rate == 1.0
        assert any(
            "docked at " in m.text and m.text.endswith("; time runs at 1x again") for m in console.messages
        )
    assert (contact is not None and contact.docked) == (guard != "scenario")
    overruled = [m for m in console.messages if "overruled" in m.text]
    assert bool(overruled) == (guard == "scenario")
    # the log, as a script, does it again
    lines = [str(line) for line in console.log.lines]
    again = console_flying(TUMBLING)
    again.play(Script.parse("\n".join(lines), again.table))
    while again.clock_ms < console.clock_ms:
        again.pass_time(100)
    assert again.session.craft.steering.guard == guard
    assert again.session.craft.chaser == console.session.craft.chaser


def test_a_button_beside_the_caution_is_its_remedy(screen: Pointer) -> None:
    console = screen.console
    assert not screen.has("CORRIDOR AT PORT")
    console.do("docking.approach", True)
    screen.turn()
    screen.press("CORRIDOR AT PORT")
    console.pass_time(20)
    screen.turn()
    assert console.session.craft.steering.guard == "port"
    assert console.messages.waiting == []
    assert not screen.has("CORRIDOR AT PORT")


def test_the_caution_names_the_remedy_and_ends_with_it() -> None:
    console = console_flying(TUMBLING)
    console.do("docking.approach", True)
    (caution,) = console.messages.waiting
    assert "corridor at the port" in caution.text
    console.do("docking.keep-out", "port")
    console.pass_time(20)
    assert console.messages.waiting == []
    console.do("docking.approach", False)
    console.do("docking.approach", True)
    assert console.messages.waiting == []


def test_lifting_asks_and_is_seen_until_it_is_taken_back(screen: Pointer) -> None:
    console = screen.console
    steering = console.session.craft.steering
    console.do("docking.keep-out", "lifted")
    screen.turn()
    assert any("hitting the target" in text for text in screen.texts())
    screen.press("Stay here")
    screen.turn()
    assert steering.guard == "scenario"
    assert not screen.has("KEEP-OUT LIFTED")
    console.do("docking.keep-out", "lifted")
    screen.turn()
    screen.press("Lift it")
    screen.turn()
    assert steering.guard == "lifted"
    assert steering.sphere is None
    console.do("window.acknowledge")
    screen.turn()
    assert screen.has("KEEP-OUT LIFTED")
    screen.press("KEEP-OUT LIFTED")
    screen.turn()
    assert steering.guard == "scenario"
    assert not screen.has("KEEP-OUT LIFTED")


def test_it_is_undone_alone_and_kept_along_the_timeline(screen: Pointer) -> None:
    console = screen.console
    steering = console.session.craft.steering
    console.pass_time(200)
    console.do("docking.keep-out", "port")
    console.do("settings.undo")
    assert console.messages[-1].text.startswith("undone: keep-out sphere port")
    assert steering.guard == "scenario"
    console.do("settings.redo")
    assert steering.guard == "port"
    for _ in range(5):
        console.pass_time(200)
    console.do("timeline.seek", 0.0)
    console.do("picture.noise", False)
    console.do("settings.undo")
    assert steering.guard == "port"
    console.do("timeline.fly-on", asks=False)
    console.pass_time(200)
    assert steering.guard == "port"
    console.do("time.restart", asks=False)
    console.pass_time(200)
    assert console.session.craft.steering.guard == "port"


def test_it_is_chosen_for_the_flight_on_while_an_earlier_time_is_shown(screen: Pointer) -> None:
    console = screen.console
    for _ in range(5):
        console.pass_time(200)
    console.do("docking.keep-out", "port")
    console.do("timeline.seek", 0.0)
    console.do("docking.keep-out", "scenario")
    assert console.asked is None
    assert console.session.look_back.active
    assert console.session.craft.steering.guard == "scenario"


def test_a_redo_does_not_lift_without_a_question(screen: Pointer) -> None:
    console = screen.console
    console.do("docking.keep-out", "lifted", asks=False)
    console.do("settings.undo")
    assert console.session.craft.steering.guard == "scenario"
    said = len(console.messages)
    console.do("settings.redo")
    console.pass_time(20)
    assert console.asked is not None
    assert console.session.craft.steering.guard == "scenario"
    assert len(console.messages) == said
    console.answer(True)
    console.do("settings.undo")
    assert console.history.next("settings.undo") == ""


def test_a_scenario_without_a_sphere_refuses() -> None:
    console = console_flying("tango-space-10m")
    assert console.attempt("docking.keep-out", "lifted") == "this scenario has no keep-out sphere"


def test_a_restart_keeps_what_the_pilot_chose_but_for_burns() -> None:
    console = console_flying(TUMBLING)
    console.pass_time(200)
    for line in ("docking.limits idss", "docking.axis-here", "steer.lvlh on", "docking.keep-out port"):
        console.do_line(line)
    console.do("burn.plan", 500.0, 0.0, 0.01, 0.0)
    chosen = console.session.craft.choices
    console.do("time.restart", asks=False)
    console.pass_time(200)
    kept = console.session.craft.choices
    assert kept.burns.burns == ()
    assert replace(kept, burns=chosen.burns) == chosen


def test_a_kept_flight_and_a_recording_keep_the_choice(tmp_path: Path) -> None:
    console = console_flying(TUMBLING)
    recorder = console.session.look_back.recorder = FlightRecorder()
    recorder.keep_in(tmp_path / "recorded", console.session.plan.scenario)
    console.do("docking.keep-out", "port")
    for _ in range(5):
        console.pass_time(200)
    console.do("timeline.keep", str(tmp_path / "kept"))
    while console.jobs.keeping:
        console.pass_time(0)
    recorder.close()
    for folder in ("kept", "recorded"):
        again = console_flying(load_scenario(tmp_path / folder / "replay.toml"))
        assert again.session.craft.steering.guard == "port"
