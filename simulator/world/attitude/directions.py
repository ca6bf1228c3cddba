"""Directions at which a spacecraft may point, and the attitude that two of them define (TRIAD)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from flyaround.simulator.world.constants import DAY_S
from flyaround.simulator.world.ephemeris.sun_moon import sun_eci_m
from flyaround.simulator.world.frames.rotation import quat_from_matrix
from flyaround.simulator.world.frames.vectors import cross, length

if TYPE_CHECKING:
    from collections.abc import Callable

    from scipy.interpolate import CubicSpline

    from flyaround.simulator.runtime.arrays import FloatArray, Vec3
    from flyaround.simulator.world.ephemeris.body import Body
    from flyaround.simulator.world.orbit.propagation import OrbitTrack
    from flyaround.simulator.world.time.instant import Instant

    Direction = Callable[[float], tuple[FloatArray, FloatArray]]

DirectionName = Literal["nadir", "zenith", "along_track", "cross_track", "sun", "chaser"]

_NODE_S = 1800.0  # spacing of the spline of the Sun's position
_MIN_SINE = 1e-3
"""Sine of the angle between two directions below which the rotation about them is undefined (3 arcmin)."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PointingContext:
    """Reference directions that a target can point at during a flight.

    Parameters
    ----------
    orbit : OrbitTrack
        Orbit of the target.
    body : Body
        Central body.
    epoch : Instant
        Start of the flight.
    duration_s : float
        Length of the flight [s].
    relative : callable
        Function of time: chaser minus target, position [m] and velocity [m s-1], GCRS axes.
    """

    orbit: OrbitTrack
    body: Body
    epoch: Instant
    duration_s: float
    relative: Callable[[float], tuple[FloatArray, FloatArray]]

    def direction(self, name: DirectionName) -> Direction:
        """Return a named direction: unit vector along GCRS axes and its derivative [s-1], over time."""
        match name:
            case "nadir" | "zenith":
                return RadialDirection(self.orbit, 1.0 if name == "zenith" else -1.0)
            case "along_track" | "cross_track":
                return LvlhAxisDirection(self.orbit, 1 if name == "along_track" else 2)
            case "chaser":
                return ChaserDirection(self.relative)
            case "sun":
                return SunDirection(self.orbit, self._sun())

    def _sun(self) -> CubicSpline:
        """Return a spline of the apparent Sun's position from the central body over the flight [m]."""
        from scipy.interpolate import CubicSpline  # noqa: PLC0415 - slow to import

        nodes = np.arange(-1, int(np.ceil(self.duration_s / _NODE_S)) + 3) * _NODE_S
        positions = [
            sun_eci_m(self.epoch.tt1, self.epoch.tt2 + t / DAY_S)
            - self.body.geocentric_state(self.epoch.plus(float(t)))[0]
            for t in nodes
        ]
        return CubicSpline(nodes, np.array(positions))


@dataclass(frozen=True, eq=False)
class RadialDirection:
    """Direction away from the central body (``sign`` 1) or towards it (-1)."""

    orbit: OrbitTrack
    sign: float

    def __call__(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Return the unit vector and its derivative."""
        r, v = self.orbit(t_s)
        return unit_and_rate(self.sign * r, self.sign * v)


@dataclass(frozen=True, eq=False)
class LvlhAxisDirection:
    """Along-track (``column`` 1) or cross-track (2) direction."""

    orbit: OrbitTrack
    column: int

    def __call__(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Return the unit vector and its derivative."""
        frame = self.orbit.frame(t_s)
        u = frame.R_eci_from_lvlh[:, self.column]
        return u, cross(frame.omega_eci_rad_s, u)


@dataclass(frozen=True, eq=False)
class ChaserDirection:
    """Direction to the chaser."""

    relative: Callable[[float], tuple[FloatArray, FloatArray]]

    def __call__(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Return the unit vector and its derivative."""
        return unit_and_rate(*self.relative(t_s))


@dataclass(frozen=True, eq=False)
class SunDirection:
    """Direction to the apparent Sun.

    Parameters
    ----------
    orbit : OrbitTrack
        Orbit of the craft.
    sun_m : CubicSpline
        Position of the Sun relative to the central body over time, GCRS axes [m].
    """

    orbit: OrbitTrack
    sun_m: CubicSpline

    def __call__(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Return the unit vector and its derivative."""
        r, v = self.orbit(t_s)
        return unit_and_rate(self.sun_m(t_s) - r, self.sun_m(t_s, 1) - v)


@dataclass(frozen=True, eq=False, kw_only=True)
class TwoAxisTrack:
    """Attitude with one axis along a direction and another as near to a second direction as possible.

    Parameters
    ----------
    axis_body : array
        Body axis that is pointed.
    toward : Direction
        Direction that it follows.
    second_axis_body : array
        Body axis that is pointed as closely as possible.
    second_toward : Direction
        Direction that the second axis follows.
    """

    axis_body: Vec3
    toward: Direction
    second_axis_body: Vec3
    second_toward: Direction

    def __call__(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Return ``q_eci_from_body_wxyz`` (unit) and the angular velocity relative to ECI, body axes [rad s-1].

        References
        ----------
        Black (1964), A passive system for determining the attitude of a satellite, AIAA J. 2(7).
        """
        first, first_rate = self.toward(t_s)
        second, second_rate = self.second_toward(t_s)
        normal = cross(first, second)
        z, z_rate = unit_and_rate(normal, cross(first_rate, second) + cross(first, second_rate))
        y, y_rate = cross(z, first), cross(z_rate, first) + cross(z, first_rate)
        R_eci_from_triad = np.array([first, y, z]).T
        R_body_from_triad = triad(self.axis_body, self.second_axis_body)
        rate = np.array([y_rate @ z, z_rate @ first, first_rate @ y])
        return quat_from_matrix(R_eci_from_triad @ R_body_from_triad.T), R_body_from_triad @ rate

    def is_undefined(self, t_s: float) -> bool:
        """Return True if the two directions are parallel, so that the attitude is undefined."""
        return length(cross(self.toward(t_s)[0], self.second_toward(t_s)[0])) < _MIN_SINE


def triad(first: Vec3, second: Vec3) -> FloatArray:
    """Return the (3, 3) matrix with columns along ``first``, towards ``second`` and normal to both."""
    a, b = np.array(first, float), np.array(second, float)
    x = a / length(a)
    z = cross(x, b)
    z = z / length(z)
    return np.array([x, cross(z, x), z]).T


def unit_and_rate(v: FloatArray, v_rate: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the unit vector (3,) along ``v`` and its derivative, given the derivative of ``v``."""
    n = length(v)
    u = v / n
    return u, (v_rate - (v_rate @ u) * u) / n
