"""The goals of bench combinations, and the combinations it times."""

from __future__ import annotations

from dataclasses import replace

import pytest

from flyaround.simulator.bench.scenes import BenchMachine
from flyaround.simulator.errors import UserError
from tools.bench.combinations import CombinationCost, bench_combinations, goals_of
from tools.bench.combinations_page import combinations_page

BASE = CombinationCost(
    scenario="tango-earth-10m",
    camera="speed",
    bands="mono",
    variant="",
    width_px=1920,
    height_px=1200,
    frame_ms=60.0,
    render_ms=50.0,
    sensor_ms=3.0,
    labels_ms=10.0,
    capture_ms=100.0,
    reference_ms=60.0,
)


def test_goals_name_the_worst_combination_and_compare_within_the_run() -> None:
    costs = (
        BASE,
        replace(BASE, camera="speedplus", frame_ms=72.0, capture_ms=180.0),
        replace(BASE, scenario="tango-night", frame_ms=180.0),
        replace(BASE, scenario="lunar-orbit", frame_ms=90.0),
        replace(BASE, scenario="tango-close-3m", frame_ms=900.0),  # left out of its goal
        replace(BASE, bands="rgb", frame_ms=84.0),
        replace(BASE, variant="bits 12", frame_ms=66.0),
        replace(BASE, variant="sensor thesis", frame_ms=600.0),  # eight bits
        replace(BASE, variant="target tianzhou", frame_ms=96.0),
        replace(BASE, camera="fisheye-140", frame_ms=120.0),
        replace(BASE, camera="paper", frame_ms=100.0),
    )
    goals = {g.name: g for g in goals_of(costs)}
    scenarios = goals["a scenario but at 3 m, beside tango-earth-10m"]
    assert scenarios.measured == pytest.approx(3.0)
    assert (scenarios.worst, scenarios.met) == ("tango-night speed mono", False)
    measured = {name: (round(g.measured, 3), g.met) for name, g in goals.items()}
    assert measured["speedplus beside speed, frame"] == (1.2, True)
    assert measured["speedplus beside speed, captured"] == (1.8, False)
    assert measured["fisheye-140 beside a pinhole of its size"] == (1.2, True)
    assert measured["rgb beside mono"] == (1.4, True)
    assert measured["10 to 16 bits beside 8"] == (1.1, True)
    assert measured["a craft of 100,000 triangles beside Tango"] == (1.6, False)
    assert measured["captured tango-earth-10m, speed"] == (100.0, True)
    assert measured["captured tango-earth-10m, speedplus"] == (180.0, False)


def test_the_page_has_each_time_once_and_says_what_was_missed() -> None:
    costs = (
        BASE,
        replace(BASE, bands="rgb", frame_ms=84.0),
        replace(BASE, scenario="tango-night", frame_ms=181.0),
        replace(BASE, variant="bits 12", frame_ms=66.0),
    )
    page = combinations_page(
        BenchMachine(gl_renderer="llvmpipe", gl_version="4.5", threads=2),
        costs,
        "python -m tools.bench combinations",
    )
    assert "| `tango-earth-10m` | 60 | 84 | 3 | 10 | 100 | 100 | 60 | 1.00 |" in page
    assert "| bits 12 | 66 | 3 | 10 | 100 | 1.10 |" in page
    assert "`tango-night speed mono` | 1.7 x | 3.02 | **missed** |" in page
    # every table's rows are as long as its head
    tables = [line.count("|") for line in page.splitlines() if line.startswith("|")]
    assert set(tables) == {6, 7, 10}


def test_without_the_base_scenario_there_are_no_goals() -> None:
    assert goals_of((replace(BASE, scenario="tango-night"),)) == ()


def test_a_scenario_that_is_none_is_refused() -> None:
    with pytest.raises(UserError, match="unknown scenario 'tango-earth' in --scene"):
        bench_combinations(("tango-earth",))


@pytest.mark.slow
def test_every_camera_and_variant_of_the_base_scenario_is_timed() -> None:
    _, costs = bench_combinations(("tango-earth-10m",), n_frames=2)
    assert len(costs) == 5 * 2 + 4 + 3 + 1
    assert all(c.frame_ms > 0 and c.capture_ms > 0 and c.reference_ms > 0 for c in costs)
    assert len(goals_of(costs)) == 8
