"""A closed loop without pictures: arrives on the truth and on noisy poses, holds and aborts where poses stay away."""

from collections import Counter
from functools import cache

import numpy as np
import pytest

from flyaround.hil.navigation.closed_loop import ClosedLoopConfig, fly_closed_loop
from flyaround.hil.navigation.consistency import nees_band
from flyaround.hil.navigation.measurement import PoseNoise
from flyaround.hil.navigation.pose_sources import PoseErrors, SimulatedPoses
from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.flight import fly
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.frames.rotation import rotvec_between

STEADY, TUMBLING = "tango-vbar-closed-loop", "tango-vbar-closed-loop-tumble"
LATENCY_S = 0.3


@cache
def flown(name):
    target = load_target("tango")
    return fly(load_scenario(name), target), target


def run(name, seed, noise):
    flight, target = flown(name)
    draw = PoseErrors(noise, np.random.default_rng([seed, 0])).draw if noise else PoseNoise().true_pose
    poses = SimulatedPoses(draw, lambda *_: LATENCY_S)
    return fly_closed_loop(
        flight, target.mass.com_m, target.mass.inertia_kg_m2, poses, ClosedLoopConfig(seed=seed)
    )


def arrives(result):
    return (
        result.outcome == "arrived"
        and result.final_error_m <= 0.2
        and result.final_error_deg <= 2.0
        and result.keep_out_violations == 0
    )


@pytest.mark.parametrize("name", [STEADY, TUMBLING])
def test_it_arrives_on_noisy_poses_and_on_the_truth(name):
    noisy = run(name, 3, PoseNoise())
    assert arrives(noisy), noisy.reason
    assert 2.5 < noisy.min_range_m < 3.1
    assert 0.1 < noisy.delta_v_m_s < 0.5
    # of the last step: where the camera looks, and how the target is taken to lie
    last, flight = noisy.steps[-1], flown(name)[0]
    assert last.estimate is not None
    lies = rotvec_between(last.estimate.q_eci_from_target_wxyz, flight.attitude(last.t_s)[0])
    wrong_rad = max(last.pointing_error_rad, float(np.linalg.norm(lies)))
    assert noisy.final_error_deg == pytest.approx(np.degrees(wrong_rad))
    assert arrives(run(name, 3, None))


def test_the_same_seed_is_the_same_flight():
    first, again, other = (run(TUMBLING, seed, PoseNoise()) for seed in (4, 4, 5))
    ends = [r.steps[-1].position_lvlh_m for r in (first, again, other)]
    assert np.array_equal(ends[0], ends[1])
    assert not np.array_equal(ends[0], ends[2])


def test_it_aborts_where_no_pose_ever_comes():
    result = run(STEADY, 0, PoseNoise(available=0.0))
    assert result.outcome == "aborted"
    assert result.delta_v_m_s == 0.0
    assert {step.phase for step in result.steps} == {"acquire", "abort"}


def test_a_flight_without_a_path_is_refused():
    target = load_target("tango")
    flight = fly(load_scenario("tango-tumble-3-18m"), target, 10.0)
    poses = SimulatedPoses(PoseNoise().true_pose, lambda *_: 0.0)
    with pytest.raises(UserError, match="no path for a closed loop"):
        fly_closed_loop(flight, target.mass.com_m, target.mass.inertia_kg_m2, poses)


@pytest.mark.slow
@pytest.mark.parametrize("name", [STEADY, TUMBLING])
def test_fifty_seeded_flights(name):
    """On seeds with which nothing was chosen."""
    noisy = [run(name, seed, PoseNoise()) for seed in range(3000, 3050)]
    arrived = [r for r in noisy if arrives(r)]
    assert len(arrived) >= 45, Counter(r.reason for r in noisy)
    assert {r.outcome for r in noisy} <= {"arrived", "aborted"}
    assert sum(r.keep_out_violations for r in noisy) == 0
    assert sum(arrives(run(name, seed, None)) for seed in range(3000, 3050)) == 50

    shortest = min(len(r.steps) for r in arrived)
    table = np.array([[np.nan if s.nees is None else s.nees for s in r.steps[20:shortest]] for r in arrived])
    mean = np.nanmean(table, axis=0)
    low, high = nees_band(len(arrived), 12)
    # one of twenty may be outside, and errors of neighbouring times go together
    assert np.mean((mean > low) & (mean < high)) >= 0.9
    assert low < float(np.mean(mean)) < high
