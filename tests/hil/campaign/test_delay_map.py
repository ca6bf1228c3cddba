"""Delay maps: a link by the flight's clock, intervals and halves by other means, the same bytes after a kill."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from flyaround.__main__ import run
from flyaround.hil.campaign.delay_map import map_delays, settings_for
from flyaround.hil.campaign.map_results import CellResult, HalfLatency
from flyaround.hil.evaluate.metrics import wilson_interval
from flyaround.hil.host.pose_link import PoseLink
from flyaround.hil.navigation.measurement import PoseNoise
from flyaround.hil.navigation.pose_sources import SimulatedPoses
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.folder_lock import only_writer
from flyaround.simulator.scenario.faults import Delay, Drop, Faults, Jitter

SCENARIO = "tango-vbar-closed-loop"


def words(out, *more):
    few = ("--latency", "5,5.2", "--jitter", "0", "--drops", "0,0.1", "-n", "1")
    return ["hil", "delay-map", SCENARIO, "-o", str(out), *few, *more]


def cell(latency, good, n=20):
    low, high = wilson_interval(good, n)
    return CellResult(latency_s=latency, jitter_s=0, drops=0, flights=n, successes=good, low=low, high=high)


@pytest.mark.parametrize(
    ("good", "at", "above", "below", "words"),
    [
        ([20, 15, 5, 0], 2.5, 2, 3, "2.5 s (2 to 3)"),
        # 11 of 20 is more than a half, but may be less
        ([20, 11, 9, 0], 2.5, 1, 4, "2.5 s (1 to 4)"),
        # a share that rises again is pooled with the one before it
        ([20, 9, 13, 0], 3 + 1 / 11, 1, 4, "3.09 s (1 to 4)"),
        ([20, 18], None, 2, None, "above 2 s"),
        ([2, 0], None, None, 1, "below 1 s"),
    ],
)
def test_the_half_lies_between_the_levels_next_to_it(good, at, above, below, words):
    half = HalfLatency.from_row([cell(k + 1, n) for k, n in enumerate(good)])
    assert half.latency_s == (None if at is None else pytest.approx(at))
    assert (half.above_s, half.below_s, half.words) == (above, below, words)


def test_a_link_delays_keeps_order_and_loses_by_the_flights_clock():
    class At:
        """A moment of a flight, as a source of poses sees it."""

        def __init__(self, t_s):
            self.t_s = t_s
            self.q_camera_from_eci_wxyz = np.array([1.0, 0.0, 0.0, 0.0])

        def pose(self):
            return np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 10.0])

    faults = Faults(
        line=(Delay(delay_ms=500.0, start_s=5.0), Jitter(most_ms=3000.0), Drop(chance=0.3, end_s=40.0)),
        seed=4,
    )
    link = PoseLink.without_pictures(faults)
    poses = SimulatedPoses(PoseNoise().true_pose, link.delay_s)
    came: dict[float, float] = {}
    for t in np.arange(0.0, 80.0, 0.1):
        if abs(t - round(t)) < 1e-6 and t < 60.0:
            poses.expose(At(float(round(t))))
        for pose in poses.available(float(t)):
            assert pose.t_s not in came
            came[pose.t_s] = float(t)
    assert list(came) == sorted(came)
    ages = np.array([came[t] - t for t in came])
    assert ages.min() >= 0.3 - 1e-6
    # behind one that was late, no more than the longest delay
    assert ages.max() < 0.3 + 0.5 + 3.0 + 0.11
    assert 5 <= sum(t not in came for t in range(40)) <= 20
    assert all(float(t) in came for t in range(40, 60))
    # by the picture's number alone
    assert [link.delay_s(k, 50.0) for k in (3, 1)] == [link.delay_s(k, 50.0) for k in (3, 1)]
    assert link.delay_s(3, 50.0) != link.delay_s(1, 50.0)


def test_a_map_is_flown_refined_and_the_same_after_a_kill(tmp_path):
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    assert run(words(whole)) == 0
    told = json.loads((whole / "delay_map.json").read_text())
    assert [(c["latency_s"], c["drops"], c["successes"]) for c in told["cells"]] == [
        (5.0, 0.0, 1),
        (5.2, 0.0, 0),
        (5.0, 0.1, 1),
        (5.2, 0.1, 0),
    ]
    # guidance holds where no pose is younger than five seconds
    assert [c["latency_s"] for c in told["refined"]] == [5.1]
    assert told["half"][0]["latency_s"] == pytest.approx(5.05)
    assert (whole / "delay_map.png").stat().st_size > 20_000
    process = subprocess.Popen([sys.executable, "-m", "flyaround", *words(killed)], stderr=subprocess.DEVNULL)
    table, until = killed / "flights.csv", time.monotonic() + 120
    while time.monotonic() < until and not (table.exists() and table.read_text().count("\n") > 1):
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert not (killed / "delay_map.json").exists()
    with table.open("a") as file:
        file.write("5.2,0,0.1")  # a line that was not written to its end
    assert run(words(killed, "--workers", "2")) == 0
    names = sorted(p.name for p in whole.iterdir())
    assert names == sorted(p.name for p in killed.iterdir())
    assert [n for n in names if (whole / n).read_bytes() != (killed / n).read_bytes()] == []


def test_a_map_that_is_refused_takes_nothing_away_from_the_one_that_is_flown(tmp_path, monkeypatch):
    monkeypatch.setattr(
        "flyaround.hil.campaign.delay_map.fly_cells",
        lambda path, tasks, _w, _p: path.touch() or [(t.cell, False) for t in tasks],
    )
    one = settings_for(SCENARIO, latencies_s=(2,), jitters_s=(0,), drops=(0,), flights=2, check=1)
    map_delays(one, tmp_path / "m", board_command=("x",))
    checks = tmp_path / "m" / "checks.csv"
    other = settings_for(
        SCENARIO, latencies_s=(2,), jitters_s=(0,), drops=(0,), flights=2, check=1, check_flights=1
    )
    with only_writer(tmp_path / "m", "delay-map"), pytest.raises(UserError, match="another delay-map"):
        map_delays(other, tmp_path / "m", board_command=("x",))
    assert checks.exists()


@pytest.mark.parametrize(
    ("bears_s", "extended", "says"),
    [(7.2, (6.0, 8.0), "7.22 s (7.19 to 7.25)"), (99, (6.0, 8.0, 10.0, 12.0), "above 12 s")],
)
def test_a_range_in_which_nothing_fails_is_extended_or_that_is_said(
    tmp_path, monkeypatch, bears_s, extended, says
):
    def flown(_path, tasks, _workers, _progress):
        return [(t.cell, t.cell.latency_s + t.cell.jitter_s < bears_s) for t in tasks]

    monkeypatch.setattr("flyaround.hil.campaign.delay_map.fly_cells", flown)
    settings = settings_for(SCENARIO, latencies_s=(2, 4), jitters_s=(0, 1), drops=(0,), flights=20)
    outcome = map_delays(settings, tmp_path / "m", board_command=())
    assert outcome.extended == extended
    assert outcome.half[0].words == says
    page = (tmp_path / "m" / "index.html").read_text()
    assert says in page
    assert "Latencies added" in page


@pytest.mark.slow
@pytest.mark.gl
def test_a_cell_is_flown_again_with_a_board(tmp_path):
    few = ("--latency", "0.3", "--jitter", "0", "--drops", "0.2", "-n", "3", "--every", "4")
    more = ("--check", "1", "--check-flights", "1")
    assert run(["hil", "delay-map", SCENARIO, "-o", str(tmp_path / "m"), *few, *more]) == 0
    told = json.loads((tmp_path / "m" / "delay_map.json").read_text())["checked"][0]
    assert (told["without_pictures"]["successes"], told["drawn"]["successes"], told["agree"]) == (3, 1, True)


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (("--latency", "1,x"), "--latency is '1,x': give numbers"),
        (("--drops", "0,2"), "numbers from 0 to 1"),
        (("--jitter", "2,1"), "levels of --jitter must increase"),
        (("--jitter", "nan"), "--jitter is 'nan'"),
        (("--check", "9"), "more than the map's 4 cells"),
        (("--every", "0.7"), "not a multiple of the thrusters' control period"),
    ],
)
def test_mistakes_are_one_sentence(tmp_path, capsys, more, says):
    assert run(words(tmp_path / "m", *more)) == 2
    assert says in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "m").exists()


def test_a_scenario_without_a_path_and_a_folder_of_others(tmp_path, capsys):
    with pytest.raises(UserError, match="scenario lunar-orbit has no thrusters"):
        settings_for("lunar-orbit", latencies_s=(1,), jitters_s=(0,), drops=(0,), flights=1)
    (tmp_path / "mine.txt").write_text("keep")
    assert run(words(tmp_path)) == 2
    assert "is not empty" in capsys.readouterr().err
    assert sorted(p.name for p in tmp_path.iterdir()) == ["mine.txt"]
