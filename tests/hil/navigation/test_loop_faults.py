"""Boards that are blind, stand still or lie for a while: the chaser holds or gives up, says why, and stays outside."""

import csv
from dataclasses import replace

import numpy as np
import pytest

from flyaround.hil.host.closed_loop_run import STEPS_CSV, figures, write_steps
from flyaround.hil.navigation.closed_loop import ClosedLoopConfig, fly_closed_loop
from flyaround.hil.navigation.measurement import PoseMeasurement, PoseNoise
from flyaround.hil.navigation.pose_sources import PoseErrors, SimulatedPoses
from flyaround.simulator.scenario.flight import fly
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.frames.rotation import quat_from_rotvec, quat_multiply

LATENCY_S = 0.3
CONTRADICT = "poses contradict the estimate"
NONE = "no usable pose for 5 s"


class FaultyPoses(SimulatedPoses):
    """Noisy poses with a fault between two times."""

    def __init__(self, start_s, end_s):
        super().__init__(PoseErrors(PoseNoise(), np.random.default_rng([1, 0])).draw, lambda *_: LATENCY_S)
        self.between = start_s, end_s
        self.before: PoseMeasurement | None = None
        self.rng = np.random.default_rng(7)

    def put(self, number, pose):
        if self.between[0] <= pose.t_s < self.between[1]:
            changed = self.changed(pose)
            if changed is not None:
                super().put(number, changed)
            return
        self.before = pose
        super().put(number, pose)

    def changed(self, pose):
        return None


class Blind(FaultyPoses):
    """No pose comes."""


class Frozen(FaultyPoses):
    """The picture stands still, and so does its pose; only its time goes on."""

    def changed(self, pose):
        assert self.before is not None
        return replace(
            pose,
            q_camera_from_target_wxyz=self.before.q_camera_from_target_wxyz,
            t_camera_from_target_m=self.before.t_camera_from_target_m,
        )


class Turned(FaultyPoses):
    """Poses that agree with each other: turned by 30 degrees, the target a tenth nearer than it is."""

    def changed(self, pose):
        return replace(
            pose,
            q_camera_from_target_wxyz=quat_multiply(
                pose.q_camera_from_target_wxyz, quat_from_rotvec([0.0, 0.5, 0.0])
            ),
            t_camera_from_target_m=0.9 * pose.t_camera_from_target_m,
        )


class Anything(FaultyPoses):
    """Poses that agree with nothing."""

    def changed(self, pose):
        turn, shift = self.rng.standard_normal((2, 3))
        return replace(
            pose,
            q_camera_from_target_wxyz=quat_multiply(
                pose.q_camera_from_target_wxyz, quat_from_rotvec(2 * turn)
            ),
            t_camera_from_target_m=pose.t_camera_from_target_m + shift,
        )


def run(poses):
    target = load_target("tango")
    flight = fly(load_scenario("tango-vbar-closed-loop-tumble"), target)
    return fly_closed_loop(
        flight, target.mass.com_m, target.mass.inertia_kg_m2, poses, ClosedLoopConfig(seed=1)
    )


@pytest.mark.parametrize(
    ("kind", "reasons"),
    [(Blind, {NONE}), (Frozen, {NONE}), (Turned, {CONTRADICT}), (Anything, {CONTRADICT})],
)
def test_it_holds_through_a_fault_of_some_seconds_says_why_and_arrives(kind, reasons, tmp_path):
    last = 114.0 if kind in (Turned, Anything) else 120.0
    result = run(kind(100.0, last))
    assert result.outcome == "arrived", result.reason
    assert result.final_error_m < 0.2
    assert result.final_error_deg < 2.0
    assert result.keep_out_violations == 0
    held = [step for step in result.steps if step.phase == "hold"]
    assert {step.reason for step in held} == reasons
    assert 103.0 <= held[0].t_s <= 108.0
    assert last - 2.0 <= held[-1].t_s <= last + 3.0
    # it stays where it was
    assert np.linalg.norm(held[-1].position_lvlh_m - held[3].position_lvlh_m) < 0.3
    # the ledger says so
    write_steps(tmp_path, result.steps)
    rows = list(csv.DictReader((tmp_path / STEPS_CSV).read_text().splitlines()))
    assert {row["reason"] for row in rows if row["phase"] == "hold"} == reasons


@pytest.mark.parametrize("kind", [Blind, Frozen, Anything])
def test_it_gives_up_outward_where_the_fault_lasts(kind, tmp_path):
    result = run(kind(150.0, 1e9))
    assert result.outcome == "aborted"
    assert result.keep_out_violations == 0
    assert figures(result, "noisy", 1).reason == "no usable pose for 30 s"
    write_steps(tmp_path, result.steps)
    rows = list(csv.DictReader((tmp_path / STEPS_CSV).read_text().splitlines()))
    assert {row["reason"] for row in rows if row["phase"] == "abort"} == {"no usable pose for 30 s"}
    ranges = [float(np.linalg.norm(step.position_lvlh_m)) for step in result.steps]
    assert ranges[-1] > 24.0


def test_poses_that_all_agree_on_something_else_for_long_are_believed_and_do_no_harm():
    """Nobody can tell then which is right: the chaser flies by them, and never outside its corridor."""
    result = run(Turned(100.0, 160.0))
    assert result.outcome in {"arrived", "aborted"}
    assert result.keep_out_violations == 0
