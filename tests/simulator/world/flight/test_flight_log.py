"""A flight's phases, thrust, propellant and events against its tracks, and in the table of `fly`."""

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest

from flyaround.__main__ import run
from flyaround.cli import flights
from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.world.flight.export import fly_table, summarise_flight
from flyaround.simulator.world.flight.log import FlightLog
from flyaround.simulator.world.guidance.paths import VbarApproach, Waypoints

HEAD = """
epoch_utc = "2026-03-21T10:00:00Z"
duration_s = {duration}
[orbit]
kind = "elements"
altitude_km = 700.0
"""
# the corridor is on the other side: the chaser breaks off where it comes in
ABORT = (
    HEAD.format(duration=300)
    + """
[chaser]
mode = "vbar"
start_m = -20.0
hold_m = -4.0
speed_m_s = 0.1
[chaser.thrusters]
mass_kg = 100.0
specific_impulse_s = 200.0
[chaser.keep_out]
radius_m = 10.0
corridor_axis_lvlh = [1.0, 0.0, 0.0]
corridor_half_angle_deg = 15.0
"""
)
STEERED = (
    HEAD.format(duration=120)
    + """
[chaser]
mode = "steered"
position_lvlh_m = [0.0, -20.0, 0.0]
commands = [{ start_s = 10.0, duration_s = 20.0, acceleration_m_s2 = [0.0, 0.03, 0.0] }]
[chaser.keep_out]
radius_m = 10.0
"""
)
BURNS = (
    HEAD.format(duration=100)
    + """
[chaser]
mode = "drift"
position_lvlh_m = [0.0, -30.0, 0.0]
[[burns]]
craft = "chaser"
start_s = 10.0
delta_v_lvlh_m_s = [0.0, 0.03, 0.04]
[[burns]]
craft = "chaser"
start_s = 40.0
duration_s = 20.0
delta_v_lvlh_m_s = [0.1, 0.0, 0.0]
[[burns]]
craft = "target"
start_s = 50.0
delta_v_lvlh_m_s = [0.0, 0.2, 0.0]
"""
)


def _flight(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    return plan_flight(load_scenario(path), n=1).flight


def test_an_abort_is_in_the_table_and_in_the_summary(tmp_path):
    flight = _flight(tmp_path, ABORT)
    rows = fly_table(flight, np.arange(0.0, 301.0))
    summary = summarise_flight(flight, rows)
    assert summary["aborted"]
    at = summary["abort_s"]
    assert at == flight.controlled.abort_s
    assert [p["phase"] for p in summary["phases"]] == ["cruise", "retreat", "drift"]
    assert summary["phases"][1]["from_s"] == at
    said = {row["t_s"]: row["events"] for row in rows if row["events"]}
    assert said[at].startswith("abort 10.0")
    assert [e["kind"] for e in summary["events"]] == ["abort", "retreated"]
    assert summary["min_range_m"] == min(row["range_m"] for row in rows)


def test_thrust_mass_and_delta_v_agree_with_each_other(tmp_path):
    flight = _flight(tmp_path, ABORT)
    rows = fly_table(flight, np.arange(0.0, 301.0))
    a = np.array([[row[f"thrust_acceleration_lvlh_{x}_m_s2"] for x in "xyz"] for row in rows], float)
    force = np.array([[row[f"thrust_lvlh_{x}_n"] for x in "xyz"] for row in rows], float)
    mass = np.array([row["mass_kg"] for row in rows], float)
    given = np.array([row["delta_v_m_s"] for row in rows], float)
    # periods of a second, rows of a second: each row's thrust is held to the next
    assert np.allclose(np.diff(given), np.linalg.norm(a[:-1], axis=1), rtol=0, atol=1e-12)
    assert given[-1] == pytest.approx(flight.controlled.delta_v_m_s, abs=1e-12)
    assert np.allclose(-np.diff(mass), np.abs(force[:-1]).sum(axis=1) / (200.0 * 9.80665), rtol=0, atol=1e-12)
    # the retreat goes straight outward, at the edge of what a newton of force can do
    k = int(flight.controlled.abort_s)
    assert a[k, 1] < -0.009
    summary = summarise_flight(flight, rows)
    assert summary["propellant_kg"] == pytest.approx(mass[0] - mass[-1], abs=1e-12)
    assert summary["delta_v_m_s"] == given[-1]


def test_every_column_is_documented_and_no_other(tmp_path):
    page = (Path(__file__).parents[4] / "docs" / "formats" / "states.md").read_text()
    documented = []
    for cell in re.findall(r"^\| (`.*?`) \|", page.split("| `phase` | |")[0], re.MULTILINE):
        for name in re.findall(r"`([^`]+)`", cell):
            start, axes, end = re.fullmatch(r"(\w+?)(?:\{([\w,]+)\})?(\w*)", name).groups()
            documented += [f"{start}{axis}{end}" for axis in (axes or "").split(",")]
    assert list(fly_table(_flight(tmp_path, ABORT), [0.0])[0]) == documented


def test_a_guard_that_overrules_is_told_where_it_does(tmp_path):
    flight = _flight(tmp_path, STEERED)
    log = FlightLog(flight)
    assert [log.thrust_state(t).phase for t in (5.0, 12.0)] == ["coast", "commanded"]
    assert log.thrust_state(12.0).acceleration_lvlh_m_s2 == pytest.approx((0.0, 0.03, 0.0), abs=1e-9)
    assert log.thrust_state(12.0).delta_v_m_s == pytest.approx(0.06, abs=1e-9)
    guarded = [e for e in log.events() if e.kind == "guarded"]
    assert guarded[0].t_s == flight.scripted.guarded_s
    assert log.thrust_state(guarded[0].t_s).phase == "guarded"


def test_burns_count_and_the_targets_are_not_the_chasers(tmp_path):
    flight = _flight(tmp_path, BURNS)
    log = FlightLog(flight)
    assert [log.thrust_state(t).delta_v_m_s for t in (5.0, 20.0, 50.0, 90.0)] == pytest.approx(
        [0.0, 0.05, 0.1, 0.15]
    )
    assert log.thrust_state(50.0).acceleration_lvlh_m_s2 == pytest.approx((0.005, 0.0, 0.0))
    assert (log.thrust_state(50.0).phase, log.thrust_state(90.0).phase) == ("burn", "drift")
    assert [(e.t_s, e.kind) for e in log.events()] == [
        (10.0, "burn"),
        (40.0, "burn"),
        (50.0, "burn"),
        (60.0, "burn_end"),
    ]


def test_a_path_that_is_followed_exactly_has_no_budget():
    flight = plan_flight(load_scenario("tango-flyaround"), n=1).flight
    row = fly_table(flight, [0.0])[0]
    assert (row["phase"], row["delta_v_m_s"], row["mass_kg"]) == ("flyaround", None, None)


def test_the_targets_way_through_shadow_is_an_event():
    log = FlightLog(plan_flight(load_scenario("tango-flyaround"), n=1).flight)
    events = log.events((0.0, 1.0, 2.0, 3.0, 4.0), (1.0, 0.3, 0.0, 0.0, 0.2))
    assert [(e.t_s, e.kind) for e in events] == [(2.0, "shadow"), (4.0, "sunlight")]


def test_phases_of_a_line_and_of_waypoints():
    line = VbarApproach(start_m=-20, hold_m=-10, speed_m_s=0.1)
    # 0.1 m/s are taken off in 20 s, over the last metre
    assert [line.phase(t) for t in (0.0, 89.0, 95.0, 111.0)] == ["cruise", "cruise", "braking", "hold"]
    short = VbarApproach(start_m=-10.5, hold_m=-10, speed_m_s=0.1)
    assert [short.phase(t) for t in (0.0, 1.0, 15.0)] == ["cruise", "braking", "hold"]
    tour = Waypoints(points_lvlh_m=((0, -20, 0), (0, -10, 0), (10, -10, 0)), speed_m_s=1.0, rest_s=5.0)
    assert [tour.phase(t) for t in (1.0, 9.0, 17.0, 25.0, 31.0)] == [
        "rest 1",
        "leg 1",
        "rest 2",
        "leg 2",
        "hold",
    ]


def test_fly_says_what_happened_and_replaces_nothing_unasked(tmp_path, capsys, monkeypatch):
    scenario, out = tmp_path / "abort.toml", tmp_path / "flight"
    scenario.write_text(ABORT)
    assert run(["fly", str(scenario), "-o", str(out)]) == 0
    said = capsys.readouterr().out
    assert "phases: cruise 0 to " in said
    assert "abort 10.0" in said
    assert "kg of propellant from 100 kg" in said
    before = (out / "states.csv").read_bytes()
    rows = list(csv.DictReader(before.decode().splitlines()))
    assert rows[-1]["phase"] == "drift"

    assert run(["fly", str(scenario), "-o", str(out), "--every", "10"]) == 2
    assert "replace an earlier flight with --overwrite" in " ".join(capsys.readouterr().err.split())
    assert (out / "states.csv").read_bytes() == before
    assert run(["fly", str(scenario), "-o", str(out), "--every", "10", "--overwrite", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["rows"], summary["aborted"]) == (31, True)
    # what is replaced is there until what replaces it can be written
    assert run(["fly", str(scenario), "-o", str(out), "--overwrite", "--oem"]) == 0
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    assert "target.oem" in before
    with monkeypatch.context() as patch:
        patch.setattr(flights, "record", _refused)
        assert run(["fly", str(scenario), "-o", str(out), "--every", "5", "--overwrite", "--record"]) == 2
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    assert run(["fly", str(scenario), "-o", str(out), "--every", "10", "--overwrite"]) == 0
    assert sorted(path.name for path in out.iterdir()) == ["run.toml", "scenario.json", "states.csv"]
    # what another put there is never taken away
    before = (out / "states.csv").read_bytes()
    (out / "mine.txt").write_text("keep")
    assert run(["fly", str(scenario), "-o", str(out), "--overwrite"]) == 2
    assert "mine.txt" in capsys.readouterr().err
    assert (out / "states.csv").read_bytes() == before


def _refused(*_):
    raise UserError("no")
