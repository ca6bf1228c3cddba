"""Navigation filter: delayed poses update the estimate, with a gate, loss of track and reacquisition."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from flyaround.hil.navigation.consistency import fisher_quantile
from flyaround.hil.navigation.error_scale import ErrorScale, ScaleSettings
from flyaround.hil.navigation.measurement import ErrorCorrelation, PoseMeasurement
from flyaround.hil.navigation.relative_estimate import (
    A,
    B,
    MotionModel,
    P,
    RelativeEstimate,
    ThrustInterval,
    V,
    W,
    skew,
    target_origin_offset_m,
)
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.untrusted_files import refuse_not_finite
from flyaround.simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_conjugate,
    quat_multiply,
    quat_normalize,
    rotvec_between,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.frames.lvlh import Lvlh

Verdict = Literal["used", "gated", "too old", "repeated", "starts", "found"]
Status = Literal["searching", "tracking", "lost"]


@dataclass(frozen=True, kw_only=True)
class FilterSettings:
    """Settings of the navigation filter.

    Parameters
    ----------
    gate : float, optional
        Share of correct poses that pass the innovation gate.
    trusted_after : int, optional
        Number of mutually consistent poses that start a trusted track.
    lost_after : int, optional
        Number of successive gated poses after which the track is lost.
    replaced_after : int, optional
        Number of mutually consistent gated poses, without an accepted one in between, that replace the track.
    start_speed_m_s : float, optional
        Initial sigma of the velocity, per axis.
    start_rate_rad_s : float, optional
        Initial sigma of the angular rate, per axis.
    history_s : float, optional
        Largest delay of a pose: estimates are kept from the last one before it.
    memory : ErrorCorrelation, optional
        Correlation of the pose errors.
    scale : ScaleSettings, optional
        Scale of the pose errors.

    Raises
    ------
    UserError
        If a number is not finite or out of range.
    """

    gate: float = 0.9999
    trusted_after: int = 5
    lost_after: int = 5
    replaced_after: int = 20
    start_speed_m_s: float = 0.1
    start_rate_rad_s: float = 0.1
    history_s: float = 20.0
    memory: ErrorCorrelation = field(default_factory=ErrorCorrelation)
    scale: ScaleSettings = field(default_factory=ScaleSettings)

    def __post_init__(self) -> None:
        refuse_not_finite(asdict(self), "the filter's settings")
        if not 0 < self.gate < 1:
            raise UserError(f"the filter's gate is {self.gate:g}, allowed: above 0 and below 1")
        for name in ("trusted_after", "lost_after", "replaced_after"):
            if getattr(self, name) < 1:
                raise UserError(f"the filter's {name} is {getattr(self, name)}, allowed: 1 or more")
        for name in ("start_speed_m_s", "start_rate_rad_s", "history_s"):
            if getattr(self, name) <= 0:
                raise UserError(f"the filter's {name} is {getattr(self, name):g}, allowed: above 0")


@dataclass(frozen=True, eq=False)
class _Fix:
    """Accepted pose, and the estimate after it."""

    pose: PoseMeasurement
    after: RelativeEstimate


class NavigationFilter:
    """Multiplicative extended Kalman filter that estimates relative orbit and target attitude from delayed poses.

    A pose is applied at its exposure time, and later poses are reprocessed, which is an exact out-of-sequence update. A
    pose that fails the gate starts a second, candidate track; once ``replaced_after`` poses agree with the candidate
    and none with the first track, the candidate replaces it. The scale of the pose errors is estimated from the
    residuals (`ErrorScale`), and its uncertainty widens the gate.

    Parameters
    ----------
    motion : MotionModel
        Motion model of chaser and target.
    lvlh : callable
        LVLH frame of the target as a function of time, from its known orbit.
    com_target_m : (3,) array
        Centre of mass of the target, model frame.
    settings : FilterSettings, optional
        Settings of the filter.

    References
    ----------
    Lefferts, Markley & Shuster (1982), J. Guidance 5(5); Bar-Shalom, Li & Kirubarajan (2001), sec. 5.4 (gate and
    consistency), ch. 8 (autocorrelated measurement noise: pose biases are states);
    Bar-Shalom (2002), IEEE Trans. Aerospace and Electronic Systems 38(3) (delayed measurements);
    Gelb (ed.) 1974, Applied Optimal Estimation, sec. 4.5.
    """

    def __init__(
        self,
        motion: MotionModel,
        lvlh: Callable[[float], Lvlh],
        com_target_m: FloatArray,
        settings: FilterSettings = FilterSettings(),
    ) -> None:
        self.motion, self.settings = motion, settings
        self._lvlh, self._com = lvlh, np.asarray(com_target_m, float)
        self._track: list[_Fix] = []
        self._candidate: list[_Fix] = []
        self._thrust: list[ThrustInterval] = []
        self._gated_in_a_row = 0
        self._newest: PoseMeasurement | None = None
        self._predicted: RelativeEstimate | None = None

    @property
    def status(self) -> Status:
        """Status of the track."""
        if not self._track:
            return "searching"
        return "lost" if self._gated_in_a_row >= self.settings.lost_after else "tracking"

    @property
    def last_used_s(self) -> float | None:
        """Exposure time of the newest pose in the estimate."""
        return self._track[-1].pose.t_s if self._track else None

    def add_thrust(self, interval: ThrustInterval) -> None:
        """Add commanded thrust, before any pose exposed after its start."""
        self._thrust.append(interval)
        if self._predicted is not None and interval.start_s < self._predicted.t_s:
            self._predicted = None

    def add(self, pose: PoseMeasurement) -> Verdict:
        """Process a pose, in any order of time, and return the verdict on it.

        A pose identical to the newest one is ignored: with image noise, two images never give identical poses, so it is
        from a frozen image.
        """
        newest, self._newest = self._newest, pose
        if newest is not None and _is_same_pose(newest, pose):
            return "repeated"
        if self._track:
            accepted_fixes = self._with_fix(self._track, pose)
            if accepted_fixes == "too old":
                return "too old"
            if accepted_fixes is not None:
                self._track, self._candidate, self._gated_in_a_row = accepted_fixes, [], 0
                self._predicted = None
                self._trim_history(pose.t_s)
                return "used"
            self._gated_in_a_row += 1
        return self._add_to_candidate(pose)

    def _add_to_candidate(self, pose: PoseMeasurement) -> Verdict:
        """Add a gated pose to the candidate track, or start one."""
        longer = self._with_fix(self._candidate, pose) if self._candidate else None
        if longer == "too old":
            return "too old"
        if longer is None:
            self._candidate = [_Fix(pose, self._first_estimate(pose))]
            return "gated" if self._track else "starts"
        self._candidate = longer
        if len(longer) < (self.settings.replaced_after if self._track else self.settings.trusted_after):
            return "gated" if self._track else "used"
        self._track, self._candidate, self._gated_in_a_row = longer, [], 0
        self._predicted = None
        return "found"

    def estimate(self, t_s: float) -> RelativeEstimate | None:
        """Return the estimate propagated to a time; None without a track."""
        if not self._track:
            return None
        last = self._predicted
        if last is None or last.t_s > t_s:
            last = self._track[-1].after
        # cache the prediction: callers ask for increasing times
        self._predicted = self.motion.propagated(last, t_s, self._thrust)
        return self._predicted

    def _with_fix(self, fixes: list[_Fix], pose: PoseMeasurement) -> list[_Fix] | Literal["too old"] | None:
        """Return the fixes with one more in time order; None if it fails the gate."""
        before = [fix for fix in fixes if fix.pose.t_s <= pose.t_s]
        later = fixes[len(before) :]
        if not before:
            return "too old"
        updated, distance = self.updated(self._predicted_to(before[-1], pose), pose)
        if distance > self._gate(before[-1].after.error_scale.predicted()):
            return None
        result = [*before, _Fix(pose, updated)]
        for fix in later:
            predicted = self._predicted_to(result[-1], fix.pose)
            result.append(_Fix(fix.pose, self.updated(predicted, fix.pose)[0]))
        return result

    def _gate(self, scale: ErrorScale) -> float:
        """Return the gate, a squared distance: Student's t in six dimensions, or chi-square if the scale is known."""
        return 6.0 * fisher_quantile(self.settings.gate, 6, scale.degrees_of_freedom)

    def _predicted_to(self, fix: _Fix, pose: PoseMeasurement) -> RelativeEstimate:
        """Return the estimate at a later pose's exposure, with the correlated errors decayed by the change of view."""
        old, new = fix.after, self.motion.propagated(fix.after, pose.t_s, self._thrust)
        frame = self._lvlh(old.t_s)
        p, v = frame.to_eci(old.position_lvlh_m, old.velocity_lvlh_m_s)
        # use the estimated rates: differences of noisy poses would count as rotation
        target = matrix_from_quat(old.q_eci_from_target_wxyz) @ old.omega_target_rad_s
        turn = (target - np.cross(p, v) / (p @ p)) * (new.t_s - old.t_s)
        ratio = np.linalg.norm(new.position_lvlh_m) / np.linalg.norm(old.position_lvlh_m)
        return new.with_decayed_bias(
            self.settings.memory.correlation(float(np.linalg.norm(turn)), float(ratio))
        )

    def _trim_history(self, t_s: float) -> None:
        oldest = t_s - self.settings.history_s
        first = max((k for k, fix in enumerate(self._track) if fix.pose.t_s <= oldest), default=0)
        self._track = self._track[first:]
        start = self._track[0].pose.t_s
        self._thrust = [i for i in self._thrust if i.end_s >= start]

    def updated(self, estimate: RelativeEstimate, pose: PoseMeasurement) -> tuple[RelativeEstimate, float]:
        """Return the estimate updated by a simultaneous pose, and the innovation's squared Mahalanobis distance."""
        estimate = estimate.with_scaled_errors(estimate.error_scale.predicted())
        factors = estimate.error_scale.factors
        new = pose.new_errors(factors)
        H, C, R = self._sensitivity(estimate, pose, factors), estimate.joint_covariance, new @ new.T
        innovation = self._residual(estimate, pose, factors)
        S = H @ C @ H.T + R
        K = np.linalg.solve(S, H @ C).T
        distance = float(innovation @ np.linalg.solve(S, innovation))
        # Joseph form: stays symmetric and positive
        left = np.eye(18) - K @ H
        covariance = left @ C @ left.T + K @ R @ K.T
        after = estimate.corrected(K @ innovation, (covariance + covariance.T) / 2)
        # the pose's white errors from the updated estimate, relative to those for a factor of 1
        H = self._sensitivity(after, pose, factors)
        whiten = np.linalg.inv(pose.new_errors())
        residual = whiten @ self._residual(after, pose, factors)
        unknown = np.diag(whiten @ H @ after.joint_covariance @ H.T @ whiten.T)
        scale = after.error_scale.updated(residual**2 + unknown)
        return after.with_scaled_errors(scale), distance

    def _residual(self, estimate: RelativeEstimate, pose: PoseMeasurement, factors: FloatArray) -> FloatArray:
        """Return the innovation (6,): pose minus its prediction, correlated errors included."""
        R_camera_from_eci = matrix_from_quat(pose.q_camera_from_eci_wxyz)
        R_eci_from_lvlh = self._lvlh(pose.t_s).R_eci_from_lvlh
        origin = target_origin_offset_m(estimate, self._com)
        predicted = R_camera_from_eci @ (origin - R_eci_from_lvlh @ estimate.position_lvlh_m)
        measured = quat_multiply(quat_conjugate(pose.q_camera_from_eci_wxyz), pose.q_camera_from_target_wxyz)
        turn = rotvec_between(estimate.q_eci_from_target_wxyz, measured)
        difference = np.concatenate([pose.t_camera_from_target_m - predicted, turn])
        return np.asarray(difference - pose.correlated_errors(factors) @ estimate.pose_bias)

    def _sensitivity(
        self, estimate: RelativeEstimate, pose: PoseMeasurement, factors: FloatArray
    ) -> FloatArray:
        """Return the sensitivity (6, 18) of a pose to the errors of the estimate."""
        R_camera_from_eci = matrix_from_quat(pose.q_camera_from_eci_wxyz)
        R_eci_from_target = matrix_from_quat(estimate.q_eci_from_target_wxyz)
        H = np.zeros((6, 18))
        H[:3, P] = -R_camera_from_eci @ self._lvlh(pose.t_s).R_eci_from_lvlh
        H[:3, A] = R_camera_from_eci @ R_eci_from_target @ skew(self._com)
        H[3:, A] = np.eye(3)
        H[:, B] = pose.correlated_errors(factors)
        return H

    def _first_estimate(self, pose: PoseMeasurement) -> RelativeEstimate:
        """Return the estimate from one pose, with zero velocity and rate and a wide covariance."""
        q = quat_normalize(
            quat_multiply(quat_conjugate(pose.q_camera_from_eci_wxyz), pose.q_camera_from_target_wxyz)
        )
        R_eci_from_target = matrix_from_quat(q)
        R_eci_from_camera = matrix_from_quat(pose.q_camera_from_eci_wxyz).T
        R_lvlh_from_eci = self._lvlh(pose.t_s).R_eci_from_lvlh.T
        p = -(R_eci_from_target @ self._com) - R_eci_from_camera @ pose.t_camera_from_target_m
        M = np.zeros((12, 6))
        M[P, :3] = -R_lvlh_from_eci @ R_eci_from_camera
        M[P, 3:] = R_lvlh_from_eci @ R_eci_from_target @ skew(self._com)
        M[A, 3:] = np.eye(3)
        scale = ErrorScale(settings=self.settings.scale)
        of_bias = M @ pose.correlated_errors(scale.factors)
        of_new = M @ pose.new_errors(scale.factors)
        covariance = np.zeros((18, 18))
        covariance[:12, :12] = of_new @ of_new.T + of_bias @ of_bias.T
        # the pose's error adds to the estimate, so the remaining error has the opposite sign
        covariance[:12, B], covariance[B, :12] = -of_bias, -of_bias.T
        covariance[B, B] = np.eye(6)
        covariance[V, V] += self.settings.start_speed_m_s**2 * np.eye(3)
        covariance[W, W] += self.settings.start_rate_rad_s**2 * np.eye(3)
        return RelativeEstimate(
            t_s=pose.t_s,
            position_lvlh_m=R_lvlh_from_eci @ p,
            velocity_lvlh_m_s=np.zeros(3),
            q_eci_from_target_wxyz=q,
            omega_target_rad_s=np.zeros(3),
            joint_covariance=covariance,
            error_scale=scale,
        )


def _is_same_pose(a: PoseMeasurement, b: PoseMeasurement) -> bool:
    return np.array_equal(a.q_camera_from_target_wxyz, b.q_camera_from_target_wxyz) and np.array_equal(
        a.t_camera_from_target_m, b.t_camera_from_target_m
    )
