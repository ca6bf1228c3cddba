"""Yamanaka-Ankersen equations: relative motion about an elliptic orbit, to first order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.world.constants import MU_EARTH_M3_S2

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.orbit.propagation import Elements

# rotation to the paper's axes (x along-track, y opposite to the orbit normal, z to the Earth) from LVLH
_PAPER_FROM_LVLH = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])


@dataclass(frozen=True)
class _OrbitPoint:
    """A point of the orbit, by the paper's symbols.

    Attributes
    ----------
    nu : float
        True anomaly [rad].
    rho : float
        ``1 + e cos(nu)``.
    s : float
        ``rho sin(nu)``.
    c : float
        ``rho cos(nu)``.
    s_slope : float
        Derivative of ``s`` with respect to ``nu``.
    c_slope : float
        Derivative of ``c`` with respect to ``nu``.
    """

    nu: float
    rho: float
    s: float
    c: float
    s_slope: float
    c_slope: float

    @staticmethod
    def from_anomaly(nu: float, e: float) -> _OrbitPoint:
        rho = 1 + e * np.cos(nu)
        return _OrbitPoint(
            nu=nu,
            rho=rho,
            s=rho * np.sin(nu),
            c=rho * np.cos(nu),
            s_slope=np.cos(nu) + e * np.cos(2 * nu),
            c_slope=-(np.sin(nu) + e * np.sin(2 * nu)),
        )


def elliptic_transition_matrix(orbit: Elements, t_s: float, mu_m3_s2: float = MU_EARTH_M3_S2) -> FloatArray:
    """Return the (6, 6) matrix that carries an LVLH state [x y z vx vy vz] over ``t_s``.

    Parameters
    ----------
    orbit : Elements
        The target's elements at the start. For a circular orbit the result is that of Clohessy-Wiltshire.
    t_s : float
        Elapsed time [s].
    mu_m3_s2 : float, optional
        Gravitational parameter.

    Returns
    -------
    (6, 6) array
        Matrix in SI units.

    References
    ----------
    Yamanaka & Ankersen (2002), New state transition matrix for relative motion on an arbitrary elliptical
    orbit, J. Guidance 25(1).
    """
    e = orbit.eccentricity
    p = orbit.semi_major_axis_m * (1 - e * e)
    k2 = np.sqrt(mu_m3_s2 / p**3)
    start = _OrbitPoint.from_anomaly(orbit.true_anomaly_rad, e)
    end = _OrbitPoint.from_anomaly(true_anomaly_after(orbit, t_s, mu_m3_s2), e)
    J = k2 * t_s
    in_plane = _in_plane(end, e, J) @ _in_plane_start_inverse(start, e)
    out_of_plane = _out_of_plane(end.nu - start.nu)
    in_anomaly = np.zeros((6, 6))
    xz, y = np.ix_([0, 2, 3, 5], [0, 2, 3, 5]), np.ix_([1, 4], [1, 4])
    in_anomaly[xz], in_anomaly[y] = in_plane, out_of_plane
    in_time = _time_from_anomaly(end, e, k2) @ in_anomaly @ _anomaly_from_time(start, e, k2)
    T = np.kron(np.eye(2), _PAPER_FROM_LVLH)
    return np.asarray(T.T @ in_time @ T)


def _in_plane(point: _OrbitPoint, e: float, J: float) -> FloatArray:
    """Return the fundamental matrix of the in-plane equations: rows x, z, x', z'; columns the four constants."""
    s, c, rho = point.s, point.c, point.rho
    return np.array(
        [
            [1, -c * (1 + 1 / rho), s * (1 + 1 / rho), 3 * rho * rho * J],
            [0, s, c, 2 - 3 * e * s * J],
            [0, 2 * s, 2 * c - e, 3 * (1 - 2 * e * s * J)],
            [0, point.s_slope, point.c_slope, -3 * e * (point.s_slope * J + s / (rho * rho))],
        ]
    )


def _in_plane_start_inverse(point: _OrbitPoint, e: float) -> FloatArray:
    """Return the (4, 4) matrix from the state at the start, where J = 0, to the constants."""
    return np.asarray(np.linalg.inv(_in_plane(point, e, 0.0)))


def _out_of_plane(angle: float) -> FloatArray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s], [-s, c]])


def _anomaly_from_time(point: _OrbitPoint, e: float, k2: float) -> FloatArray:
    """Return the (6, 6) matrix from position and velocity to scaled position and its derivative by true anomaly."""
    eye = np.eye(3)
    sine = e * np.sin(point.nu)
    return np.block([[point.rho * eye, 0 * eye], [-sine * eye, eye / (k2 * point.rho)]])


def _time_from_anomaly(point: _OrbitPoint, e: float, k2: float) -> FloatArray:
    eye = np.eye(3)
    sine = e * np.sin(point.nu)
    return np.block([[eye / point.rho, 0 * eye], [k2 * sine * eye, k2 * point.rho * eye]])


def true_anomaly_after(orbit: Elements, t_s: float, mu_m3_s2: float = MU_EARTH_M3_S2) -> float:
    """Compute the true anomaly ``t_s`` later on a Keplerian orbit.

    Returns
    -------
    float
        Angle [rad], not wrapped: it goes on from the anomaly at the start by 2 pi each revolution.

    References
    ----------
    Vallado (2013), Fundamentals of Astrodynamics, 4th ed., algorithm 2 (Newton on Kepler's equation).
    """
    e, nu = orbit.eccentricity, orbit.true_anomaly_rad
    stretch = np.sqrt((1 - e) / (1 + e))
    E0 = 2 * np.arctan2(stretch * np.sin(nu / 2), np.cos(nu / 2))
    M = E0 - e * np.sin(E0) + np.sqrt(mu_m3_s2 / orbit.semi_major_axis_m**3) * t_s
    turns = np.floor(M / (2 * np.pi) + 0.5)
    m = M - 2 * np.pi * turns
    E = m + e * np.sin(m)
    for _ in range(50):
        step = (E - e * np.sin(E) - m) / (1 - e * np.cos(E))
        E -= step
        if abs(step) < 1e-15:
            break
    return float(2 * np.arctan2(np.sin(E / 2), stretch * np.cos(E / 2)) + 2 * np.pi * turns)
