"""Closed loops on rendered images without a link: the estimator runs in this process, and its errors are recorded.

    python -m tools.studies.drawn_loop OUT --seeds 9000-9007 --pose truth --any-view   # on the truth
    python -m tools.studies.drawn_loop OUT --seeds 7000-7004               # on the estimator's poses
    python -m tools.studies.drawn_loop OUT --seeds 71401-71410 --pose truth --any-view --any-light

With ``--any-light`` the orbit's node and anomaly, hence the Sun, and the exposure time are random.
Each flight writes ``OUT/SCENARIO-SEED.npz``: its outcome, and time, true pose and measured pose of every image.
"""

from __future__ import annotations

import argparse
import time
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import msgspec
import numpy as np

from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.methods import make_estimator
from flyaround.hil.evaluate.greyscale import grey
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.hil.host.closed_loop_run import scene_at_snapshot
from flyaround.hil.host.pose_link import LATENCY_S
from flyaround.hil.navigation.closed_loop import ClosedLoop, ClosedLoopConfig, ClosedLoopResult
from flyaround.hil.navigation.measurement import PoseNoise, Snapshot
from flyaround.hil.navigation.pose_sources import PoseQueue, SimulatedPoses
from flyaround.simulator.frame import Frame
from flyaround.simulator.loop import FrameRequest, open_frames
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import Plan, plan_flight
from flyaround.simulator.world.orbit.initial_orbit import ElementsOrbit

if TYPE_CHECKING:
    from flyaround.hil.board.estimation import Estimator
    from flyaround.simulator.loop import FrameProducer
    from flyaround.simulator.scenario.scenario import Scenario

SCENARIOS = ("tango-vbar-closed-loop", "tango-vbar-closed-loop-tumble")


class DrawnPoses(PoseQueue):
    """A pose source that renders an image and runs the estimator on it; every answer is recorded.

    Parameters
    ----------
    plan : Plan
        Plan of the flight.
    draw : FrameProducer
        Renderer of frames.
    estimator : Estimator
        The board's estimator.
    """

    def __init__(self, plan: Plan, draw: FrameProducer[Frame], estimator: Estimator) -> None:
        super().__init__(lambda _number, _t_s: LATENCY_S)
        self._plan, self._draw, self._estimator = plan, draw, estimator
        self.looks: list[Snapshot] = []
        self.answers: list[tuple[bool, np.ndarray, np.ndarray, np.ndarray]] = []

    def expose(self, snapshot: Snapshot) -> None:
        """Render an image, estimate its pose and record the answer."""
        self._draw.submit(
            FrameRequest(scene=scene_at_snapshot(self._plan, snapshot, len(self.looks)), labels=False)
        )
        result = self._estimator.estimate(grey(self._draw.result().image), None, snapshot.t_s)
        q, t = result.q_camera_from_target_wxyz, result.t_camera_from_target_m
        covariance = result.covariance
        nothing = np.full(7, np.nan)
        q, t = (nothing[:4], nothing[4:]) if q is None or t is None else (np.asarray(q), np.asarray(t))
        self.looks.append(snapshot)
        self.answers.append(
            (bool(result.accepted), q, t, np.full((6, 6), np.nan) if covariance is None else covariance)
        )
        if result.accepted:
            self.put(0, PoseNoise().measured(snapshot.t_s, q, t, snapshot.q_camera_from_eci_wxyz))


def planned(scenario: str, seed: int, *, any_view: bool, any_light: bool = False) -> Plan:
    """Return the plan of a flight, with a random attitude of the target at the start, and random light, if asked."""
    flown = load_scenario(scenario)
    if any_view:
        q = np.random.default_rng([seed, 2]).standard_normal(4)
        q_wxyz = tuple(float(x) for x in q / np.linalg.norm(q))
        flown = replace_attitude(flown, q_wxyz)
    return plan_flight(relit(flown, seed) if any_light else flown, n=1, seed=seed)


def relit(scenario: Scenario, seed: int) -> Scenario:
    """Return the scenario with another direction to the Sun, and half to two and a half times the exposure."""
    rng = np.random.default_rng([seed, 3])
    assert isinstance(scenario.orbit, ElementsOrbit)  # noqa: S101 - that of both SCENARIOS
    orbit = msgspec.structs.replace(
        scenario.orbit,
        raan_deg=scenario.orbit.raan_deg + rng.uniform(-50, 50),
        true_anomaly_deg=scenario.orbit.true_anomaly_deg + rng.uniform(-60, 40),
    )
    exposure_s = scenario.sensor.exposure_s * 2 ** rng.uniform(-1, 1.3)
    sensor = msgspec.structs.replace(scenario.sensor, exposure_s=exposure_s)
    return msgspec.structs.replace(scenario, orbit=orbit, sensor=sensor)


def replace_attitude(scenario: Scenario, q_wxyz: tuple[float, ...]) -> Scenario:
    """Return the scenario with another initial attitude of the target."""
    attitude = msgspec.structs.replace(scenario.attitude, q_wxyz=q_wxyz, euler_deg=None)
    return msgspec.structs.replace(scenario, attitude=attitude)


def fly(plan: Plan, draw: FrameProducer[Frame], pose: str) -> tuple[ClosedLoopResult, DrawnPoses]:
    """Simulate one flight; with ``pose`` "truth" the loop uses the true poses, and the estimator only records."""
    intrinsics = CameraIntrinsics.from_dict(msgspec.to_builtins(plan.camera))
    drawn = DrawnPoses(plan, draw, make_estimator(board_model(plan.target), intrinsics))
    true = SimulatedPoses(PoseNoise().true_pose, lambda _number, _t_s: LATENCY_S)
    mass = plan.target.mass
    flown_on = true.available if pose == "truth" else drawn.available
    loop = ClosedLoop(plan.flight, mass.com_m, mass.inertia_kg_m2, flown_on, ClosedLoopConfig(seed=plan.seed))
    for picture in loop.pictures():
        drawn.expose(picture)
        true.expose(picture)
    return loop.result(), drawn


def write(path: Path, result: ClosedLoopResult, drawn: DrawnPoses) -> None:
    """Write a flight as arrays: steps of the loop, images and answers."""
    steps, looks = result.steps, drawn.looks
    nothing = np.full(12, np.nan)
    accepted, q, t, covariance = zip(*drawn.answers, strict=True)
    data = BytesIO()
    np.savez_compressed(
        data,
        outcome=result.outcome,
        reason=result.reason,
        final=np.array(
            [result.final_error_m, result.final_error_deg, result.min_range_m, result.delta_v_m_s]
        ),
        violations=result.keep_out_violations,
        t_s=np.array([s.t_s for s in steps]),
        state_lvlh=np.array([[*s.position_lvlh_m, *s.velocity_lvlh_m_s] for s in steps]),
        commanded=np.array([s.commanded_lvlh_m_s for s in steps]),
        phase=np.array([s.phase for s in steps]),
        error=np.array([nothing if s.error is None else s.error for s in steps]),
        variance=np.array(
            [nothing if s.estimate is None else np.diag(s.estimate.covariance)[:12] for s in steps]
        ),
        nees=np.array([np.nan if s.nees is None else s.nees for s in steps]),
        look_s=np.array([s.t_s for s in looks]),
        q_camera_from_eci=np.array([s.q_camera_from_eci_wxyz for s in looks]),
        true_q=np.array([s.pose()[0] for s in looks]),
        true_t=np.array([s.pose()[1] for s in looks]),
        accepted=np.array(accepted),
        q=np.array(q),
        t=np.array(t),
        covariance=np.array(covariance),
    )
    write_atomic(path, data.getvalue())


def seeds_of(text: str) -> range:
    """Parse ``FIRST-LAST``."""
    first, last = (int(x) for x in text.split("-"))
    return range(first, last + 1)


def main() -> None:
    """Simulate the requested flights except those whose file exists."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seeds", default="9000-9003", help="FIRST-LAST")
    parser.add_argument("--scenarios", nargs="*", default=SCENARIOS)
    parser.add_argument("--pose", choices=("truth", "board"), default="board")
    parser.add_argument("--any-view", action="store_true")
    parser.add_argument("--any-light", action="store_true")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    options.out.mkdir(parents=True, exist_ok=True)
    with open_frames(Frame.image_and_truth, processes=1, ahead=1) as draw:
        for seed in seeds_of(options.seeds):
            for scenario in options.scenarios:
                path = options.out / f"{scenario}-{seed}.npz"
                if path.exists():
                    continue
                since = time.monotonic()
                plan = planned(scenario, seed, any_view=options.any_view, any_light=options.any_light)
                result, drawn = fly(plan, draw, options.pose)
                write(path, result, drawn)
                nees = np.array([s.nees for s in result.steps[20:] if s.nees is not None])
                print(
                    f"{path.stem}: {result.outcome} {result.reason} at {1e3 * result.final_error_m:.1f} mm, "
                    f"{result.final_error_deg:.2f} deg; {sum(a[0] for a in drawn.answers)} of {len(drawn.looks)}; "
                    f"NEES {nees.mean() if len(nees) else np.nan:.1f}; {time.monotonic() - since:.0f} s",
                    flush=True,
                )


if __name__ == "__main__":
    main()
