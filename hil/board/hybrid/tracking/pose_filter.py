"""Multiplicative extended Kalman filter of the target's pose in the camera frame and its rates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat

Array = np.ndarray

# Process noise, one sigma: angular [rad s-2] and linear [m s-2] acceleration.
ANGULAR_ACCELERATION_RAD_S2, LINEAR_ACCELERATION_M_S2 = 0.01, 0.02

# Initial one-sigma errors of the rates [rad/s, m/s].
INITIAL_RATE_RAD_S, INITIAL_VELOCITY_M_S = float(np.radians(6.0)), 0.3


@dataclass(frozen=True, eq=False)
class TrackState:
    """Pose and rates with their covariance.

    Parameters
    ----------
    q : (4,) array
        Attitude quaternion, camera from target.
    t : (3,) array
        Target position, camera frame [m].
    w : (3,) array
        Angular rate, camera axes [rad/s].
    v : (3,) array
        Velocity, camera axes [m/s].
    P : (12, 12) array
        Covariance of rotation, translation, angular rate and velocity, camera axes.
    """

    q: Array
    t: Array
    w: Array
    v: Array
    P: Array


def first_state(q: Array, t: Array, covariance: Array) -> TrackState:
    """Return the state after a first pose; its rates are unknown.

    Parameters
    ----------
    q : (4,) array
        Attitude quaternion, camera from target.
    t : (3,) array
        Target position, camera frame [m].
    covariance : (6, 6) array
        Covariance of rotation and translation.
    """
    P = np.zeros((12, 12))
    P[:6, :6] = covariance
    P[6:9, 6:9] = np.eye(3) * INITIAL_RATE_RAD_S**2
    P[9:, 9:] = np.eye(3) * INITIAL_VELOCITY_M_S**2
    return TrackState(q, t, np.zeros(3), np.zeros(3), P)


def predict(state: TrackState, dt_s: float) -> TrackState:
    """Return the state ``dt_s`` later: constant rates, white-noise accelerations.

    The attitude error is a small rotation that multiplies the attitude.

    References
    ----------
    Lefferts, Markley & Shuster (1982), Kalman filtering for spacecraft attitude estimation, J. Guidance 5(5).
    """
    turn = quat.from_rotvec(state.w * dt_s)
    F = np.eye(12)
    # the attitude error rotates with the attitude
    F[:3, :3] = quat.matrix(turn)
    F[:3, 6:9] = np.eye(3) * dt_s
    F[3:6, 9:] = np.eye(3) * dt_s
    Q = np.zeros((12, 12))
    for first, sigma in ((0, ANGULAR_ACCELERATION_RAD_S2), (3, LINEAR_ACCELERATION_M_S2)):
        a, b = slice(first, first + 3), slice(first + 6, first + 9)
        Q[a, a] = np.eye(3) * sigma**2 * dt_s**4 / 4
        Q[a, b] = Q[b, a] = np.eye(3) * sigma**2 * dt_s**3 / 2
        Q[b, b] = np.eye(3) * sigma**2 * dt_s**2
    return TrackState(
        quat.normalise(quat.multiply(turn, state.q)),
        state.t + state.v * dt_s,
        state.w,
        state.v,
        F @ state.P @ F.T + Q,
    )


def innovation(state: TrackState, q: Array, t: Array) -> Array:
    """Return the rotation and translation (6,) from the state's pose to a measured one, camera axes."""
    d = quat.normalise(quat.multiply(q, state.q * (1.0, -1.0, -1.0, -1.0)))
    size = float(np.linalg.norm(d[1:]))
    turn = d[1:] * (2 * np.arctan2(size, float(d[0])) / size if size > 1e-12 else 2.0)
    return np.concatenate([turn, t - state.t])


def update(state: TrackState, q: Array, t: Array, covariance: Array) -> "tuple[TrackState, float]":
    """Return the state updated with a pose, and the squared Mahalanobis distance of the innovation (6 DOF).

    Parameters
    ----------
    state : TrackState
        State before the update.
    q : (4,) array
        Measured attitude quaternion, camera from target.
    t : (3,) array
        Measured target position, camera frame [m].
    covariance : (6, 6) array
        Covariance of the measured pose.
    """
    y = innovation(state, q, t)
    S = state.P[:6, :6] + covariance
    K = np.linalg.solve(S, state.P[:6]).T
    x = K @ y
    I_KH = np.eye(12)
    I_KH[:, :6] -= K
    # Joseph form: stays symmetric and positive
    P = I_KH @ state.P @ I_KH.T + K @ covariance @ K.T
    return (
        TrackState(
            quat.normalise(quat.multiply(quat.from_rotvec(x[:3]), state.q)),
            state.t + x[3:6],
            state.w + x[6:9],
            state.v + x[9:],
            0.5 * (P + P.T),
        ),
        float(y @ np.linalg.solve(S, y)),
    )
