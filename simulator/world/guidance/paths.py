"""Paths in LVLH for the chaser: hold point, V-bar and R-bar approach, forced flyaround, waypoints, glideslope."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from msgspec import Meta

from flyaround.simulator.runtime.arrays import Vec3, vec3
from flyaround.simulator.runtime.sections import Degrees, Inclination, Metres, MetresXyz, Range, Seconds
from flyaround.simulator.world.guidance.chaser import Chaser

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.runtime.arrays import FloatArray

# Unit vector along the V-bar, LVLH.
_VBAR: Vec3 = (0.0, 1.0, 0.0)


class Hold(Chaser, tag_field="mode", tag="hold", frozen=True, kw_only=True):
    """Station keeping at a point."""

    position_lvlh_m: MetresXyz

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        """Return the constant point, at rest in LVLH.

        Returns
        -------
        position_lvlh_m : (3,) array
            The point at any ``t_s``, LVLH [m].
        velocity_lvlh_m_s : (3,) array
            Zero.
        """
        return np.array(self.position_lvlh_m, float), np.zeros(3)


class StraightApproach(Chaser, frozen=True, kw_only=True):
    """Approach along one axis from ``start_m`` to ``hold_m``."""

    axis_lvlh: ClassVar[Vec3]
    start_m: Metres
    hold_m: Metres
    # closing speed
    speed_m_s: Annotated[float, Meta(gt=0, le=100)]
    # deceleration to rest at the hold point
    braking_m_s2: Annotated[float, Meta(gt=0, le=100)] = 0.005

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        """Return the state while cruising, braking or holding."""
        axis = np.array(self.axis_lvlh)
        start, hold = self.start_m * axis, self.hold_m * axis
        length = self._length_m
        if length == 0.0:
            return hold, np.zeros(3)
        direction = (hold - start) / length
        speed = self._cruise_m_s
        cruise_s = (length - speed**2 / (2 * self.braking_m_s2)) / speed
        braking_s = speed / self.braking_m_s2
        if t_s <= cruise_s:
            distance, rate = speed * t_s, speed
        elif t_s < cruise_s + braking_s:
            remaining_s = cruise_s + braking_s - t_s
            distance, rate = (
                length - 0.5 * self.braking_m_s2 * remaining_s**2,
                self.braking_m_s2 * remaining_s,
            )
        else:
            distance, rate = length, 0.0
        return start + distance * direction, rate * direction

    def phase(self, t_s: float) -> str:
        """Return the phase by the speed: cruise, braking or hold."""
        speed = float(np.linalg.norm(self.state_lvlh(t_s, 0.0)[1]))
        if speed == 0.0:
            return "hold"
        return "cruise" if speed >= self._cruise_m_s * (1 - 1e-12) else "braking"

    @property
    def _length_m(self) -> float:
        return abs(self.hold_m - self.start_m)

    @property
    def _cruise_m_s(self) -> float:
        """Cruise speed [m s-1], reduced on a line that is too short to brake from the specified speed."""
        return min(self.speed_m_s, float(np.sqrt(2 * self.braking_m_s2 * self._length_m)))


class VbarApproach(StraightApproach, tag_field="mode", tag="vbar", frozen=True, kw_only=True):
    """Straight along the velocity axis from ``start_m`` to ``hold_m`` (positive: ahead of the target)."""

    axis_lvlh: ClassVar[Vec3] = (0.0, 1.0, 0.0)


class RbarApproach(StraightApproach, tag_field="mode", tag="rbar", frozen=True, kw_only=True):
    """Straight along the radial axis from ``start_m`` to ``hold_m`` (positive: above the target)."""

    axis_lvlh: ClassVar[Vec3] = (1.0, 0.0, 0.0)


class ForcedFlyaround(Chaser, tag_field="mode", tag="flyaround", frozen=True, kw_only=True):
    """Forced circle in a plane fixed in LVLH; with ``far_radius_m`` the range oscillates."""

    # range at the start and, unless far_radius_m is given, always
    radius_m: Range
    # period of one revolution
    period_s: Seconds
    # inclination of the circle's plane against the orbit plane; 180 reverses the sense
    inclination_deg: Inclination = 0.0
    # ascending node in the orbit plane, from radial (0) to along-track (90)
    node_deg: Degrees = 0.0
    # initial position on the circle, from the node
    phase_deg: Degrees = 0.0
    # the range oscillates between radius_m and this range, as a cosine
    far_radius_m: Range | None = None
    # period of that oscillation
    range_period_s: Seconds = 120.0

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        """Return the point on the circle and its velocity ``t_s`` seconds after the start.

        Returns
        -------
        position_lvlh_m : (3,) array
            Position, LVLH [m]; its length is the present range, between ``radius_m`` and ``far_radius_m``.
        velocity_lvlh_m_s : (3,) array
            Its derivative in the rotating frame [m s-1].
        """
        rate = 2 * np.pi / self.period_s
        node, inclination = np.radians(self.node_deg), np.radians(self.inclination_deg)
        angle = np.radians(self.phase_deg) + rate * t_s
        cn, sn = np.cos(node), np.sin(node)
        ci, si = np.cos(inclination), np.sin(inclination)
        e1, e2 = np.array([cn, sn, 0.0]), np.array([-sn * ci, cn * ci, si])
        radial = np.cos(angle) * e1 + np.sin(angle) * e2
        tangential_velocity = rate * (-np.sin(angle) * e1 + np.cos(angle) * e2)
        range_change_m = 0.0 if self.far_radius_m is None else self.far_radius_m - self.radius_m
        range_rad_s = 2 * np.pi / self.range_period_s
        radius = self.radius_m + 0.5 * range_change_m * (1 - np.cos(range_rad_s * t_s))
        radius_rate = 0.5 * range_change_m * range_rad_s * np.sin(range_rad_s * t_s)
        return radius * radial, radius * tangential_velocity + radius_rate * radial


class Waypoints(Chaser, tag_field="mode", tag="waypoints", frozen=True, kw_only=True):
    """Straight lines from point to point, with rest at each end."""

    points_lvlh_m: Annotated[list[MetresXyz], Meta(min_length=1, max_length=1000)]
    # mean speed on each leg
    speed_m_s: Annotated[float, Meta(gt=0, le=100)]
    # time at rest at each point
    rest_s: Annotated[float, Meta(ge=0, le=1e6)] = 0.0

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        """Return the state on the present leg, or at rest at a point.

        The progress on a leg is ``x^2 (3 - 2 x)`` after a fraction ``x`` of its time.

        Returns
        -------
        position_lvlh_m : (3,) array
            Position, LVLH [m]; the last point after the last leg.
        velocity_lvlh_m_s : (3,) array
            Its derivative in the rotating frame [m s-1], zero at both ends of a leg.
        """
        points = np.array(self.points_lvlh_m, float)
        remaining_s = t_s
        for a, b in pairwise(points):
            remaining_s -= self.rest_s
            if remaining_s <= 0:
                return a, np.zeros(3)
            leg_s = float(np.linalg.norm(b - a)) / self.speed_m_s
            if remaining_s < leg_s:
                x = remaining_s / leg_s
                return a + x * x * (3 - 2 * x) * (b - a), 6 * x * (1 - x) / leg_s * (b - a)
            remaining_s -= leg_s
        return points[-1], np.zeros(3)

    def phase(self, t_s: float) -> str:
        """Return the leg or the rest that ``t_s`` falls in.

        Returns
        -------
        str
            ``rest k`` at point k, ``leg k`` from there to the next point, both counted from 1; ``hold`` after the
            last leg.
        """
        remaining_s = t_s
        points = np.array(self.points_lvlh_m, float)
        for k, (a, b) in enumerate(pairwise(points), start=1):
            remaining_s -= self.rest_s
            if remaining_s <= 0 < self.rest_s:
                return f"rest {k}"
            leg_s = float(np.linalg.norm(b - a)) / self.speed_m_s
            if remaining_s < leg_s:
                return f"leg {k}"
            remaining_s -= leg_s
        return "hold"


class Glideslope(Chaser, tag_field="mode", tag="glideslope", frozen=True, kw_only=True):
    """A straight line on which the speed falls with the remaining distance, to ``end_m_s``; then rest at its end.

    The velocity steps to zero there. A scenario's ``end_m_s`` is at most its ``start_m_s``.
    """

    start_lvlh_m: MetresXyz
    end_lvlh_m: MetresXyz
    # speed at the two ends
    start_m_s: Annotated[float, Meta(gt=0, le=100)]
    end_m_s: Annotated[float, Meta(gt=0, le=100)]

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        """Return the state on the line, or at rest at its end.

        The remaining distance ``d`` obeys ``d' = -(end_m_s + slope d)``.

        Returns
        -------
        position_lvlh_m : (3,) array
            Position, LVLH [m].
        velocity_lvlh_m_s : (3,) array
            Velocity towards the end in the rotating frame [m s-1]; zero at the end.

        References
        ----------
        Hablani, Tapper & Dana-Bashian (2002), Guidance and relative navigation for autonomous rendezvous in a
        circular orbit, J. Guidance 25(3).
        """
        start, end = np.array(self.start_lvlh_m, float), np.array(self.end_lvlh_m, float)
        length = float(np.linalg.norm(start - end))
        if length == 0.0:
            return end, np.zeros(3)
        direction = (start - end) / length
        slope = (self.start_m_s - self.end_m_s) / length
        if abs(slope) * length < 1e-9 * self.end_m_s:
            remaining, speed = length - self.end_m_s * t_s, self.end_m_s
        else:
            decay = np.exp(-slope * t_s)
            remaining = length * decay - self.end_m_s * (1 - decay) / slope
            speed = self.end_m_s + slope * remaining
        if remaining <= 0.0:
            return end, np.zeros(3)
        return end + remaining * direction, -speed * direction

    def phase(self, t_s: float) -> str:
        """Return the phase by the position.

        Returns
        -------
        str
            ``glideslope``, and ``hold`` from the arrival at the end on.
        """
        p, _ = self.state_lvlh(t_s, 0.0)
        return "hold" if np.array_equal(p, np.array(self.end_lvlh_m, float)) else "glideslope"


def approach_axis_lvlh(chaser: Chaser) -> Vec3:
    """Return the direction of approach, from the target outwards, LVLH.

    It points along the axis of the corridor, or else to the last point of the path that is not the centre of mass.
    Without either it is V-bar.

    Returns
    -------
    (3,) tuple of float
        Unit vector.
    """
    keep_out = chaser.keep_out
    points: Sequence[Vec3] = ()
    if keep_out is not None and keep_out.corridor_axis_lvlh is not None:
        points = (keep_out.corridor_axis_lvlh,)
    else:
        match chaser:
            case Hold():
                points = (chaser.position_lvlh_m,)
            case VbarApproach() | RbarApproach():
                axis = np.array(chaser.axis_lvlh)
                points = (vec3(chaser.start_m * axis), vec3(chaser.hold_m * axis))
            case Glideslope():
                points = (chaser.start_lvlh_m, chaser.end_lvlh_m)
            case Waypoints():
                points = chaser.points_lvlh_m
    last = next((point for point in reversed(points) if any(point)), _VBAR)
    return vec3(np.array(last) / np.linalg.norm(last))
