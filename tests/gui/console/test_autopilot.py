"""Docking by commands alone, without a window: the example's script, and from 200 m in a hundred seeds."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from flyaround.gui.app import command_table
from flyaround.gui.command_table import CommandTable
from flyaround.gui.console import Console
from flyaround.gui.script import Script
from flyaround.simulator.piloting.autopilot import Autopilot
from flyaround.simulator.piloting.control_laws import COARSE_GAIN, FINE_GAIN
from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.scenario import Scenario
from flyaround.simulator.world.frames.rotation import quat_from_rotvec, quat_multiply
from flyaround.simulator.world.guidance.free_flight import FreeDrift
from tests.harness.flown_console import console_flying

EXAMPLES = Path(__file__).parents[3] / "examples"
SEEDS = 100
TICK_MS = 20
LONGEST_S = 3600.0


@pytest.fixture(scope="module")
def table() -> CommandTable:
    return command_table()


def console_of(scenario: Scenario, table: CommandTable) -> Console:
    return console_flying(scenario, table)


def test_the_example_docks_by_its_script(table: CommandTable) -> None:
    console = console_of(load_scenario(EXAMPLES / "docking.toml"), table)
    script = Script.read(EXAMPLES / "docking.script", table)
    console.play(script)
    while console.clock_ms < 60_000 and not console.session.craft.docking.contacts:
        console.pass_time(50)
    contact = console.session.craft.docking.contact
    assert contact is not None, console.messages
    assert contact.docked
    assert contact.score > 90
    assert [p.decision for p in console.session.craft.docking.hold_points.points] == ["go"] * 4
    assert len(console.log.lines) == len(script.lines)


def test_engaged_beside_the_axis_it_holds_on_the_axis(table: CommandTable) -> None:
    scenario = load_scenario(EXAMPLES / "docking.toml")
    chaser = msgspec.structs.replace(scenario.chaser, position_lvlh_m=(17.0, 5.0, 0.0), keep_out=None)
    console = console_of(msgspec.structs.replace(scenario, chaser=chaser), table)
    session = console.session
    docking = session.craft.docking
    assert 75.0 < docking.figures(session.craft.chaser, session.flight).off_axis_deg < 90.0
    console.do("docking.approach", True)
    console.do("time.rate", "10")
    while docking.not_ready(session.craft.chaser, session.flight):
        assert session.t_s < 1500.0, console.messages
        console.pass_time(100)
    figures = docking.figures(session.craft.chaser, session.flight)
    assert figures.axial_m == pytest.approx(10.0, abs=0.5)
    assert figures.off_axis_deg < docking.corridor_deg
    # and it waits there for a go
    for _ in range(120):
        console.pass_time(100)
    assert not docking.contacts
    assert [p.decision for p in docking.hold_points.points] == ["open", "open"]


def dispersed(seed: int) -> tuple[Scenario, np.ndarray, np.ndarray]:
    """Free flight from some 200 m, off the axis by metres, moving, turned away and turning."""
    rng = np.random.default_rng(seed)
    scenario = load_scenario(EXAMPLES / "docking.toml")
    place = np.array([0.0, 207.0, 0.0]) + rng.normal(0.0, (8.0, 5.0, 8.0))
    chaser = FreeDrift(
        position_lvlh_m=vec3(place),
        velocity_lvlh_m_s=vec3(rng.normal(0.0, 0.05, 3)),
        keep_out=scenario.chaser.keep_out,
        thrusters=None,
    )
    turned, turning = np.radians(rng.normal(0.0, 8.0, 3)), np.radians(rng.normal(0.0, 0.3, 3))
    return msgspec.structs.replace(scenario, chaser=chaser), turned, turning


def operate(console: Console, held: frozenset[str]) -> None:
    """A pilot who sees the figures and has the console's commands, and nothing else."""
    session = console.session
    docking, chaser = session.craft.docking, session.craft.chaser
    if docking.hold_points.next is not None and not docking.not_ready(chaser, session.flight):
        console.do("docking.go")
    console.pass_time(TICK_MS, held)


def dock_from_200_m(seed: int, table: CommandTable) -> Console:
    """Fly one seed by held keys alone; the attitude is a mode's."""
    scenario, turned, turning = dispersed(seed)
    console = console_of(scenario, table)
    session = console.session
    session.craft.take_over()
    start = session.craft.chaser
    session.craft.steered = replace(
        start,
        q_camera_from_eci_wxyz=quat(quat_multiply(quat_from_rotvec(turned), start.q_camera_from_eci_wxyz)),
        omega_camera_rad_s=vec3(turning),
    )
    console.do("steer.arm", True)
    console.do("steer.attitude", "dock")
    console.do("time.rate", "10")
    docking = session.craft.docking
    pilot = Autopilot(docking.port, docking.radius_m, docking.limits)
    while session.t_s < LONGEST_S and not docking.contacts:
        figures = docking.figures(session.craft.chaser, session.flight)
        point = docking.hold_points.next
        goal = None if point is None else point.axial_m
        demand = pilot.demand(figures, goal, TICK_MS / 1000 * session.clock.rate)
        gain = {COARSE_GAIN: ("coarse",), FINE_GAIN: ("fine",)}.get(demand.gain, ())
        operate(console, frozenset(f"steer.{name}" for name in (*demand.switches, *gain)))
    return console


@pytest.mark.slow
@pytest.mark.timeout(14_400)
def test_docks_from_200_m_in_a_hundred_of_a_hundred_seeds(table: CommandTable) -> None:
    began = time.process_time()
    scores, spent, took = [], [], []
    for seed in range(SEEDS):
        console = dock_from_200_m(seed, table)
        contact = console.session.craft.docking.contact
        assert contact is not None, f"seed {seed}: no contact within {LONGEST_S:g} s"
        assert contact.docked, f"seed {seed}: {contact.misses}"
        assert {p.decision for p in console.session.craft.docking.hold_points.points} == {"go"}
        scores.append(contact.score)
        spent.append(console.session.craft.steering.propellant.delta_v_m_s)
        took.append(contact.t_s)
    # said with pytest -rP
    print(  # noqa: T201
        f"{SEEDS} of {SEEDS} docked: score {min(scores)} to {max(scores)}, delta-v {np.mean(spent):.2f} m/s "
        f"(most {max(spent):.2f}), {np.mean(took):.0f} s (most {max(took):.0f}); "
        f"{time.process_time() - began:.0f} s of processor"
    )
