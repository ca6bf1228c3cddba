"""How the chaser moves: each mode gives a position and velocity in the target's LVLH frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Protocol

import numpy as np

from simulator.runtime.arrays import Vec3
from simulator.world.relative.clohessy_wiltshire import bounded_ellipse

if TYPE_CHECKING:
    from simulator.runtime.arrays import FloatArray


class Guidance(Protocol):
    """A motion mode of the chaser.

    A ``ballistic`` mode gives the state at t = 0 only; from there gravity alone moves the chaser. Any other
    mode is a path that the chaser's control is taken to follow exactly.
    """

    ballistic: ClassVar[bool]

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:
        """Position [m] and velocity [m s-1] of the chaser in LVLH; ``n_rad_s`` is the mean motion."""
        ...


@dataclass(frozen=True, kw_only=True)
class Hold:
    """Station keeping at a point of LVLH."""

    ballistic: ClassVar[bool] = False
    position_lvlh_m: Vec3

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        """Always the same point, at rest in LVLH."""
        return np.array(self.position_lvlh_m, float), np.zeros(3)


@dataclass(frozen=True, kw_only=True)
class FreeDrift:
    """No thrust from the given state on."""

    ballistic: ClassVar[bool] = True
    position_lvlh_m: Vec3
    velocity_lvlh_m_s: Vec3 = (0.0, 0.0, 0.0)

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        """The initial state."""
        return np.array(self.position_lvlh_m, float), np.array(self.velocity_lvlh_m_s, float)


@dataclass(frozen=True, kw_only=True)
class NaturalCircumnavigation:
    """No thrust, on the 2:1 ellipse that closes about the target once per orbit.

    Parameters
    ----------
    radial_m : half the radial size; along-track it is twice that.
    phase_rad : 0 at the top (radially outward), pi / 2 behind the target.
    cross_track_m, cross_phase_rad : out-of-plane swing and its lead over the radial one; pi / 2 makes the
        ellipse passively safe.
    centre_along_track_m : where the ellipse is centred on the along-track axis.
    """

    ballistic: ClassVar[bool] = True
    radial_m: float
    phase_rad: float = 0.0
    cross_track_m: float = 0.0
    cross_phase_rad: float = np.pi / 2
    centre_along_track_m: float = 0.0

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        """The initial state, by Clohessy-Wiltshire."""
        return bounded_ellipse(
            n_rad_s,
            self.radial_m,
            self.phase_rad,
            self.cross_track_m,
            self.cross_phase_rad,
            self.centre_along_track_m,
        )


@dataclass(frozen=True, kw_only=True)
class StraightApproach:
    """A straight line in LVLH at a closing speed to a hold point: V-bar along y, R-bar along x.

    Parameters
    ----------
    start_lvlh_m, hold_lvlh_m : ends of the line.
    speed_m_s : closing speed until braking.
    braking_m_s2 : constant deceleration that ends at rest on the hold point.
    """

    ballistic: ClassVar[bool] = False
    start_lvlh_m: Vec3
    hold_lvlh_m: Vec3
    speed_m_s: float
    braking_m_s2: float = 0.005

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        """Cruise, brake, hold."""
        start, hold = np.array(self.start_lvlh_m, float), np.array(self.hold_lvlh_m, float)
        length = float(np.linalg.norm(hold - start))
        if length == 0.0:
            return hold, np.zeros(3)
        along = (hold - start) / length
        # a line too short for the cruise speed is flown at the speed that braking can still take off
        speed = min(self.speed_m_s, np.sqrt(2 * self.braking_m_s2 * length))
        cruise_s = (length - speed**2 / (2 * self.braking_m_s2)) / speed
        braking_s = speed / self.braking_m_s2
        if t_s <= cruise_s:
            done, rate = speed * t_s, speed
        elif t_s < cruise_s + braking_s:
            left_s = cruise_s + braking_s - t_s
            done, rate = length - 0.5 * self.braking_m_s2 * left_s**2, self.braking_m_s2 * left_s
        else:
            done, rate = length, 0.0
        return start + done * along, rate * along


@dataclass(frozen=True, kw_only=True)
class ForcedFlyaround:
    """A circle about the target in a plane fixed in LVLH, at a period of one's choice.

    Parameters
    ----------
    radius_m : range at t = 0 and, unless ``far_radius_m`` is given, always.
    period_s : time of one turn.
    inclination_rad : of the circle's plane against the orbit plane; pi reverses the sense.
    node_rad : direction of the ascending node in the orbit plane, from radial (0) to along-track (pi / 2).
    phase_rad : place on the circle at t = 0, from the node.
    far_radius_m, range_period_s : when given, the range swings between ``radius_m`` and ``far_radius_m`` as
        a cosine of this period.
    """

    ballistic: ClassVar[bool] = False
    radius_m: float
    period_s: float
    inclination_rad: float = 0.0
    node_rad: float = 0.0
    phase_rad: float = 0.0
    far_radius_m: float | None = None
    range_period_s: float = 120.0

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        """The point on the circle and its velocity."""
        rate = 2 * np.pi / self.period_s
        angle = self.phase_rad + rate * t_s
        cn, sn = np.cos(self.node_rad), np.sin(self.node_rad)
        ci, si = np.cos(self.inclination_rad), np.sin(self.inclination_rad)
        e1, e2 = np.array([cn, sn, 0.0]), np.array([-sn * ci, cn * ci, si])
        out = np.cos(angle) * e1 + np.sin(angle) * e2
        turn = rate * (-np.sin(angle) * e1 + np.cos(angle) * e2)
        swing = 0.0 if self.far_radius_m is None else self.far_radius_m - self.radius_m
        swing_rate = 2 * np.pi / self.range_period_s
        radius = self.radius_m + 0.5 * swing * (1 - np.cos(swing_rate * t_s))
        radius_rate = 0.5 * swing * swing_rate * np.sin(swing_rate * t_s)
        return radius * out, radius * turn + radius_rate * out
