"""Tests of the world's propagators against conservation laws and closed solutions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.world.attitude.rigid_body import propagate_attitude
from flyaround.simulator.world.constants import DAY_S, MU_EARTH_M3_S2
from flyaround.simulator.world.frames.lvlh import lvlh_frame
from flyaround.simulator.world.frames.rotation import matrix_from_quat
from flyaround.simulator.world.orbit.gravity import Gravity
from flyaround.simulator.world.orbit.propagation import Elements, propagate, state_from_elements
from flyaround.simulator.world.relative.clohessy_wiltshire import mean_motion_rad_s, transition_matrix
from flyaround.simulator.world.relative.yamanaka_ankersen import elliptic_transition_matrix
from tools.validation.rows import Row

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.orbit.propagation import OrbitTrack


def physics() -> list[Row]:
    """Return all rows of conservation laws and closed solutions."""
    return [*conservation(), *tumbles(), *linear_models()]


def conservation() -> list[Row]:
    """Test energy and angular momentum where the model conserves them."""
    r, v = state_from_elements(
        Elements(semi_major_axis_m=6978e3, eccentricity=0.01, inclination_rad=1.7, raan_rad=0.4)
    )
    times = np.linspace(0.0, DAY_S, 200)
    rows = []
    for gravity, name in ((Gravity(j2=0.0), "two-body"), (Gravity(), "two-body + J2")):
        track = propagate(r, v, DAY_S, gravity)
        energy = [float(v @ v) / 2 + gravity.potential(r) for r, v in map(track, times)]
        # the field is symmetric about the pole, so the polar component of angular momentum is conserved in both models
        momentum = [float(np.cross(r, v)[2]) for r, v in map(track, times)]
        for quantity, values in (("energy", energy), ("axial momentum", momentum)):
            rows.append(
                Row(
                    what=f"{quantity} over a day, {name}, relative",
                    against="conservation",
                    unit="1",
                    goal=1e-12,
                    measured=float(np.ptp(values) / abs(values[0])),
                )
            )
    return rows


def tumbles() -> list[Row]:
    """Test that free rotation conserves energy and momentum; for an axisymmetric body, test Euler's solution."""
    J = np.diag([2.5, 2.7, 3.9])
    track = propagate_attitude([1, 0, 0, 0], [0.03, -0.02, 0.01], J, DAY_S)
    states = [track(float(t)) for t in np.linspace(0.0, DAY_S, 400)]
    momenta = np.array([matrix_from_quat(q) @ J @ w for q, w in states])
    energies = [float(w @ J @ w) / 2 for _, w in states]
    drift = float(np.max(np.linalg.norm(momenta - momenta[0], axis=1)) / np.linalg.norm(momenta[0]))
    rows = [
        Row(
            what=f"{quantity} of a free tumble over a day, relative",
            against="conservation",
            unit="1",
            goal=1e-12,
            measured=measured,
        )
        for quantity, measured in (("momentum", drift), ("energy", float(np.ptp(energies)) / energies[0]))
    ]
    rate, attitude = axisymmetric_errors()
    against = "Euler's closed solution"
    return [
        *rows,
        Row(
            what="rate of an axisymmetric body over an hour",
            against=against,
            unit="rad/s",
            goal=1e-10,
            measured=rate,
        ),
        Row(
            what="attitude of an axisymmetric body over an hour",
            against=against,
            unit="rad",
            goal=1e-9,
            measured=attitude,
        ),
    ]


def axisymmetric_errors(span_s: float = 3600.0) -> tuple[float, float]:
    """Return the maximum error of rate [rad s-1] and attitude [rad] of a body with two equal moments of inertia.

    In the body frame, the rate precesses about the symmetry axis; in the inertial frame, the body rotates about the
    angular momentum at ``L / J1`` and about its axis at the difference of the two rates.

    References
    ----------
    Wertz (1978), Spacecraft Attitude Determination and Control, chapter 16 (axial symmetry).
    """
    transverse, along = 3.0, 4.5
    w0 = np.array([0.03, 0.01, 0.05])
    track = propagate_attitude([1, 0, 0, 0], w0, np.diag([transverse, transverse, along]), span_s)
    momentum = np.array([transverse, transverse, along]) * w0
    spin = (along - transverse) / transverse * w0[2]
    worst_rate = worst_attitude = 0.0
    for t in np.linspace(0.0, span_s, 50):
        q, w = track(float(t))
        c, s = np.cos(spin * t), np.sin(spin * t)
        exact = np.array([w0[0] * c - w0[1] * s, w0[0] * s + w0[1] * c, w0[2]])
        worst_rate = max(worst_rate, float(np.linalg.norm(w - exact)))
        precessed = _turn(momentum / transverse, float(t)) @ _turn(np.array([0.0, 0.0, -spin]), float(t))
        difference = precessed.T @ matrix_from_quat(q)
        sine = (
            np.array(
                [
                    difference[2, 1] - difference[1, 2],
                    difference[0, 2] - difference[2, 0],
                    difference[1, 0] - difference[0, 1],
                ]
            )
            / 2
        )
        worst_attitude = max(worst_attitude, float(np.linalg.norm(sine)))
    return worst_rate, worst_attitude


def _turn(rate_rad_s: FloatArray, t_s: float) -> FloatArray:
    """Return the (3, 3) rotation by a constant rate over a time (Rodrigues' formula)."""
    angle = float(np.linalg.norm(rate_rad_s)) * t_s
    if angle == 0.0:
        return np.eye(3)
    x, y, z = rate_rad_s * t_s / angle
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def linear_models() -> list[Row]:
    """Measure how the linear models' error grows with distance; its exponent should be 2."""
    rows = []
    round_earth = Gravity(j2=0.0)
    for name, e in (("Clohessy-Wiltshire, circle", 0.0), ("Yamanaka-Ankersen, e = 0.4", 0.4)):
        orbit = Elements(semi_major_axis_m=7000e3 / (1 - e), eccentricity=e, inclination_rad=1.1)
        span = 4000.0
        n = mean_motion_rad_s(orbit.semi_major_axis_m, MU_EARTH_M3_S2)
        Phi = transition_matrix(n, span) if e == 0 else elliptic_transition_matrix(orbit, span)
        errors = [_linear_error(orbit, round_earth, Phi, scale, span) for scale in (1.0, 2.0)]
        rows.append(
            Row(
                what=f"{name}: power of the error, less 2",
                against="difference of two propagations",
                unit="1",
                goal=0.05,
                measured=abs(float(np.log2(errors[1] / errors[0])) - 2.0),
            )
        )
    return rows


def _linear_error(orbit: Elements, gravity: Gravity, Phi: FloatArray, scale: float, span_s: float) -> float:
    r, v = state_from_elements(orbit)
    start = scale * np.array([60.0, -80.0, 40.0, 0.01, -0.05, 0.02])
    frame = lvlh_frame(r, v, gravity.acceleration(r))
    track: OrbitTrack = propagate(r, v, span_s, gravity, frame.to_eci(start[:3], start[3:]))
    end_frame = lvlh_frame(*track(span_s), track.acceleration(span_s))
    p, _ = end_frame.from_eci(*track.relative(span_s))
    return float(np.linalg.norm((Phi @ start)[:3] - p))
