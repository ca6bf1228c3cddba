"""Free flight: drift, natural circumnavigation, the safe ellipse, and drift kept within a shell by thrusters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from msgspec import Meta

from flyaround.simulator.runtime.sections import Degrees, Metres, MetresXyz, Range, SpeedXyz
from flyaround.simulator.world.guidance.chaser import Chaser
from flyaround.simulator.world.guidance.thrusters import Thrusters
from flyaround.simulator.world.relative.clohessy_wiltshire import bounded_ellipse, mean_motion_rad_s

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.orbit.propagation import Elements


class FreeDrift(Chaser, tag_field="mode", tag="drift", frozen=True, kw_only=True):
    """Free flight from a state in the rotating LVLH frame."""

    ballistic: ClassVar[bool] = True
    position_lvlh_m: MetresXyz
    velocity_lvlh_m_s: SpeedXyz = (0.0, 0.0, 0.0)

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        """Return the initial state.

        Returns
        -------
        position_lvlh_m : (3,) array
            Position at t = 0, LVLH [m], at any ``t_s``.
        velocity_lvlh_m_s : (3,) array
            Velocity at t = 0 in the rotating frame [m s-1].
        """
        return np.array(self.position_lvlh_m, float), np.array(self.velocity_lvlh_m_s, float)


class _BoundedFlight(Chaser, frozen=True, kw_only=True):
    """Free flight on a relative orbit that closes."""

    ballistic: ClassVar[bool] = True
    radial_m: Range
    # 0 at the top (radially outward), 90 behind the target
    phase_deg: Degrees = 0.0
    centre_along_track_m: Metres = 0.0

    def _cross_track_motion(self) -> tuple[float, float]:
        """Return the cross-track amplitude [m] and its phase ahead of the radial motion [deg]."""
        raise NotImplementedError

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        """Return the initial state next to a target on a circular orbit."""
        return self._start(n_rad_s, 0.0, 0.0)

    def start_lvlh(self, orbit: Elements, mu_m3_s2: float) -> tuple[FloatArray, FloatArray]:
        """Return the initial state, bounded on the target's own orbit."""
        n = mean_motion_rad_s(orbit.semi_major_axis_m, mu_m3_s2)
        return self._start(n, orbit.eccentricity, orbit.true_anomaly_rad)

    def _start(
        self, n_rad_s: float, eccentricity: float, true_anomaly_rad: float
    ) -> tuple[FloatArray, FloatArray]:
        cross_track_m, cross_phase_deg = self._cross_track_motion()
        return bounded_ellipse(
            n_rad_s,
            self.radial_m,
            np.radians(self.phase_deg),
            cross_track_m,
            np.radians(cross_phase_deg),
            self.centre_along_track_m,
            eccentricity,
            true_anomaly_rad,
        )


class NaturalCircumnavigation(
    _BoundedFlight, tag_field="mode", tag="circumnavigation", frozen=True, kw_only=True
):
    """Free flight once per orbit about the target, the 2:1 ellipse of a circular one; ``cross_phase_deg = 90`` is safe.

    ``radial_m`` is half the radial size; along-track it is twice that.
    """

    # out-of-plane amplitude, and its phase relative to the radial motion
    cross_track_m: Annotated[float, Meta(ge=0, le=1e5)] = 0.0
    cross_phase_deg: Degrees = 90.0

    def _cross_track_motion(self) -> tuple[float, float]:
        return self.cross_track_m, self.cross_phase_deg


class SafeEllipse(_BoundedFlight, tag_field="mode", tag="safe_ellipse", frozen=True, kw_only=True):
    """Free flight on an ellipse that stays clear of the along-track axis by the smaller of its two half sizes.

    Radial and cross-track motion are 90 degrees apart, so that one is largest where the other is zero.

    References
    ----------
    D'Amico & Montenbruck (2006), J. Guidance 29(3): parallel eccentricity and inclination vectors.
    """

    cross_track_m: Range

    def _cross_track_motion(self) -> tuple[float, float]:
        return self.cross_track_m, 90.0

    @property
    def min_distance_m(self) -> float:
        """Smallest distance from the along-track axis [m]; a drift of the ellipse along the axis does not change it."""
        return min(self.radial_m, self.cross_track_m)


class RangeKeeping(Chaser, tag_field="mode", tag="keep_range", frozen=True, kw_only=True):
    """Free drift that thrusters reverse before the range leaves ``near_m`` to ``far_m``."""

    position_lvlh_m: MetresXyz
    near_m: Range
    far_m: Range
    # radial speed after each correction, and margin inside the shell at which corrections are made
    turn_m_s: Annotated[float, Meta(gt=0, le=1)] = 0.01
    margin_m: Annotated[float, Meta(gt=0, le=1e3)] = 1.0

    @property
    def acting_thrusters(self) -> Thrusters:
        """The chaser's thrusters, or default ones, which this mode needs."""
        return self.thrusters or Thrusters()

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        """Return the initial state, at rest in LVLH.

        Returns
        -------
        position_lvlh_m : (3,) array
            Position at t = 0, LVLH [m], at any ``t_s``.
        velocity_lvlh_m_s : (3,) array
            Zero.
        """
        return np.array(self.position_lvlh_m, float), np.zeros(3)

    def phase(self, t_s: float) -> str:  # noqa: ARG002
        """Return the constant phase.

        Returns
        -------
        str
            ``range keeping`` at any ``t_s``.
        """
        return "range keeping"

    def impulse_lvlh(self, p: FloatArray, v: FloatArray, n_rad_s: float) -> FloatArray:  # noqa: ARG002
        """Compute the velocity change of a correction from the chaser's LVLH state.

        Returns
        -------
        (3,) array
            Velocity change, LVLH [m s-1]. It is zero while the range is well inside its limits, or the chaser
            already returns. Otherwise the radial velocity afterwards is ``turn_m_s`` back into the shell, and the
            speed across the line of sight at most ``turn_m_s``.
        """
        distance = float(np.linalg.norm(p))
        radial = p / distance
        radial_speed = float(v @ radial)
        leaving_far = distance > self.far_m - self.margin_m and radial_speed > -self.turn_m_s / 2
        leaving_near = distance < self.near_m + self.margin_m and radial_speed < self.turn_m_s / 2
        if not (leaving_far or leaving_near):
            return np.zeros(3)
        transverse = v - radial_speed * radial
        speed = float(np.linalg.norm(transverse))
        # motion across the line of sight soon increases the range, so it has the same speed limit
        limited = transverse * min(1.0, self.turn_m_s / max(speed, 1e-12))
        velocity = (-self.turn_m_s if leaving_far else self.turn_m_s) * radial + limited
        return np.asarray(velocity - v)


class FollowedChaser(Chaser, tag_field="mode", tag="oem", frozen=True, kw_only=True):
    """A chaser that follows a CCSDS OEM (path relative to the scenario's folder), including its burns."""

    ballistic: ClassVar[bool] = True
    file: str
    # name or identifier, in a file with several
    satellite: str | None = None

    def phase(self, t_s: float) -> str:  # noqa: ARG002
        """Return the constant phase.

        Returns
        -------
        str
            ``ephemeris`` at any ``t_s``.
        """
        return "ephemeris"
