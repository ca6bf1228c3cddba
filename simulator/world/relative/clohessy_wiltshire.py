"""Clohessy-Wiltshire equations: relative motion about a circular orbit, to first order."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray


def mean_motion_rad_s(semi_major_axis_m: float, mu_m3_s2: float) -> float:
    """Compute the mean motion of an orbit.

    Returns
    -------
    float
        Mean motion [rad s-1].
    """
    return float(np.sqrt(mu_m3_s2 / semi_major_axis_m**3))


def transition_matrix(n_rad_s: float, t_s: float) -> FloatArray:
    """Return the (6, 6) matrix that carries an LVLH state [x y z vx vy vz] over ``t_s``.

    Parameters
    ----------
    n_rad_s : float
        Mean motion of the target's circular orbit.
    t_s : float
        Elapsed time [s].

    Returns
    -------
    (6, 6) array
        Matrix in SI units.

    References
    ----------
    Clohessy & Wiltshire (1960), J. Aerospace Sciences 27(9); Alfriend et al. (2010), chapter 5.
    """
    n, nt = n_rad_s, n_rad_s * t_s
    s, c = np.sin(nt), np.cos(nt)
    return np.array(
        [
            [4 - 3 * c, 0, 0, s / n, 2 * (1 - c) / n, 0],
            [6 * (s - nt), 1, 0, -2 * (1 - c) / n, (4 * s - 3 * nt) / n, 0],
            [0, 0, c, 0, 0, s / n],
            [3 * n * s, 0, 0, c, 2 * s, 0],
            [-6 * n * (1 - c), 0, 0, -2 * s, 4 * c - 3, 0],
            [0, 0, -n * s, 0, 0, c],
        ]
    )


def bounded_ellipse(
    n_rad_s: float,
    radial_m: float,
    phase_rad: float,
    cross_track_m: float = 0.0,
    cross_phase_rad: float = 0.0,
    centre_along_track_m: float = 0.0,
    eccentricity: float = 0.0,
    true_anomaly_rad: float = 0.0,
) -> tuple[FloatArray, FloatArray]:
    """Return an LVLH state on a relative orbit that closes after one revolution of the target.

    About a circular orbit it is the 2:1 ellipse ``x = a cos p``, ``y = y0 - 2 a sin p``, ``z = b cos(p + q)``. About an
    eccentric one ``p`` advances with the true anomaly ``nu``; with ``rho = 1 + e cos(nu)``,
    ``y = (y0 - (1 + rho) a sin p) / rho`` and ``z = (1 + e) / rho b cos(p + q)``. This is the solution of the linear
    equations without a secular term: both orbits have equal energies to first order.

    If radial and cross-track motion are 90 degrees apart (``q = pi / 2`` or ``-pi / 2``), the chaser never crosses the
    target's along-track axis. A drift along that axis then causes no collision: a safe ellipse.

    Parameters
    ----------
    n_rad_s : float
        Mean motion of the target.
    radial_m : float
        Radial amplitude ``a``.
    phase_rad : float
        Phase ``p`` of the radial motion.
    cross_track_m : float, optional
        Cross-track amplitude ``b``.
    cross_phase_rad : float, optional
        Phase ``q`` of the cross-track motion relative to the radial one.
    centre_along_track_m : float, optional
        Along-track position ``y0`` of the centre.
    eccentricity : float, optional
        Eccentricity ``e`` of the target's orbit.
    true_anomaly_rad : float, optional
        True anomaly ``nu`` of the target.

    Returns
    -------
    tuple of array
        Position [m] and velocity [m s-1] in LVLH, each (3,).

    References
    ----------
    D'Amico & Montenbruck (2006), Proximity operations of formation-flying spacecraft using an
    eccentricity/inclination vector separation, J. Guidance 29(3). Yamanaka & Ankersen (2002), New state transition
    matrix for relative motion on an arbitrary elliptical orbit, J. Guidance 25(1): the in-plane solution without its
    integral J.
    """
    e, p, pq = eccentricity, phase_rad, phase_rad + cross_phase_rad
    a, b, y0 = radial_m, cross_track_m * (1 + e), centre_along_track_m
    rho = 1 + e * np.cos(true_anomaly_rad)
    rate = n_rad_s * rho**2 / (1 - e * e) ** 1.5
    rho_rate = -e * np.sin(true_anomaly_rad) * rate
    y, z = (y0 - (1 + rho) * a * np.sin(p)) / rho, b * np.cos(pq) / rho
    y_rate = -((1 + rho) * a * np.cos(p) * rate + rho_rate * (a * np.sin(p) + y)) / rho
    z_rate = -(b * np.sin(pq) * rate + rho_rate * z) / rho
    return np.array([a * np.cos(p), y, z]), np.array([-a * np.sin(p) * rate, y_rate, z_rate])
