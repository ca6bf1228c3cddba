"""Some five metres along the V-bar by real keys in a real window; the log and the world's propagation give the same."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from flyaround.gui.app import command_table, options_of
from flyaround.gui.console import Console
from flyaround.gui.picture.feed import Feed
from flyaround.gui.script import Script
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.runtime.toml_text import to_toml
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.world.orbit.propagation import propagate
from tests.gui.test_vbar_by_keys import START_M, beside
from tests.gui.test_window import last_state, recorded_s
from tests.harness.no_renderer import NoRenderer
from tests.harness.sitting import Sitting, wait_until

pytestmark = [pytest.mark.gui, pytest.mark.slow, pytest.mark.timeout(1800)]

PULSES, COAST_S = 12, 35.0


def speed_m_s(folder: Path) -> float:
    """Return the relative speed in the newest sample of the recorded flight, about the target's orbit."""
    state = last_state(folder)
    if state is None:
        return np.inf
    r, v = state["r_target_eci_m"], state["v_target_eci_m_s"]
    turning = np.cross(np.cross(r, v) / (r @ r), state["relative_eci_m"])
    return float(np.linalg.norm(state["relative_eci_m_s"] - turning))


def by_keys(sitting: Sitting, folder: Path) -> None:
    """LVLH axes, pulses, twelve pulses of a centimetre a second inward, and the brake after half a minute."""

    def done() -> str:
        return (folder / "log.script").read_text()

    sitting.keys("Insert", "n", "m")
    wait_until(lambda: "steer.pulses" in done())
    for k in range(1, PULSES + 1):
        sitting.keys("s")
        wait_until(lambda k=k: done().count("release steer.back") == k)
    started_s = recorded_s(folder)
    wait_until(lambda: recorded_s(folder) > started_s + COAST_S)
    sitting.keys("x")
    wait_until(lambda: "steer.stop" in done() and speed_m_s(folder) < 1e-3)


def test_the_v_bar_by_keys_in_a_window(display: str, tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text(to_toml(msgspec.to_builtins(beside())))
    assert load_scenario(mine).chaser == beside().chaser
    options = "mine.toml", "--log", "log.script", "--record", "flown"
    with Sitting(tmp_path, *options, display=display) as sitting:
        sitting.wait_for("first picture")
        by_keys(sitting, tmp_path)
        sitting.keys("ctrl+q")
        state, _ = sitting.end()
    # every press was one pulse, and the chaser rests about five metres nearer
    assert state["delta_v_m_s"] > 0.01 * PULSES
    moved_m = state["position_lvlh_m"][1] - START_M
    assert -9.0 < moved_m < -3.5
    assert np.linalg.norm(state["velocity_lvlh_m_s"]) < 0.01

    # the log flies the same again, without a window
    script = Script.read(tmp_path / "log.script", command_table())
    assert sum(str(line).endswith("hold steer.back") for line in script.lines) == PULSES
    session = FlightSession.of(load_scenario(mine))
    again = Console(session, Feed(NoRenderer()), options_of(session), command_table())
    again.play(script)
    while again.clock_ms < round(1000 * state["operator_s"]):
        again.pass_time(min(40, round(1000 * state["operator_s"]) - again.clock_ms))
    assert session.t_s == state["t_s"]
    assert list(session.craft.world.position_lvlh_m) == state["position_lvlh_m"]

    # and between the last pulse and the brake it is the world's own free flight
    released = max(line.t_ms for line in script.lines if str(line).endswith("release steer.back")) / 1000
    braked = next(line.t_ms for line in script.lines if line.name == "steer.stop") / 1000
    start_s, end_s = np.ceil(10 * released) / 10 + 0.3, np.floor(10 * braked) / 10 - 0.2
    assert end_s - start_s > 0.7 * COAST_S
    flown = plan_flight(load_scenario(tmp_path / state["replay"]), n=1).flight
    first, last = flown.state(start_s), flown.state(end_s)
    relative = np.array(first.relative_eci_m), np.array(first.relative_eci_m_s)
    target = np.array(first.r_target_eci_m), np.array(first.v_target_eci_m_s)
    truth = propagate(*target, end_s - start_s + 1.0, session.flight.orbit.forces, relative)
    place, velocity = truth.relative(end_s - start_s)
    np.testing.assert_allclose(last.relative_eci_m, place, atol=1e-3)
    np.testing.assert_allclose(last.relative_eci_m_s, velocity, atol=2e-5)
