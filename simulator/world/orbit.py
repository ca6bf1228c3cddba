"""Orbits: Keplerian elements, and numerical propagation of the target and of a chaser relative to it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import solve_ivp

from simulator.world.constants import MU_EARTH_M3_S2

if TYPE_CHECKING:
    from collections.abc import Callable

    from scipy.integrate import OdeSolution

    from simulator.arrays import FloatArray
    from simulator.world.forces import Forces

_RTOL = 1e-12
_MAX_STEP_S = 60.0
"""Bounds the error of the interpolant between steps (7th order) below the micrometre."""


@dataclass(frozen=True, kw_only=True)
class Elements:
    """Osculating Keplerian elements on GCRS axes.

    Parameters
    ----------
    semi_major_axis_m : [m]. eccentricity : 0 <= e < 1.
    inclination_rad, raan_rad, argument_of_perigee_rad, true_anomaly_rad : [rad].
    """

    semi_major_axis_m: float
    eccentricity: float = 0.0
    inclination_rad: float = 0.0
    raan_rad: float = 0.0
    argument_of_perigee_rad: float = 0.0
    true_anomaly_rad: float = 0.0


def state_from_elements(e: Elements, mu_m3_s2: float = MU_EARTH_M3_S2) -> tuple[FloatArray, FloatArray]:
    """Position [m] and velocity [m s-1] in GCRS, each (3,).

    References
    ----------
    Vallado (2013), Fundamentals of Astrodynamics, algorithm 10.
    """
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
    """Osculating elements of a bound orbit.

    Angles that a circular or equatorial orbit leaves open are measured from the node, or from the x axis,
    with the undefined ones set to zero.

    References
    ----------
    Vallado (2013), Fundamentals of Astrodynamics, algorithm 9.
    """
    r, v = np.asarray(r_eci_m, float), np.asarray(v_eci_m_s, float)
    rn = float(np.linalg.norm(r))
    h = np.cross(r, v)
    ecc = np.cross(v, h) / mu_m3_s2 - r / rn
    e = float(np.linalg.norm(ecc))
    a = 1 / (2 / rn - float(v @ v) / mu_m3_s2)
    inclination = float(np.arctan2(np.hypot(h[0], h[1]), h[2]))
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
    """Angle from ``start`` to ``end`` counted right-handed about ``axis``, 0..2 pi [rad]."""
    sine = float(np.cross(start, end) @ axis) / float(np.linalg.norm(axis))
    return float(np.arctan2(sine, float(start @ end))) % (2 * np.pi)


@dataclass(frozen=True, eq=False)
class OrbitTrack:
    """A propagated target, and with it perhaps a chaser in free flight, over ``0 <= t <= duration_s``.

    Parameters
    ----------
    forces : what it was propagated under.
    duration_s : end of the propagated span [s].
    solution : interpolant of [r, v] or [r, v, rho, rho'] in GCRS.
    """

    forces: Forces
    duration_s: float
    solution: Callable[[float], FloatArray]

    def __call__(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Position [m] and velocity [m s-1] of the target in GCRS."""
        y = self.solution(t_s)
        return y[:3], y[3:6]

    def acceleration(self, t_s: float) -> FloatArray:
        """Acceleration of the target in GCRS [m s-2]."""
        return self.forces.target(t_s, *self(t_s))

    def relative(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Chaser minus target: position [m] and velocity [m s-1] along GCRS axes (not a rotating frame)."""
        y = self.solution(t_s)
        return y[6:9], y[9:12]


def propagate(
    r_eci_m: FloatArray,
    v_eci_m_s: FloatArray,
    duration_s: float,
    forces: Forces,
    relative: tuple[FloatArray, FloatArray] | None = None,
) -> OrbitTrack:
    """Propagate the target and, when ``relative`` is given, a chaser in free flight beside it.

    The chaser is integrated as its difference from the target: metres beside seven million metres would lose
    the last digits of the range, their difference does not.

    Parameters
    ----------
    r_eci_m, v_eci_m_s : (3,) target at t = 0, GCRS.
    duration_s : span [s].
    forces : what accelerates the two.
    relative : chaser minus target at t = 0, position [m] and velocity [m s-1] along GCRS axes.

    References
    ----------
    Hairer, Norsett & Wanner (1993), Solving Ordinary Differential Equations I: DOP853, rtol 1e-12.
    """
    y0 = [r_eci_m, v_eci_m_s, *(relative or ())]
    atol = np.repeat([1e-7, 1e-10, 1e-10, 1e-13], 3)[: 3 * len(y0)]
    return OrbitTrack(
        forces, duration_s, _solve(_derivative(forces, len(y0) > 2), np.concatenate(y0), duration_s, atol)
    )


def _derivative(forces: Forces, with_chaser: bool) -> Callable[[float, FloatArray], FloatArray]:  # noqa: FBT001
    def target_only(t: float, y: FloatArray) -> FloatArray:
        return np.concatenate([y[3:6], forces.target(t, y[:3], y[3:6])])

    def both(t: float, y: FloatArray) -> FloatArray:
        a, difference = forces.pair(t, y[:3], y[3:6], y[6:9], y[9:12])
        return np.concatenate([y[3:6], a, y[9:12], difference])

    return both if with_chaser else target_only


def _solve(
    f: Callable[[float, FloatArray], FloatArray], y0: FloatArray, duration_s: float, atol: FloatArray
) -> OdeSolution:
    result = solve_ivp(
        f,
        (0.0, duration_s),
        y0,
        method="DOP853",
        rtol=_RTOL,
        atol=atol,
        max_step=_MAX_STEP_S,
        dense_output=True,
    )
    if not result.success or result.sol is None:
        raise ValueError(f"the orbit could not be propagated over {duration_s} s: {result.message}")
    return result.sol
