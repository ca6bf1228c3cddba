"""Orbits: Keplerian elements, and numerical propagation of the target and of a chaser relative to it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Protocol

import numpy as np

from flyaround.simulator.world.constants import MU_EARTH_M3_S2
from flyaround.simulator.world.frames.lvlh import Lvlh, lvlh_frame
from flyaround.simulator.world.orbit.burns import Burn, burn_edges_s, eci_from_own_lvlh
from flyaround.simulator.world.orbit.dense_output import DenseOutput, check_span, integrate

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.orbit.forces import ForceModel

_TARGET_ONLY = 6
"""Width of a state without a chaser."""
_RTOL = 1e-12  # relative tolerance of the integrator
_MAX_STEP_S = 60.0
"""Largest step [s]; bounds the interpolant's error between steps (7th order) below the micrometre."""
_SUNLIT_STEP_S = 20.0
"""Largest step with solar radiation pressure, which changes abruptly at the shadow's edge [s]: 0.1 mm per orbit."""


@dataclass(frozen=True, kw_only=True)
class Elements:
    """Osculating Keplerian elements on GCRS axes.

    Parameters
    ----------
    semi_major_axis_m : float
        Semi-major axis [m].
    eccentricity : float, optional
        0 <= e < 1.
    inclination_rad : float, optional
        Inclination.
    raan_rad : float, optional
        Right ascension of the ascending node.
    argument_of_perigee_rad : float, optional
        Argument of perigee.
    true_anomaly_rad : float, optional
        True anomaly.

    Raises
    ------
    ValueError
        If the orbit is not bound, or an angle is not finite.
    """

    semi_major_axis_m: float
    eccentricity: float = 0.0
    inclination_rad: float = 0.0
    raan_rad: float = 0.0
    argument_of_perigee_rad: float = 0.0
    true_anomaly_rad: float = 0.0

    def __post_init__(self) -> None:
        if not (0 < self.semi_major_axis_m < np.inf and 0 <= self.eccentricity < 1):
            raise ValueError(
                f"semi-major axis {self.semi_major_axis_m:g} m and eccentricity {self.eccentricity:g} are not of a "
                "bound orbit: allowed are more than 0, and 0 to less than 1"
            )
        angles = (self.inclination_rad, self.raan_rad, self.argument_of_perigee_rad, self.true_anomaly_rad)
        if not np.isfinite(angles).all():
            raise ValueError(f"an angle of the orbit is not finite: {angles}")


def state_from_elements(e: Elements, mu_m3_s2: float = MU_EARTH_M3_S2) -> tuple[FloatArray, FloatArray]:
    """Compute position and velocity from elements.

    Returns
    -------
    r_eci_m : (3,) array
        Position from the central body, GCRS axes [m].
    v_eci_m_s : (3,) array
        Velocity, GCRS axes [m s-1].

    Raises
    ------
    ValueError
        If the gravitational parameter is not positive.

    References
    ----------
    Vallado (2013), Fundamentals of Astrodynamics, 4th ed., algorithm 10.
    """
    if not 0 < mu_m3_s2 < np.inf:
        raise ValueError(
            f"the gravitational parameter is {mu_m3_s2} m3 s-2, allowed: more than 0, and finite"
        )
    p = e.semi_major_axis_m * (1 - e.eccentricity**2)
    nu = e.true_anomaly_rad
    r = p / (1 + e.eccentricity * np.cos(nu))
    speed = np.sqrt(mu_m3_s2 / p)
    P, Q = _perifocal_axes(e)
    position = r * (np.cos(nu) * P + np.sin(nu) * Q)
    velocity = speed * (-np.sin(nu) * P + (e.eccentricity + np.cos(nu)) * Q)
    return position, velocity


def _perifocal_axes(e: Elements) -> tuple[FloatArray, FloatArray]:
    co, so = np.cos(e.raan_rad), np.sin(e.raan_rad)
    cw, sw = np.cos(e.argument_of_perigee_rad), np.sin(e.argument_of_perigee_rad)
    ci, si = np.cos(e.inclination_rad), np.sin(e.inclination_rad)
    P = np.array([co * cw - so * sw * ci, so * cw + co * sw * ci, sw * si])
    Q = np.array([-co * sw - so * cw * ci, -so * sw + co * cw * ci, cw * si])
    return P, Q


def elements_from_state(
    r_eci_m: FloatArray, v_eci_m_s: FloatArray, mu_m3_s2: float = MU_EARTH_M3_S2
) -> Elements:
    """Compute the osculating elements of a bound orbit.

    Returns
    -------
    Elements
        Inclination from 0 to pi, other angles from 0 to 2 pi. On a circular orbit the argument of perigee is zero,
        and the true anomaly is measured from the node. On an equatorial orbit the node is the x axis.

    Raises
    ------
    ValueError
        If the state is of no bound orbit: too fast, or a fall.

    References
    ----------
    Vallado (2013), Fundamentals of Astrodynamics, 4th ed., algorithm 9.
    """
    r, v = np.asarray(r_eci_m, float), np.asarray(v_eci_m_s, float)
    rn = float(np.linalg.norm(r))
    h = np.cross(r, v)
    if not np.linalg.norm(h) > 0:  # NaN too
        raise ValueError(f"position {r.tolist()} and velocity {v.tolist()} span no orbit plane")
    ecc = np.cross(v, h) / mu_m3_s2 - r / rn
    e = float(np.linalg.norm(ecc))
    a = 1 / (2 / rn - float(v @ v) / mu_m3_s2)
    inclination = float(np.arctan2(np.hypot(h[0], h[1]), h[2]))
    # below this tilt and eccentricity, node and perigee are rounding errors
    equatorial = np.hypot(h[0], h[1]) < 1e-11 * np.linalg.norm(h)
    node = np.array([1.0, 0.0, 0.0]) if equatorial else np.array([-h[1], h[0], 0.0])
    node = node / np.linalg.norm(node)
    if e < 1e-11:
        e, perigee = 0.0, node
    else:
        perigee = ecc / e
    return Elements(
        semi_major_axis_m=a,
        eccentricity=e,
        inclination_rad=inclination,
        raan_rad=float(np.arctan2(node[1], node[0])) % (2 * np.pi),
        argument_of_perigee_rad=_angle_about(h, node, perigee),
        true_anomaly_rad=_angle_about(h, perigee, r),
    )


def _angle_about(axis: FloatArray, start: FloatArray, end: FloatArray) -> float:
    """Return the angle from ``start`` to ``end`` about ``axis``, right-handed, 0..2 pi [rad]."""
    sine = float(np.cross(start, end) @ axis) / float(np.linalg.norm(axis))
    return float(np.arctan2(sine, float(start @ end))) % (2 * np.pi)


class Solution(Protocol):
    """A state over time and its derivative: propagated (`DenseOutput`) or recorded."""

    def __call__(self, t_s: float) -> FloatArray:
        """Return the state."""
        ...

    def rate(self, t_s: float) -> FloatArray:
        """Return its derivative."""
        ...


@dataclass(frozen=True, eq=False)
class OrbitTrack:
    """A propagated target, optionally with a chaser in free flight, over ``0 <= t <= duration_s``.

    Parameters
    ----------
    forces : ForceModel
        Forces of the propagation.
    duration_s : float
        End of the propagated span [s].
    solution : Solution
        [r, v] or [r, v, rho, rho'] along GCRS axes, and its derivative ``solution.rate``.
    burns : tuple of Burn, optional
        Burns of the target, which are in ``solution`` already.
    """

    forces: ForceModel
    duration_s: float
    solution: Solution
    burns: tuple[Burn, ...] = ()

    def __call__(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Return position [m] and velocity [m s-1] of the target in GCRS."""
        y = self.solution(t_s)
        return y[:3], y[3:6]

    def acceleration(self, t_s: float) -> FloatArray:
        """Compute the acceleration of the target from the forces and its burns of finite duration.

        Returns
        -------
        (3,) array
            Acceleration, GCRS axes [m s-2].
        """
        r, v = self(t_s)
        a = self.forces.target(t_s, r, v)
        for burn in self.burns:
            if burn.thrusts_throughout(t_s, t_s):
                a = a + eci_from_own_lvlh(burn.acceleration_lvlh_m_s2, r, v)
        return a

    def frame(self, t_s: float) -> Lvlh:
        """Return the target's LVLH frame.

        Returns
        -------
        Lvlh
            Frame whose rate is from the derivative of the track instead of the forces; it agrees to 1e-12 rad/s.
        """
        y = self.solution(t_s)
        return lvlh_frame(y[:3], y[3:6], self.solution.rate(t_s)[3:6])

    def relative(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Return the state of the chaser relative to the target, if the track has a chaser.

        Returns
        -------
        tuple of array
            Chaser minus target: position (3,) [m] and velocity (3,) [m s-1] along GCRS axes, not in a rotating
            frame. Both are empty if the track is of the target alone.
        """
        y = self.solution(t_s)
        return y[6:9], y[9:12]


def propagate(
    r_eci_m: FloatArray,
    v_eci_m_s: FloatArray,
    duration_s: float,
    forces: ForceModel,
    relative: tuple[FloatArray, FloatArray] | None = None,
    burns: tuple[Burn, ...] = (),
    along: Solution | None = None,
) -> OrbitTrack:
    """Propagate the target and, if ``relative`` is given, a chaser in free flight next to it.

    The chaser's state is integrated relative to the target, because the difference of two positions of seven million
    metres would lose the last digits of the range. The span is divided where a burn starts or ends.

    Parameters
    ----------
    r_eci_m : (3,) array
        Position of the target at t = 0, GCRS [m].
    v_eci_m_s : (3,) array
        Velocity of the target at t = 0, GCRS [m s-1].
    duration_s : float
        Span [s].
    forces : ForceModel
        Forces on both craft.
    relative : tuple of array, optional
        Chaser minus target at t = 0, position [m] and velocity [m s-1] along GCRS axes.
    burns : tuple of Burn, optional
        Burns of both craft.
    along : Solution, optional
        Prescribed states of the target. Only the chaser's relative state is integrated then.

    Returns
    -------
    OrbitTrack
        States over the span, GCRS [m], [m s-1].

    Raises
    ------
    UserError
        If the integrator fails, as in a fall into the body's centre, or drag acts on a craft below 80 km.
    ValueError
        If the span is negative, or a number is not finite.

    References
    ----------
    Hairer, Norsett & Wanner (1993), Solving Ordinary Differential Equations I: DOP853, rtol 1e-12.
    """
    check_span(duration_s)
    y = np.concatenate([r_eci_m, v_eci_m_s, *(relative or ())])
    max_step_s = _SUNLIT_STEP_S if forces.solar_pressure else _MAX_STEP_S
    atol = np.repeat([1e-7, 1e-10, 1e-10, 1e-13], 3)[: len(y)]
    edges = [0.0, *burn_edges_s(burns, 0.0, duration_s), duration_s]
    parts = []
    for start, end in pairwise(edges):
        if along is not None:
            y = np.concatenate([along(start)[:6], y[6:]])
        y = _after_impulses(y, start, burns)
        active_burns = tuple(b for b in burns if b.thrusts_throughout(start, end))
        parts.append(
            integrate(
                _derivative(forces, active_burns, along, with_chaser=len(y) > _TARGET_ONLY),
                y,
                (start, end),
                rtol=_RTOL,
                atol=atol,
                max_step_s=max_step_s,
            )
        )
        y = parts[-1](end)
    return OrbitTrack(
        forces, duration_s, DenseOutput.concatenate(parts), tuple(b for b in burns if b.craft == "target")
    )


def _after_impulses(y: FloatArray, t_s: float, burns: tuple[Burn, ...]) -> FloatArray:
    """Return the state after the impulsive burns at a time."""
    y = y.copy()
    for burn in burns:
        if burn.duration_s > 0 or burn.start_s != t_s:
            continue
        delta_v = eci_from_own_lvlh(burn.delta_v_lvlh_m_s, y[:3], y[3:6])
        if burn.craft == "target":
            y[3:6] += delta_v
            delta_v = -delta_v
        if len(y) > _TARGET_ONLY:
            y[9:12] += delta_v
    return y


def _derivative(
    forces: ForceModel, active_burns: tuple[Burn, ...], along: Solution | None, *, with_chaser: bool
) -> Callable[[float, FloatArray], FloatArray]:
    def target_only(t: float, y: FloatArray) -> FloatArray:
        return np.concatenate([y[3:6], forces.target(t, y[:3], y[3:6])])

    def target_and_chaser(t: float, y: FloatArray) -> FloatArray:
        a, difference = forces.pair(t, y[:3], y[3:6], y[6:9], y[9:12])
        return np.concatenate([y[3:6], a, y[9:12], difference])

    def chaser_only(t: float, y: FloatArray) -> FloatArray:
        target = along(t) if along is not None else y
        _, difference = forces.pair(t, target[:3], target[3:6], y[6:9], y[9:12])
        return np.concatenate([np.zeros(6), y[9:12], difference])

    free = (target_and_chaser if along is None else chaser_only) if with_chaser else target_only
    if not active_burns:
        return free

    def with_burns(t: float, y: FloatArray) -> FloatArray:
        derivative = free(t, y)
        for burn in active_burns:
            target_state = y if along is None else along(t)
            acceleration = eci_from_own_lvlh(burn.acceleration_lvlh_m_s2, target_state[:3], target_state[3:6])
            if burn.craft == "target":
                derivative[3:6] += acceleration
                acceleration = -acceleration
            if with_chaser:
                derivative[9:12] += acceleration
        return derivative

    return with_burns
