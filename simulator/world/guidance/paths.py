"""More ways to move the chaser: the safe ellipse, waypoints, the glideslope, keeping the range within bounds."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from simulator.runtime.arrays import Vec3
from simulator.world.relative.clohessy_wiltshire import bounded_ellipse

if TYPE_CHECKING:
    from simulator.runtime.arrays import FloatArray


@dataclass(frozen=True, kw_only=True)
class SafeEllipse:
    """No thrust, on a closed ellipse that never comes near the target's along-track axis, however it drifts along it.

    Radial and cross-track swing are a quarter turn apart, so that one is largest where the other is zero.

    Parameters
    ----------
    radial_m, cross_track_m : half sizes; the smaller is the least distance from the along-track axis.
    phase_rad : 0 at the top (radially outward). centre_along_track_m : centre of the ellipse.

    References
    ----------
    D'Amico & Montenbruck (2006), J. Guidance 29(3): parallel eccentricity and inclination vectors.
    """

    ballistic: ClassVar[bool] = True
    radial_m: float
    cross_track_m: float
    phase_rad: float = 0.0
    centre_along_track_m: float = 0.0

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        """The initial state, by Clohessy-Wiltshire."""
        return bounded_ellipse(
            n_rad_s, self.radial_m, self.phase_rad, self.cross_track_m, np.pi / 2, self.centre_along_track_m
        )

    @property
    def least_distance_m(self) -> float:
        """From the along-track axis [m]."""
        return min(self.radial_m, self.cross_track_m)


@dataclass(frozen=True, kw_only=True)
class Waypoints:
    """From point to point along straight lines of LVLH, with a rest at each.

    Parameters
    ----------
    points_lvlh_m : at least one. speed_m_s : mean over each leg. rest_s : at each point.
    """

    ballistic: ClassVar[bool] = False
    points_lvlh_m: tuple[Vec3, ...]
    speed_m_s: float
    rest_s: float = 0.0

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        """Each leg starts and ends at rest: its progress is ``x^2 (3 - 2 x)`` in the share ``x`` of its time."""
        points = np.array(self.points_lvlh_m, float)
        left_s = t_s
        for a, b in pairwise(points):
            left_s -= self.rest_s
            if left_s <= 0:
                return a, np.zeros(3)
            leg_s = float(np.linalg.norm(b - a)) / self.speed_m_s
            if left_s < leg_s:
                x = left_s / leg_s
                return a + x * x * (3 - 2 * x) * (b - a), 6 * x * (1 - x) / leg_s * (b - a)
            left_s -= leg_s
        return points[-1], np.zeros(3)


@dataclass(frozen=True, kw_only=True)
class Glideslope:
    """A straight line on which the speed falls in proportion to the distance left, to a final speed.

    Parameters
    ----------
    start_lvlh_m, end_lvlh_m : the line. start_m_s, end_m_s : speed at its ends.

    References
    ----------
    Hablani, Tapper & Dana-Bashian (2002), Guidance and relative navigation for autonomous rendezvous in a
    circular orbit, J. Guidance 25(3), eq. 30-36.
    """

    ballistic: ClassVar[bool] = False
    start_lvlh_m: Vec3
    end_lvlh_m: Vec3
    start_m_s: float
    end_m_s: float

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        """Distance left: ``d' = -(end + slope d)``."""
        start, end = np.array(self.start_lvlh_m, float), np.array(self.end_lvlh_m, float)
        length = float(np.linalg.norm(start - end))
        if length == 0.0:
            return end, np.zeros(3)
        out = (start - end) / length
        slope = (self.start_m_s - self.end_m_s) / length
        if abs(slope) * length < 1e-9 * self.end_m_s:
            left, speed = length - self.end_m_s * t_s, self.end_m_s
        else:
            fallen = np.exp(-slope * t_s)
            left = length * fallen - self.end_m_s * (1 - fallen) / slope
            speed = self.end_m_s + slope * left
        if left <= 0.0:
            return end, np.zeros(3)
        return end + left * out, -speed * out


@dataclass(frozen=True, kw_only=True)
class RangeKeeping:
    """Free drift that is turned back whenever it is about to leave a shell about the target.

    Parameters
    ----------
    position_lvlh_m : start. near_m, far_m : the shell. turn_m_s : radial speed after each correction.
    margin_m : how far inside the shell the corrections are made.
    """

    ballistic: ClassVar[bool] = False
    position_lvlh_m: Vec3
    near_m: float
    far_m: float
    turn_m_s: float = 0.01
    margin_m: float = 1.0

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        """The start, at rest in LVLH."""
        return np.array(self.position_lvlh_m, float), np.zeros(3)

    def impulse_lvlh(self, p: FloatArray, v: FloatArray, n_rad_s: float) -> FloatArray:  # noqa: ARG002
        """Nothing while the range is well inside or the chaser returns; else the radial speed is reversed."""
        distance = float(np.linalg.norm(p))
        out = p / distance
        rate = float(v @ out)
        leaving_far = distance > self.far_m - self.margin_m and rate > -self.turn_m_s / 2
        leaving_near = distance < self.near_m + self.margin_m and rate < self.turn_m_s / 2
        if not (leaving_far or leaving_near):
            return np.zeros(3)
        sideways = v - rate * out
        speed = float(np.linalg.norm(sideways))
        # what goes sideways soon goes outward: it is held to the same speed
        kept = sideways * min(1.0, self.turn_m_s / max(speed, 1e-12))
        wanted = (-self.turn_m_s if leaving_far else self.turn_m_s) * out + kept
        return np.asarray(wanted - v)
