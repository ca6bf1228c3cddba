"""A multiplicative extended Kalman filter on the target's pose in the camera frame and its rates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat

Array = np.ndarray

# Process noise: angular [rad s-2] and linear [m s-2] acceleration, one sigma.
TURN_ACCELERATION, SHIFT_ACCELERATION = 0.01, 0.02

# Initial sigma of the rates [rad/s, m/s].
FIRST_TURN_RATE, FIRST_SHIFT_RATE = float(np.radians(6.0)), 0.3


@dataclass(frozen=True, eq=False)
class TrackState:
    """Pose and rates with their covariance.

    Parameters
    ----------
    q, t : (4,), (3,) array
        The pose: ``x_camera = R(q) x_target + t``.
    w, v : (3,) array
        Angular rate [rad/s] and velocity [m/s], camera axes.
    P : (12, 12) array
        Covariance of rotation, translation, angular rate and velocity, camera axes.
    """

    q: Array
    t: Array
    w: Array
    v: Array
    P: Array


def first_state(q: Array, t: Array, covariance: Array) -> TrackState:
    """Return the state after one pose; its rates are unknown.

    Parameters
    ----------
    q, t : (4,), (3,) array
        Pose of the target: quaternion and position [m].
    covariance : (6, 6) array
        Its covariance.
    """
    P = np.zeros((12, 12))
    P[:6, :6] = covariance
    P[6:9, 6:9] = np.eye(3) * FIRST_TURN_RATE**2
    P[9:, 9:] = np.eye(3) * FIRST_SHIFT_RATE**2
    return TrackState(q, t, np.zeros(3), np.zeros(3), P)


def predict(state: TrackState, dt_s: float) -> TrackState:
    """Return the state ``dt_s`` later: constant rates, white accelerations.

    References
    ----------
    Lefferts, Markley & Shuster (1982), Kalman filtering for spacecraft attitude estimation, J. Guidance 5(5): the
    attitude's error is a small turn that multiplies it.
    """
    turn = quat.from_rotvec(state.w * dt_s)
    F = np.eye(12)
    # an error of the attitude turns with it
    F[:3, :3] = quat.matrix(turn)
    F[:3, 6:9] = np.eye(3) * dt_s
    F[3:6, 9:] = np.eye(3) * dt_s
    Q = np.zeros((12, 12))
    for at, sigma in ((0, TURN_ACCELERATION), (3, SHIFT_ACCELERATION)):
        a, b = slice(at, at + 3), slice(at + 6, at + 9)
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
    """Return rotation and translation (6,) from the state's pose to a measured one, camera axes."""
    d = quat.normalise(quat.multiply(q, state.q * (1.0, -1.0, -1.0, -1.0)))
    size = float(np.linalg.norm(d[1:]))
    turn = d[1:] * (2 * np.arctan2(size, float(d[0])) / size if size > 1e-12 else 2.0)
    return np.concatenate([turn, t - state.t])


def update(state: TrackState, q: Array, t: Array, covariance: Array) -> "tuple[TrackState, float]":
    """Return the state updated with a pose, and the innovation's squared Mahalanobis length (6 degrees of freedom).

    Parameters
    ----------
    covariance : (6, 6) array
        Of the measured pose.
    """
    y = innovation(state, q, t)
    S = state.P[:6, :6] + covariance
    K = np.linalg.solve(S, state.P[:6]).T
    x = K @ y
    I_KH = np.eye(12)
    I_KH[:, :6] -= K
    # Joseph's form stays symmetric and positive
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
