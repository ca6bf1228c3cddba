"""Five metres along the V-bar flown by keys, by a script, and the end compared with the world's own propagation."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from flyaround.gui.app import command_table
from flyaround.gui.script import Script
from flyaround.simulator.piloting.control_laws import ACCELERATION_M_S2
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.scenario.scenario import Scenario
from flyaround.simulator.world.guidance.free_flight import FreeDrift
from flyaround.simulator.world.orbit.burns import Burn
from tests.harness.flown_console import console_flying

START_M, MOVED_M = 15.0, -5.0
FINE = 0.2
SWITCH_PAIRS = (
    # begin [s], lasts [s], key, LVLH direction, strength; up holds the chaser on the line against the orbit's turn
    (1.0, 2.0, "back", (0.0, -1.0, 0.0), 1.0),
    (3.2, 0.56, "up", (1.0, 0.0, 0.0), FINE),
    (50.2, 0.56, "up", (1.0, 0.0, 0.0), FINE),
    (51.0, 2.0, "forward", (0.0, 1.0, 0.0), 1.0),
)
END_S = 60.0


def beside() -> Scenario:
    """At rest on the V-bar, 15 m ahead of the target; nothing keeps it there."""
    chaser = FreeDrift(position_lvlh_m=(0.0, START_M, 0.0), velocity_lvlh_m_s=(0.0, 0.0, 0.0))
    return msgspec.structs.replace(load_scenario("tango-flyaround"), chaser=chaser)


def script() -> str:
    lines = ["0.5 steer.lvlh on"]
    for from_s, lasts_s, key, _, strength in SWITCH_PAIRS:
        keys = [f"steer.{key}", *(["steer.fine"] if strength == FINE else [])]
        lines += [f"{from_s:.3f} hold {k}" for k in keys]
        lines += [f"{from_s + lasts_s:.3f} release {k}" for k in keys]
    return "\n".join(sorted(lines, key=lambda line: float(line.split()[0]))) + "\n"


@pytest.mark.parametrize("tick_ms", [20, 140])
def test_five_metres_along_the_v_bar_are_the_worlds_own_propagation(tmp_path: Path, tick_ms: int) -> None:
    table = command_table()
    console = console_flying(beside(), table)
    session = console.session
    (tmp_path / "vbar.script").write_text(script())
    played = Script.read(tmp_path / "vbar.script", table)
    console.play(played)
    while console.clock_ms < 1000 * END_S:
        console.pass_time(tick_ms)
    assert len(console.log.lines) == len(played.lines)
    flown = session.craft.world

    # the same pushes as burns of a scenario, by the propagator that flies it
    burns = tuple(
        Burn(
            craft="chaser",
            start_s=from_s,
            duration_s=lasts_s,
            delta_v_lvlh_m_s=tuple(strength * ACCELERATION_M_S2 * lasts_s * d for d in direction),  # type: ignore[arg-type]
        )
        for from_s, lasts_s, _, direction, strength in SWITCH_PAIRS
    )
    truth = plan_flight(
        msgspec.structs.replace(beside(), burns=burns, duration_s=END_S + 1.0), n=1
    ).flight.state(flown.t_s)
    np.testing.assert_allclose(flown.position_lvlh_m, truth.position_lvlh_m, atol=1e-3)
    np.testing.assert_allclose(flown.velocity_lvlh_m_s, truth.velocity_lvlh_m_s, atol=2e-5)
    # and it is the flight that was meant: five metres, on the line, at rest
    assert flown.position_lvlh_m[1] - START_M == pytest.approx(MOVED_M, abs=0.1)
    assert abs(flown.position_lvlh_m[0]) < 0.05
    assert abs(flown.position_lvlh_m[2]) < 1e-3
    assert np.linalg.norm(flown.velocity_lvlh_m_s) < 5e-3
    assert session.craft.steering.propellant.delta_v_m_s == pytest.approx(
        sum(strength * ACCELERATION_M_S2 * lasts_s for _, lasts_s, _, _, strength in SWITCH_PAIRS), rel=1e-3
    )
