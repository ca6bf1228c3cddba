"""Another scenario in the same console: opened beside the flight, edited, refused in a sentence."""

from __future__ import annotations

import time
from pathlib import Path

import msgspec
import pytest

from flyaround.gui.console import Console
from flyaround.gui.scenario_draft import ScenarioDraft
from flyaround.gui.script import Script
from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.scenario.load import load_scenario
from tests.harness.flown_console import console_flying


@pytest.fixture
def console() -> Console:
    return console_flying()


def wait(console: Console, longest_s: float = 60.0) -> None:
    until = time.monotonic() + longest_s
    console.pass_time(0)
    while console.opener.is_busy() and time.monotonic() < until:
        time.sleep(0.01)
        console.pass_time(10)


def test_another_scenario_is_flown_and_time_stands_meanwhile(console: Console) -> None:
    console.pass_time(100)
    console.do("scenario.open", "iss-orbit-limb")
    wait(console)
    assert console.session.plan.scenario.name == "iss-orbit-limb"
    # the turn that takes it over may pass
    assert console.clock_ms <= 110
    assert console.session.t_s <= 0.02
    assert console.options.settings.environment == console.session.scene().environment


def test_a_scenario_that_is_wrong_is_a_message_and_the_flight_goes_on(
    console: Console, tmp_path: Path
) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text("version = 1\n")
    console.do("scenario.open", str(mine))
    wait(console)
    console.do("scenario.open", "no-such-thing")
    wait(console)
    told = [m.text for m in console.messages]
    assert any("mine.toml" in text for text in told)
    assert any("no-such-thing" in text for text in told)
    before = console.session.t_s
    console.pass_time(200)
    assert console.session.t_s > before
    assert console.session.plan.scenario.name == "tango-flyaround"


def test_a_flight_that_cannot_go_on_is_paused_with_a_message() -> None:
    # its perigee is below the ground, which it reaches after its own end
    scenario = load_scenario("tango-flyaround")
    orbit = msgspec.structs.replace(
        scenario.orbit, altitude_km=300.0, eccentricity=0.05, true_anomaly_deg=250.0
    )
    console = console_flying(msgspec.structs.replace(scenario, orbit=orbit, duration_s=300.0))
    session = console.session
    console.do("time.rate", "100")
    for _ in range(220):
        console.pass_time(70)
        # what is shown is where it got to, at its last step too
        assert session.craft.world.t_s == session.t_s
    assert console.session.clock.paused
    reached = session.t_s
    # beyond its own duration, nearly to the ground
    assert 1100.0 < reached < 1303.0
    assert console.messages[-1].level == "warning"
    assert "is paused: scenario tango-flyaround: the target is below the surface" in console.messages[-1].text
    # what was flown is still there, and it may be steered up to that place
    console.do("timeline.seek", 50.0)
    assert session.t_s == pytest.approx(50.0, abs=10.0)
    console.do("timeline.fly-on")
    console.do("steer.arm", True)
    for _ in range(20):
        console.pass_time(100, frozenset({"steer.up"}))
    assert session.craft.steering.propellant.delta_v_m_s > 0.0
    assert session.t_s < reached + 10.0


def test_a_script_that_opens_a_scenario_flies_the_same_again(console: Console) -> None:
    text = "0.1 scenario.open tango-earth-10m\n0.3 hold steer.forward\n0.5 release steer.forward\n"
    worlds = []
    for turn_ms in (7, 33):
        console.play(Script.parse(text, console.table))
        console.clock_ms = 0
        while console.clock_ms < 700:
            console.pass_time(min(turn_ms, 700 - console.clock_ms))
            if console.opener.is_busy():
                wait(console)
        worlds.append(console.session.craft.world)
    assert worlds[0] == worlds[1]


def test_another_craft_in_the_same_scenario(console: Console) -> None:
    console.do("scenario.target", "cubesat-3u")
    wait(console)
    assert console.session.plan.target.name == "cubesat-3u"
    assert console.session.plan.scenario.name == "tango-flyaround"


def test_a_text_is_edited_checked_and_kept(tmp_path: Path) -> None:
    draft = ScenarioDraft()
    draft.edit("tango-space-10m")
    assert draft.check().name == "tango-space-10m"
    right = draft.text
    draft.text = right.replace("duration_s", "duration_z", 1)
    with pytest.raises(UserError, match="duration_z"):
        draft.check()
    assert "duration_z" in draft.problem
    with pytest.raises(UserError):
        draft.save(tmp_path / "mine.toml")
    assert not list(tmp_path.iterdir())
    draft.text = right
    draft.save(tmp_path / "mine.toml")
    assert (draft.problem, draft.changed, draft.name) == ("", False, "mine")
    assert load_scenario(tmp_path / "mine.toml").duration_s == load_scenario("tango-space-10m").duration_s
    with pytest.raises(UserError, match=r"\.toml"):
        draft.save(tmp_path / "mine.txt")
    with pytest.raises(UserError, match="does not exist"):
        draft.save(tmp_path / "none" / "mine.toml")


def test_a_flight_that_was_left_is_returned_to(console: Console) -> None:
    console.do("scenario.back")
    assert "no earlier flight" in console.messages[-1].text
    console.do("steer.pulse", "forward")
    console.pass_time(100)
    left = console.session
    console.do("scenario.open", "iss-orbit-limb")
    # the pulse is in no file
    assert console.asked is not None
    console.answer(goes=True)
    wait(console)
    assert console.session is not left
    console.do("scenario.back")
    assert console.session is left
    assert left.clock.paused
    assert left.t_s == pytest.approx(0.1)
    console.do("scenario.back")
    assert console.session.plan.scenario.name == "iss-orbit-limb"


def test_a_flight_for_a_board_is_flown_and_not_looked_at(
    console: Console, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    console.do("steer.pulse", "forward")
    for _ in range(5):
        console.pass_time(100)
    flown = console.session
    console.do("timeline.hil")
    # what was flown is written a portion a turn, then opened
    for _ in range(500):
        console.pass_time(0)
        wait(console)
        if console.session is not flown:
            break
    assert console.session is not flown
    assert not console.session.clock.paused
    before_s = console.session.t_s
    for _ in range(20):
        console.pass_time(100)
    assert console.session.t_s > before_s + 1.5, "a board would wait for pictures"


def test_the_text_of_a_flight_is_of_what_flies(console: Console, tmp_path: Path) -> None:
    console.do("scenario.target", "cubesat-3u")
    wait(console)
    console.do("scenario.edit")
    assert console.draft.check().target == "cubesat-3u"
    mine = tmp_path / "mine.toml"
    mine.write_text(console.draft.text)
    console.do("scenario.open", str(mine))
    wait(console)
    console.do("scenario.edit")
    assert console.draft.text == mine.read_text()


def test_the_edited_text_is_flown(console: Console) -> None:
    console.do("scenario.edit")
    console.draft.text = console.draft.text.replace("Flying around Tango", "Round and round", 1)
    console.do("scenario.fly")
    wait(console)
    assert console.session.plan.scenario.title.startswith("Round and round")


def test_what_flying_refuses_later_stands_beside_the_text(
    console: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_scenario: object) -> None:
        raise UserError("the target is below the surface of the Earth 2935 s after the start")

    console.do("scenario.edit")
    monkeypatch.setattr(FlightSession, "of", refuse)
    console.do("scenario.target", "cubesat-3u")
    wait(console)
    assert console.draft.problem == "", "another scenario was refused, not the text"
    console.do("scenario.fly")
    wait(console)
    assert "below the surface" in console.draft.problem
    console.do("scenario.check")
    assert console.draft.problem == ""
