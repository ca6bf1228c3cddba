"""Guidance on the estimate: follow the scenario's path, hold while poses are missing, abort after a time-out."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from flyaround.simulator.runtime.untrusted_files import refuse_not_finite
from flyaround.simulator.world.guidance.keep_out import KeepOut
from flyaround.simulator.world.guidance.thruster_control import path_impulse, retreat_impulse
from flyaround.simulator.world.relative.clohessy_wiltshire import transition_matrix

if TYPE_CHECKING:
    from flyaround.hil.navigation.navigation_filter import Status
    from flyaround.hil.navigation.relative_estimate import RelativeEstimate
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.guidance.chaser import Chaser

Phase = Literal["acquire", "approach", "hold", "abort", "arrived"]


@dataclass(frozen=True, kw_only=True)
class ApproachRules:
    """Conditions for holding, arriving and aborting.

    Parameters
    ----------
    hold_after_s : float, optional
        Age of the newest pose at which the chaser holds.
    abort_after_s : float, optional
        Age of the newest pose at which the chaser aborts.
    hold_sigma_share : float, optional
        Position sigma over range above which the chaser holds.
    arrived_within_m : float, optional
        Largest estimated distance from the path's end on arrival.
    arrived_speed_m_s : float, optional
        Largest estimated speed on arrival.
    arrived_sigma_rad : float, optional
        Largest sigma of the target's attitude on arrival.
    arrived_for_s : float, optional
        Time for which these conditions must hold.

    Raises
    ------
    UserError
        If a number is not finite.
    """

    hold_after_s: float = 5.0
    abort_after_s: float = 30.0
    hold_sigma_share: float = 0.02
    arrived_within_m: float = 0.1
    arrived_speed_m_s: float = 0.01
    arrived_sigma_rad: float = 0.0175
    arrived_for_s: float = 10.0

    def __post_init__(self) -> None:
        # a limit of NaN is never exceeded: the chaser would not abort
        refuse_not_finite(asdict(self), "the rules of an approach")


@dataclass(frozen=True, eq=False)
class Decision:
    """Velocity change commanded for a control period, and its reason.

    Parameters
    ----------
    phase : Phase
        Phase of the approach.
    reason : str
        Cause of a hold or abort, else empty.
    command_m_s : (3,) array
        Commanded velocity change, LVLH.
    """

    phase: Phase
    reason: str
    command_m_s: FloatArray


class Approach:
    """Guidance that decides once per control period. The path's time stops while the chaser holds.

    Parameters
    ----------
    path : Chaser
        Path of the scenario.
    n_rad_s : float
        Mean motion of the target.
    period_s : float
        Control period.
    end_lvlh_m : (3,) array
        End of the path, LVLH.
    rules : ApproachRules, optional
        Settings of the guidance.
    """

    def __init__(
        self,
        path: Chaser,
        n_rad_s: float,
        period_s: float,
        end_lvlh_m: FloatArray,
        rules: ApproachRules = ApproachRules(),
    ) -> None:
        self._path, self._n, self._h, self._end, self._rules = path, n_rad_s, period_s, end_lvlh_m, rules
        self._keep_out: KeepOut | None = path.keep_out
        self._Phi = transition_matrix(n_rad_s, period_s)
        self._path_s = 0.0
        self._near_s = 0.0
        self._abort = ""

    def decide(
        self, t_s: float, estimate: RelativeEstimate | None, status: Status, last_used_s: float | None
    ) -> Decision:
        """Return the decision for the period that starts at ``t_s``.

        Parameters
        ----------
        t_s : float
            Start of the control period [s].
        estimate : RelativeEstimate or None
            Estimate at ``t_s``; None without a track.
        status : Status
            Status of the filter.
        last_used_s : float or None
            Exposure time of its newest pose.
        """
        doubt = self._hold_reason(t_s, estimate, status, last_used_s)
        self._abort = self._abort or self._abort_reason(t_s, estimate, last_used_s)
        if self._abort:
            return Decision("abort", self._abort, self._retreat(estimate))
        if estimate is None:
            return Decision("acquire", "no pose yet", np.zeros(3))
        state = estimate.position_lvlh_m, estimate.velocity_lvlh_m_s
        if doubt:
            self._near_s = 0.0
            aim_p, _ = self._path.state_lvlh(self._path_s, self._n)
            return Decision("hold", doubt, path_impulse(state, (aim_p, np.zeros(3)), self._Phi, self._h))
        self._near_s = self._near_s + self._h if self._is_near(estimate) else 0.0
        if self._near_s >= self._rules.arrived_for_s:
            return Decision("arrived", "", np.zeros(3))
        self._path_s += self._h
        impulse = path_impulse(state, self._path.state_lvlh(self._path_s, self._n), self._Phi, self._h)
        return Decision("approach", "", impulse)

    def _hold_reason(
        self, t_s: float, estimate: RelativeEstimate | None, status: Status, last_used_s: float | None
    ) -> str:
        if estimate is None or last_used_s is None:
            return ""
        if status == "lost":
            return "poses contradict the estimate"
        if t_s - last_used_s > self._rules.hold_after_s:
            return f"no usable pose for {self._rules.hold_after_s:g} s"
        share = estimate.position_sigma_m / max(float(np.linalg.norm(estimate.position_lvlh_m)), 1e-9)
        if share > self._rules.hold_sigma_share:
            return f"position known to {share:.1%} of the range"
        return ""

    def _abort_reason(self, t_s: float, estimate: RelativeEstimate | None, last_used_s: float | None) -> str:
        rules, keep_out = self._rules, self._keep_out
        if t_s - (last_used_s or 0.0) > rules.abort_after_s:
            return f"no usable pose for {rules.abort_after_s:g} s"
        if estimate is not None and keep_out is not None and keep_out.violated(estimate.position_lvlh_m):
            return "inside the keep-out sphere and outside its corridor"
        return ""

    def _retreat(self, estimate: RelativeEstimate | None) -> FloatArray:
        """Return the velocity change of a radial retreat; without an estimate, the chaser drifts outside the sphere."""
        if estimate is None:
            return np.zeros(3)
        keep_out = self._keep_out or KeepOut(radius_m=float(np.linalg.norm(self._end)) * 2)
        return retreat_impulse(estimate.position_lvlh_m, estimate.velocity_lvlh_m_s, keep_out)

    def _is_near(self, estimate: RelativeEstimate) -> bool:
        distance_m = float(np.linalg.norm(estimate.position_lvlh_m - self._end))
        speed = float(np.linalg.norm(estimate.velocity_lvlh_m_s))
        rules = self._rules
        return (
            distance_m <= rules.arrived_within_m
            and speed <= rules.arrived_speed_m_s
            and estimate.attitude_sigma_rad <= rules.arrived_sigma_rad
        )
