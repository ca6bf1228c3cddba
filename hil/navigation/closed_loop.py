"""Closed loop of pose, filter, guidance and thrusters; each image shows the state that was flown."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from flyaround.hil.navigation.approach import Approach, ApproachRules, Decision, Phase
from flyaround.hil.navigation.consistency import nees
from flyaround.hil.navigation.measurement import PoseMeasurement, Snapshot
from flyaround.hil.navigation.navigation_filter import FilterSettings, NavigationFilter, Status
from flyaround.hil.navigation.relative_estimate import MotionModel, RelativeEstimate, ThrustInterval
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.untrusted_files import refuse_not_finite
from flyaround.simulator.world.frames.rotation import rotvec_between
from flyaround.simulator.world.relative.thrusted_step import ThrustHold, relative_step

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import ArrayLike

    from flyaround.hil.navigation.pose_sources import SimulatedPoses
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.flight.flight import Flight
    from flyaround.simulator.world.frames.lvlh import Lvlh

Outcome = Literal["arrived", "aborted", "failed"]

# Time after the end of any path [s].
END_S = 1e9
"""Time by which every path has ended [s]."""


@dataclass(frozen=True, kw_only=True)
class ClosedLoopConfig:
    """Settings of a closed loop.

    Parameters
    ----------
    seed : int, optional
        Seed of the initial dispersion and of the thruster errors.
    frame_every : int, optional
        Control periods per image.
    start_sigma_m : float, optional
        Position dispersion of the start, per axis.
    start_sigma_m_s : float, optional
        Velocity dispersion of the start, per axis.
    thrust_sigma : float, optional
        Standard deviation of a pulse relative to its command, per axis; the filter assumes the same.
    acceleration_noise : float, optional
        Density of the unmodelled white acceleration [m s-2 Hz-1/2].
    rate_noise : float, optional
        Density of the target's white angular acceleration [rad s-2 Hz-1/2].
    rules : ApproachRules, optional
        Settings of the guidance.
    filter : FilterSettings, optional
        Settings of the filter.

    Raises
    ------
    UserError
        If a number is not finite, or ``frame_every`` is less than 1.
    """

    seed: int = 0
    frame_every: int = 1
    start_sigma_m: float = 0.1
    start_sigma_m_s: float = 0.002
    thrust_sigma: float = 0.02
    acceleration_noise: float = 3e-7
    rate_noise: float = 2e-8
    rules: ApproachRules = field(default_factory=ApproachRules)
    filter: FilterSettings = field(default_factory=FilterSettings)

    def __post_init__(self) -> None:
        refuse_not_finite(asdict(self), "a closed loop")
        if self.frame_every < 1:
            raise UserError(f"a closed loop: frame_every is {self.frame_every}, allowed: at least 1")


@dataclass(frozen=True, eq=False, kw_only=True)
class LoopStep:
    """Record of one control period: estimate, decision and truth.

    Parameters
    ----------
    t_s : float
        Start of the period.
    phase : Phase
        Phase of the guidance.
    reason : str
        Cause of a hold or abort, else empty.
    status : Status
        Status of the filter.
    position_lvlh_m : (3,) array
        True position of the chaser.
    velocity_lvlh_m_s : (3,) array
        True velocity of the chaser.
    commanded_lvlh_m_s : (3,) array
        Commanded velocity change.
    delta_v_lvlh_m_s : (3,) array
        Delivered velocity change.
    estimate : RelativeEstimate or None
        Estimate predicted to ``t_s``; None without a track.
    error : (12,) array or None
        Error of the estimate, truth minus estimate.
    nees : float or None
        Normalised estimation error squared.
    pose_age_s : float or None
        Age of the newest pose in the estimate.
    violation : bool
        True inside the keep-out sphere but outside the corridor.
    pointing_error_rad : float
        Angle between the camera's attitude and the ideal one at its true position.
    """

    t_s: float
    phase: Phase
    reason: str
    status: Status
    position_lvlh_m: FloatArray
    velocity_lvlh_m_s: FloatArray
    commanded_lvlh_m_s: FloatArray
    delta_v_lvlh_m_s: FloatArray
    estimate: RelativeEstimate | None
    error: FloatArray | None
    nees: float | None
    pose_age_s: float | None
    violation: bool
    pointing_error_rad: float


@dataclass(frozen=True, eq=False, kw_only=True)
class ClosedLoopResult:
    """Outcome of a closed loop.

    Parameters
    ----------
    outcome : Outcome
        Arrived, aborted (with a reason, and never inside the sphere), or failed.
    reason : str
        Reason for an abort or failure.
    final_error_m : float
        True distance from the path's end.
    final_error_deg : float
        Larger one of the camera's pointing error and the error of the estimated target attitude.
    min_range_m : float
        Smallest true range.
    keep_out_violations : int
        Control periods inside the keep-out sphere and outside the corridor.
    delta_v_m_s : float
        Total velocity change.
    steps : tuple of LoopStep
        Record of each control period.
    """

    outcome: Outcome
    reason: str
    final_error_m: float
    final_error_deg: float
    min_range_m: float
    keep_out_violations: int
    delta_v_m_s: float
    steps: tuple[LoopStep, ...]


def check_closed_loop(flight: Flight, what: str) -> None:
    """Raise unless the flight's chaser follows a path with thrusters.

    Raises
    ------
    UserError
        If not; the message says what the scenario needs.
    """
    guidance = flight.guidance
    by_path = not guidance.ballistic and not hasattr(guidance, "impulse_lvlh")
    if not by_path or flight.recording is not None or flight.scripted is not None:
        raise UserError(
            f"{what} has no path for a closed loop: choose a chaser mode such as vbar, "
            "rbar, waypoints, glideslope or hold, as in tango-vbar-closed-loop"
        )
    if guidance.acting_thrusters is None:
        raise UserError(f"{what} has no thrusters: add [chaser.thrusters] to a copy of the scenario")


def fly_closed_loop(
    flight: Flight,
    com_target_m: ArrayLike,
    inertia_kg_m2: ArrayLike,
    poses: SimulatedPoses,
    config: ClosedLoopConfig = ClosedLoopConfig(),
) -> ClosedLoopResult:
    """Fly an approach on pose measurements: in each period the newest estimate determines the thrust.

    The chaser knows both absolute orbits, its own attitude, which follows the command exactly, and the target's centre
    of mass and inertia. An image shows the state after the decision that precedes it.

    Parameters
    ----------
    flight : Flight
        Flight that defines the target, the guidance path and the camera pointing; its chaser gives the start.
    com_target_m : (3,) array
        Centre of mass of the target, model frame.
    inertia_kg_m2 : (3, 3) array
        Inertia of the target, model axes.
    poses : SimulatedPoses
        Source of poses.
    config : ClosedLoopConfig, optional
        Settings of the loop.

    Returns
    -------
    ClosedLoopResult
        Outcome, and one decision per control period.

    Raises
    ------
    UserError
        If the chaser of the flight does not follow a path with thrusters.
    """
    loop = ClosedLoop(flight, com_target_m, inertia_kg_m2, poses.available, config)
    for picture in loop.pictures():
        poses.expose(picture)
    return loop.result()


class ClosedLoop:
    """Closed loop in progress: it requests images and poses, and decides on the thrust.

    Parameters
    ----------
    flight : Flight
        Flight that defines the target, the guidance path and the camera pointing.
    com_target_m : (3,) array
        Centre of mass of the target, model frame.
    inertia_kg_m2 : (3, 3) array
        Inertia of the target, model axes.
    available_poses : callable
        Returns the poses that became available by a time and were not returned before.
    config : ClosedLoopConfig, optional
        Settings of the loop.
    """

    def __init__(
        self,
        flight: Flight,
        com_target_m: ArrayLike,
        inertia_kg_m2: ArrayLike,
        available_poses: Callable[[float], Sequence[PoseMeasurement]],
        config: ClosedLoopConfig = ClosedLoopConfig(),
    ) -> None:
        check_closed_loop(flight, "the flight")
        thrusters = flight.guidance.acting_thrusters
        assert thrusters is not None  # noqa: S101 - check_closed_loop requires thrusters
        self.steps: list[LoopStep] = []
        self._flight, self._available_poses = flight, available_poses
        self._config, self._thrusters = config, thrusters
        self._com = np.asarray(com_target_m, float)
        self._rng = np.random.default_rng([config.seed, 1])
        self._end, _ = flight.guidance.state_lvlh(END_S, flight.n_rad_s)
        motion = MotionModel(
            n_rad_s=flight.n_rad_s,
            inertia_kg_m2=np.asarray(inertia_kg_m2, float),
            acceleration_noise=config.acceleration_noise,
            rate_noise=config.rate_noise,
            thrust_sigma=config.thrust_sigma,
        )
        self._filter = NavigationFilter(motion, flight.orbit.frame, self._com, config.filter)
        self._approach = Approach(
            flight.guidance, flight.n_rad_s, thrusters.period_s, self._end, config.rules
        )
        self._start = flight.guidance.state_lvlh(0.0, flight.n_rad_s)
        p = self._start[0] + config.start_sigma_m * self._rng.standard_normal(3)
        v = self._start[1] + config.start_sigma_m_s * self._rng.standard_normal(3)
        self._state = flight.orbit.frame(0.0).to_eci(p, v)
        self._mass_kg, self._delta_v_m_s = thrusters.mass_kg, 0.0

    @property
    def max_pictures(self) -> int:
        """Number of images of a flight that never arrives."""
        periods = int(np.floor(self._flight.duration_s / self._thrusters.period_s))
        return -(-periods // self._config.frame_every)

    @property
    def between_pictures_s(self) -> float:
        """Time between images."""
        return self._thrusters.period_s * self._config.frame_every

    def pictures(self) -> Iterator[Snapshot]:
        """Yield the state for each image, until the chaser has arrived or retreated, or the flight ends.

        No decision is made before the image that follows it is requested.
        """
        h = self._thrusters.period_s
        for k in range(int(np.floor(self._flight.duration_s / h))):
            t = k * h
            for pose in self._available_poses(t):
                self._filter.add(pose)
            frame = self._flight.orbit.frame(t)
            estimate = self._filter.estimate(t)
            decision = self._approach.decide(t, estimate, self._filter.status, self._filter.last_used_s)
            chaser_state = self._start
            if estimate is not None:
                chaser_state = estimate.position_lvlh_m, estimate.velocity_lvlh_m_s
            camera = self._camera(chaser_state, frame)
            snapshot = self._snapshot(t, camera)
            step = self._step(t, frame, estimate, decision, camera)
            commanded, delivered = self._thrust(t, h, decision.command_m_s, frame)
            step = replace(step, commanded_lvlh_m_s=commanded, delta_v_lvlh_m_s=delivered)
            self.steps.append(step)
            if step.phase == "arrived" or (step.phase == "abort" and self._has_departed(step)):
                return
            if step.phase != "abort" and k % self._config.frame_every == 0:
                yield snapshot

    def _snapshot(self, t: float, camera: tuple[FloatArray, FloatArray]) -> Snapshot:
        return Snapshot(
            t_s=t,
            position_eci_m=self._state[0],
            velocity_eci_m_s=self._state[1],
            q_camera_from_eci_wxyz=camera[0],
            omega_camera_rad_s=camera[1],
            q_eci_from_target_wxyz=self._flight.attitude(t)[0],
            com_target_m=self._com,
        )

    def _step(
        self,
        t: float,
        frame: Lvlh,
        estimate: RelativeEstimate | None,
        decision: Decision,
        camera: tuple[FloatArray, FloatArray],
    ) -> LoopStep:
        """Return the record of a period before its thrust."""
        p, v = frame.from_eci(*self._state)
        ideal, _ = self._camera((p, v), frame)
        error = None if estimate is None else estimate.error_of(p, v, *self._flight.attitude(t))
        keep_out, last = self._flight.guidance.keep_out, self._filter.last_used_s
        return LoopStep(
            t_s=t,
            phase=decision.phase,
            reason=decision.reason,
            status=self._filter.status,
            position_lvlh_m=p,
            velocity_lvlh_m_s=v,
            commanded_lvlh_m_s=np.zeros(3),
            delta_v_lvlh_m_s=np.zeros(3),
            estimate=estimate,
            error=error,
            nees=None if estimate is None or error is None else nees(error, estimate.covariance),
            pose_age_s=None if last is None else t - last,
            violation=keep_out is not None and bool(keep_out.violated(p)),
            pointing_error_rad=float(np.linalg.norm(rotvec_between(ideal, camera[0]))),
        )

    def _camera(
        self, state_lvlh: tuple[FloatArray, FloatArray], frame: Lvlh
    ) -> tuple[FloatArray, FloatArray]:
        """Return attitude and rate of a camera that points exactly at the target from a state."""
        p, v = frame.to_eci(*state_lvlh)
        return self._flight.pointing.attitude(-p, -v, frame)

    def _thrust(
        self, t: float, h: float, command_m_s: FloatArray, frame: Lvlh
    ) -> tuple[FloatArray, FloatArray]:
        """Apply a velocity change: the filter receives the command, and the flight the delivered thrust."""
        commanded, self._mass_kg = self._thrusters.fire(command_m_s, self._mass_kg)
        if commanded.any():
            self._filter.add_thrust(
                ThrustInterval(start_s=t, end_s=t + h, acceleration_lvlh_m_s2=commanded / h)
            )
        delivered = np.asarray(commanded * (1.0 + self._config.thrust_sigma * self._rng.standard_normal(3)))
        self._delta_v_m_s += float(np.linalg.norm(delivered))
        push = ThrustHold(frame.R_eci_from_lvlh @ delivered / h)
        self._state = relative_step(self._flight.orbit, t, h, self._state, push)
        return np.asarray(commanded), delivered

    def _has_departed(self, step: LoopStep) -> bool:
        """Return True beyond twice the sphere's radius, or if the position is unknown."""
        keep_out = self._flight.guidance.keep_out
        radius = 0.0 if keep_out is None else keep_out.radius_m
        return step.estimate is None or float(np.linalg.norm(step.position_lvlh_m)) > 2 * radius

    def result(self) -> ClosedLoopResult:
        """Return the outcome of the loop so far.

        Returns
        -------
        ClosedLoopResult
            Outcome, its figures up to the last control period, and all periods so far; final once `pictures` has ended.
        """
        steps = self.steps
        last = steps[-1]
        violations = sum(bool(step.violation) for step in steps)
        outcome: Outcome = "failed"
        reason = last.reason
        if violations:
            reason = f"inside the keep-out sphere and outside its corridor for {violations} periods"
        elif last.phase == "arrived":
            outcome = "arrived"
        elif last.phase == "abort":
            outcome = "aborted"
        else:
            reason = f"the flight ended before the chaser arrived{': ' + reason if reason else ''}"
        attitude = 180.0 if last.error is None else float(np.degrees(np.linalg.norm(last.error[6:9])))
        return ClosedLoopResult(
            outcome=outcome,
            reason=reason,
            final_error_m=float(np.linalg.norm(last.position_lvlh_m - self._end)),
            final_error_deg=max(float(np.degrees(last.pointing_error_rad)), attitude),
            min_range_m=min(float(np.linalg.norm(step.position_lvlh_m)) for step in steps),
            keep_out_violations=violations,
            delta_v_m_s=self._delta_v_m_s,
            steps=tuple(steps),
        )
