"""The errors that the filter takes a board's poses to have: measured by an evaluation, and the filter runs on them."""

import json

import numpy as np
import pytest

from flyaround.hil.evaluate.metrics import summarise
from flyaround.hil.evaluate.pose_errors import frame_record
from flyaround.hil.host.measurement_noise import read_pose_noise
from flyaround.hil.navigation.measurement import PoseNoise
from flyaround.hil.navigation.pose_sources import PoseErrors
from flyaround.simulator.errors import UserError


def records(noise, n, rng):
    """Answers of an estimator with known errors beside the truth."""
    from flyaround.hil.navigation.measurement import Snapshot

    errors = PoseErrors(noise, rng)
    for _ in range(n):
        q = rng.normal(size=4)
        look = Snapshot(
            t_s=0.0,
            position_eci_m=np.array([0.0, 0.0, -rng.uniform(3.0, 9.0)]),
            velocity_eci_m_s=np.zeros(3),
            q_camera_from_eci_wxyz=np.array([1.0, 0.0, 0.0, 0.0]),
            omega_camera_rad_s=np.zeros(3),
            q_eci_from_target_wxyz=q / np.linalg.norm(q),
            com_target_m=np.zeros(3),
        )
        truth = look.pose()
        told = errors.draw(look)
        yield frame_record(
            *truth,
            None if told is None else told.q_camera_from_target_wxyz,
            None if told is None else told.t_camera_from_target_m,
            accepted=told is not None,
        )


def test_the_spread_of_known_errors_is_found_and_read_back(tmp_path):
    noise = PoseNoise(
        across_m=0.0,
        across_share=0.01,
        along_share=0.05,
        tilt_rad=0.12,
        roll_rad=0.06,
        correlated_share=0.0,
        available=0.8,
        wrong=0.02,
    )
    metrics = summarise(list(records(noise, 1500, np.random.default_rng(0))))
    assert metrics.spread is not None
    path = tmp_path / "metrics.json"
    import msgspec

    path.write_bytes(msgspec.json.encode(metrics))
    read = read_pose_noise(path)
    for name in ("across_share", "along_share", "tilt_rad", "roll_rad"):
        assert getattr(read, name) == pytest.approx(getattr(noise, name), rel=0.1)
    assert metrics.spread.available == pytest.approx(0.8, abs=0.04)
    assert metrics.spread.wrong == pytest.approx(0.02, abs=0.015)


def test_few_poses_have_no_spread_and_other_files_are_refused(tmp_path):
    few = summarise(list(records(PoseNoise(), 5, np.random.default_rng(1))))
    assert few.spread is None
    path = tmp_path / "metrics.json"
    for text, says in (
        (json.dumps({"spread": None}), "ten accepted"),
        ("{}", "ten accepted"),
        ("[1]", "damaged"),
        ("[" * 100_000, "nests"),
        (
            json.dumps(
                {
                    "spread": dict.fromkeys(
                        ("across_share", "along_share", "tilt_rad", "roll_rad", "available", "wrong"), 1e9
                    )
                }
            ),
            "allowed",
        ),
    ):
        path.write_text(text)
        with pytest.raises(UserError, match=says):
            read_pose_noise(path)
    with pytest.raises(UserError, match="cannot be read"):
        read_pose_noise(tmp_path / "none.json")


def test_the_filter_is_better_than_the_coarse_poses_that_it_runs_on():
    """Poses as a small network's, 7 degrees and 5 % off: fused over a flight, with their errors told."""
    from flyaround.hil.navigation.closed_loop import ClosedLoopConfig, fly_closed_loop
    from flyaround.hil.navigation.pose_sources import SimulatedPoses
    from flyaround.simulator.scenario.load import load_scenario
    from flyaround.simulator.scenario.plan import plan_flight

    noise = PoseNoise(
        across_m=0.0, across_share=0.01, along_share=0.03, tilt_rad=0.12, roll_rad=0.06, correlated_share=0.2
    )
    plan = plan_flight(load_scenario("tango-vbar-closed-loop"), n=2)
    result = fly_closed_loop(
        plan.flight,
        plan.target.mass.com_m,
        plan.target.mass.inertia_kg_m2,
        SimulatedPoses(PoseErrors(noise, np.random.default_rng([1, 0])).draw, lambda *_: 0.3),
        ClosedLoopConfig(seed=1),
    )
    known = [step.error for step in result.steps if step.error is not None]
    late = known[len(known) // 2 :]
    assert len(late) > 50
    # of the turn about each axis
    assert np.sqrt(np.mean([e[6:9] ** 2 for e in late])) < 0.5 * noise.tilt_rad
