"""Cautions of the flight: told once, when they begin."""

from __future__ import annotations

from dataclasses import replace

import msgspec

from flyaround.simulator.piloting.cautions import CautionWatch
from flyaround.simulator.piloting.session import Session
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.world.guidance.keep_out import KeepOut


def fly(session: Session, watch: CautionWatch, seconds: float, *held: str) -> list[str]:
    told: list[str] = []
    for _ in range(round(seconds / 0.02)):
        session.advance(0.02, set(held))
        told += [text for _, text in watch.news(session)]
    return told


def test_a_keep_out_sphere_that_overrules_is_told_once() -> None:
    scenario = load_scenario("tango-flyaround")
    chaser = msgspec.structs.replace(scenario.chaser, keep_out=KeepOut(radius_m=7.0))
    session, watch = Session.of(msgspec.structs.replace(scenario, chaser=chaser)), CautionWatch()
    session.centre()
    told = fly(session, watch, 20.0, "steer.forward", "steer.coarse")
    assert sum("keep-out sphere" in text for text in told) == 1


def test_an_eclipse_is_told_as_it_begins_and_ends() -> None:
    session, watch = Session.of(load_scenario("tango-flyaround")), CautionWatch()
    session.set_rate(100.0)
    told = fly(session, watch, 60.0)
    assert [text.split(":")[0] for text in told[:2]] in (
        ["eclipse", "the target is in sunlight again"],
        ["the target is in sunlight again", "eclipse"],
    )
    # looking back tells nothing again
    session.look_back.seek(0.0)
    session.paused = False
    assert fly(session, watch, 5.0) == []


def test_low_fuel_is_told_once() -> None:
    session, watch = Session.of(load_scenario("tango-flyaround")), CautionWatch()
    session.take_over()
    fly(session, watch, 0.1)
    spent = replace(session.steering.propellant, used_kg=3.99)
    session.steering.propellant = spent
    told = fly(session, watch, 3.0, "steer.forward", "steer.coarse")
    assert [text.split(":")[0] for text in told] == ["fuel is low"]
