"""Closed-loop flights for the host, guided by a board's poses on rendered images, or by the truth without images."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass, fields
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from flyaround.hil.host.frame_record import ACCEPTED, FrameRecord
from flyaround.hil.host.ledger.summary import ClosedLoopFigures, LedgerSummary, summarise
from flyaround.hil.host.pose_link import PoseLink
from flyaround.hil.navigation.closed_loop import (
    ClosedLoop,
    ClosedLoopConfig,
    ClosedLoopResult,
    check_closed_loop,
    fly_closed_loop,
)
from flyaround.hil.navigation.measurement import PoseNoise
from flyaround.hil.navigation.pose_sources import PoseErrors, PoseQueue, SimulatedPoses
from flyaround.simulator.errors import UserError
from flyaround.simulator.frame import Frame
from flyaround.simulator.loop import FrameRequest, open_frames
from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.runtime.table_text import table_bytes
from flyaround.simulator.runtime.untrusted_files import read_regular
from flyaround.simulator.world.guidance.manual_control import ChaserState

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from flyaround.hil.navigation.closed_loop import LoopStep
    from flyaround.hil.navigation.measurement import Snapshot
    from flyaround.simulator.scenario.plan import Plan
    from flyaround.simulator.scene.state import SceneState

STEPS_CSV = "closed_loop.csv"
COLUMNS = (
    "t_s",
    "phase",
    "reason",
    "filter",
    "pose_age_s",
    *(f"{axis}_m" for axis in ("radial", "along_track", "cross_track")),
    *(f"{axis}_error_m" for axis in ("radial", "along_track", "cross_track")),
    "position_sigma_m",
    "attitude_error_deg",
    "attitude_sigma_deg",
    "pointing_error_deg",
    "nees",
    "delta_v_m_s",
    "violation",
)
# Maximum size of an accepted file [bytes], about a million control periods.
MAX_BYTES = 1 << 28

PoseFrom = Literal["board", "truth", "noisy"]


class BoardPoses(PoseQueue):
    """Queue of the board's accepted poses as measurements for the navigation filter.

    The link carries no covariance, so the one of ``noise`` is used.

    Parameters
    ----------
    noise : PoseNoise
        Error model of the poses.
    link : PoseLink, optional
        Simulated delay of poses in lockstep, where the flight's clock waits for the board. Without it, as in real time,
        a pose is available as soon as it is received.
    """

    def __init__(self, noise: PoseNoise, link: PoseLink | None) -> None:
        super().__init__((lambda _number, _t_s: -np.inf) if link is None else link.delay_s)
        self._noise = noise
        self._snapshots: dict[int, Snapshot] = {}

    def note(self, frame: int, snapshot: Snapshot) -> None:
        """Store the time and camera attitude of an image until its pose arrives."""
        self._snapshots[frame] = snapshot

    def take(self, row: FrameRecord) -> None:
        """Queue the pose of an image, if the board accepted it."""
        snapshot = self._snapshots.pop(row.frame_id, None)
        if snapshot is None or row.outcome != ACCEPTED or row.q_wxyz is None or row.t_m is None:
            return
        q, t = np.array(row.q_wxyz), np.array(row.t_m)
        pose = self._noise.measured(snapshot.t_s, q / np.linalg.norm(q), t, snapshot.q_camera_from_eci_wxyz)
        self.put(row.frame_id, pose)


@dataclass(frozen=True, eq=False, kw_only=True)
class BoardLoop:
    """Closed loop on a board's poses. `run_host` sends its frames and passes each resulting record to ``poses.take``.

    `run_host` requests a frame only after it has sent the previous one, in lockstep only after its answer. Therefore no
    frame is rendered ahead of the guidance decisions that lead to it.
    """

    plan: Plan
    loop: ClosedLoop
    poses: BoardPoses
    seed: int

    @staticmethod
    def from_plan(
        plan: Plan,
        config: ClosedLoopConfig,
        *,
        realtime: bool,
        link: PoseLink | None = None,
        noise: PoseNoise | None = None,
    ) -> BoardLoop:
        """Return the closed loop of a plan's flight.

        Parameters
        ----------
        plan : Plan
            Scenario with its flight and target.
        config : ClosedLoopConfig
            Settings of the loop.
        realtime : bool
            True in real time, False in lockstep.
        link : PoseLink, optional
            Simulated delay of poses in lockstep; by default the latency of `PoseLink`.
        noise : PoseNoise, optional
            Error model of the board's poses; by default that of the estimator ``hybrid``.

        Raises
        ------
        UserError
            If the flight has no path or no thrusters.
        """
        check_closed_loop(plan.flight, f"scenario {plan.scenario_name}")
        poses = BoardPoses(noise or PoseNoise(), None if realtime else link or PoseLink())
        mass = plan.target.mass
        loop = ClosedLoop(plan.flight, mass.com_m, mass.inertia_kg_m2, poses.available, config)
        return BoardLoop(plan=plan, loop=loop, poses=poses, seed=config.seed)

    def frames(self, *, device_index: int | None = None, realtime: bool = False) -> Iterator[Frame]:
        """Yield each frame, rendered from the simulated state at the time of the request."""
        with open_frames(
            Frame.image_and_truth,
            processes=1,
            device_index=device_index,
            first=self.plan.scene(0),
            ahead=1,
        ) as producer:
            if realtime:
                # render one frame first: shaders must be compiled before the clock starts
                producer.submit(FrameRequest(scene=self.plan.scene(0)))
                producer.result()
            for number, snapshot in enumerate(self.loop.pictures()):
                self.poses.note(number, snapshot)
                producer.submit(FrameRequest(scene=scene_at_snapshot(self.plan, snapshot, number)))
                yield producer.result()

    def figures(self) -> ClosedLoopFigures | None:
        """Return the result so far; None before the first period."""
        return figures(self.loop.result(), "board", self.seed) if self.loop.steps else None


def scene_at_snapshot(plan: Plan, snapshot: Snapshot, number: int) -> SceneState:
    """Return the scene of image ``number``, with the chaser's simulated state instead of the planned one.

    Returns
    -------
    SceneState
        Scene at the snapshot's time; target and environment are those of the plan.
    """
    world = plan.flight.state_with_chaser(
        ChaserState(
            t_s=snapshot.t_s,
            position_eci_m=vec3(snapshot.position_eci_m),
            velocity_eci_m_s=vec3(snapshot.velocity_eci_m_s),
            q_camera_from_eci_wxyz=quat(snapshot.q_camera_from_eci_wxyz),
            omega_camera_rad_s=vec3(snapshot.omega_camera_rad_s),
        )
    )
    return plan.scene_of(world, number)


def fly_without_pictures(
    plan: Plan,
    config: ClosedLoopConfig,
    pose: Literal["truth", "noisy"],
    link: PoseLink | None = None,
) -> ClosedLoopResult:
    """Fly a closed loop on the true pose, or on the true pose with simulated errors, without images or a board.

    Parameters
    ----------
    plan : Plan
        Scenario with its flight and target.
    config : ClosedLoopConfig
        Settings of the loop.
    pose : {'truth', 'noisy'}
        ``truth``, or ``noisy`` to add the errors of the estimator ``hybrid``.
    link : PoseLink, optional
        Delay from an image to its pose; by default the latency of `PoseLink`.

    Returns
    -------
    ClosedLoopResult
        Outcome, and one decision per control period.

    Raises
    ------
    UserError
        If the flight has no path or no thrusters.
    """
    check_closed_loop(plan.flight, f"scenario {plan.scenario_name}")
    noise = PoseNoise()
    errors = PoseErrors(noise, np.random.default_rng([config.seed, 0]))
    poses = SimulatedPoses(noise.true_pose if pose == "truth" else errors.draw, (link or PoseLink()).delay_s)
    mass = plan.target.mass
    return fly_closed_loop(plan.flight, mass.com_m, mass.inertia_kg_m2, poses, config)


def summary_without_pictures(result: ClosedLoopResult, pose: PoseFrom, seed: int) -> LedgerSummary:
    """Return the summary of a run that sent no frames.

    Returns
    -------
    LedgerSummary
        Summary whose counts are zero, with the figures of the closed loop.
    """
    return summarise(
        [],
        started_utc=datetime.now(UTC).isoformat(timespec="seconds"),
        ended="completed",
        mode="lockstep",
        truth="off",
        url="",
        timeout_s=0.0,
        closed_loop=figures(result, pose, seed),
    )


def figures(result: ClosedLoopResult, pose: PoseFrom, seed: int) -> ClosedLoopFigures:
    """Return the figures of a closed loop that go into ``summary.json``.

    Returns
    -------
    ClosedLoopFigures
        Outcome without the control periods, and their last time [s] as the duration.
    """
    values = {field.name: getattr(result, field.name) for field in fields(result) if field.name != "steps"}
    return ClosedLoopFigures(pose=pose, seed=seed, duration_s=result.steps[-1].t_s, **values)


def frame_every(every_s: float | None, plan: Plan) -> int:
    """Return the number of control periods between images.

    Parameters
    ----------
    every_s : float or None
        Time between images; None for one image per control period.
    plan : Plan
        Plan of the flight.

    Returns
    -------
    int
        Control periods from one image to the next, at least 1.

    Raises
    ------
    UserError
        If ``every_s`` is not a multiple of the control period.
    """
    thrusters = plan.flight.guidance.acting_thrusters
    if every_s is None or thrusters is None:
        return 1
    periods = round(every_s / thrusters.period_s)
    if periods < 1 or abs(periods * thrusters.period_s - every_s) > 1e-9:
        raise UserError(
            f"--every {every_s:g} is not a multiple of the thrusters' control period of {thrusters.period_s:g} s: "
            "choose a multiple"
        )
    return periods


def write_steps(folder: Path, steps: Iterable[LoopStep]) -> None:
    """Write ``closed_loop.csv``: a line per control period with the decision and its reason.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_atomic(folder / STEPS_CSV, table_bytes(COLUMNS, rows=map(_cells, steps)))


def read_steps(folder: Path) -> dict[str, list[str]]:
    """Read the columns of a folder's ``closed_loop.csv``.

    Returns
    -------
    dict of str to list of str
        Cells of each column as text, in the order of the control periods; empty if there is no such file. Cells of
        numeric columns are numbers or empty.

    Raises
    ------
    UserError
        If the file is damaged.
    """
    path = folder / STEPS_CSV
    if not path.exists():
        return {}
    try:
        lines = list(csv.reader(io.StringIO(read_regular(path, MAX_BYTES).decode()), strict=True))
        if tuple(lines[0]) != COLUMNS or len({len(line) for line in lines}) > 1:
            raise ValueError("unexpected columns")
        text_columns = ("phase", "reason", "filter")
        for line in lines[1:]:
            for name, cell in zip(COLUMNS, line, strict=True):
                if cell and name not in text_columns:
                    float(cell)
    except (OSError, ValueError, IndexError, csv.Error) as error:
        raise UserError(f"{path} is damaged ({error!s:.120}): copy it again") from error
    return {name: [line[k] for line in lines[1:]] for k, name in enumerate(COLUMNS)}


def _cells(step: LoopStep) -> list[str]:
    estimate, error = step.estimate, step.error

    def number(value: float | None) -> str:
        return "" if value is None else f"{value:.9g}"

    return [
        f"{step.t_s:.6g}",
        step.phase,
        step.reason,
        step.status,
        number(step.pose_age_s),
        *(number(float(x)) for x in step.position_lvlh_m),
        *(number(None if error is None else float(error[k])) for k in range(3)),
        number(None if estimate is None else estimate.position_sigma_m),
        number(None if error is None else float(np.degrees(np.linalg.norm(error[6:9])))),
        number(None if estimate is None else float(np.degrees(estimate.attitude_sigma_rad))),
        number(float(np.degrees(step.pointing_error_rad))),
        number(step.nees),
        number(float(np.linalg.norm(step.delta_v_lvlh_m_s))),
        str(int(step.violation)),
    ]
