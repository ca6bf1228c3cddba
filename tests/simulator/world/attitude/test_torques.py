"""Torques on the target: libration under the gravity gradient, spin-up by a constant torque, conservation."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flyaround.simulator.world.attitude.rigid_body import propagate_attitude
from flyaround.simulator.world.attitude.torques import body_torque, gravity_gradient_torque
from flyaround.simulator.world.bodies.earth import EARTH
from flyaround.simulator.world.bodies.moon import MOON
from flyaround.simulator.world.constants import MU_EARTH_M3_S2
from flyaround.simulator.world.frames.rotation import matrix_from_quat, quat_from_rotvec
from flyaround.simulator.world.orbit.gravity import Gravity
from flyaround.simulator.world.orbit.propagation import propagate
from flyaround.simulator.world.time.instant import Instant

EPOCH = Instant.from_utc("2026-03-21T10:00:00Z")
A_M = 7078e3
N = np.sqrt(MU_EARTH_M3_S2 / A_M**3)
ORBIT = propagate(np.array([A_M, 0, 0]), np.array([0, N * A_M, 0]), 20000.0, Gravity(j2=0.0))
# long axis x, orbit normal z
J = np.diag([1.0, 4.0, 4.5])


def test_pitch_libration_has_its_frequency():
    """Wertz (1978), eq. 18-44: n sqrt(3 (J1 - J3) / J2) for small pitch about the orbit normal."""
    small = 1e-3
    torque = body_torque(ORBIT, J, EPOCH, gravity_gradient=True)
    track = propagate_attitude(quat_from_rotvec([0, 0, small]), [0, 0, N], J, 20000.0, torque)
    w = N * np.sqrt(3 * (J[1, 1] - J[0, 0]) / J[2, 2])
    for t in np.linspace(0, 20000, 15):
        r, _ = ORBIT(float(t))
        up = matrix_from_quat(track(float(t))[0]).T @ r / A_M
        assert -up[1] == pytest.approx(small * np.cos(w * t), abs=2e-6)


def test_no_torque_along_a_principal_axis():
    r = np.array([A_M, 0.0, 0.0])
    assert not gravity_gradient_torque(r, np.eye(3), J).any()
    turned = matrix_from_quat(quat_from_rotvec([0, 0, np.pi / 4]))
    # eq. 17-33 at 45 degrees: 3/2 n^2 (J2 - J1), and it restores
    assert gravity_gradient_torque(r, turned.T, J)[2] == pytest.approx(-1.5 * N**2 * 3.0)


def test_constant_torque_spins_up():
    torque = body_torque(ORBIT, J, EPOCH, constant_nm=(0.0, 0.0, 0.009))
    _, rate = propagate_attitude([1, 0, 0, 0], [0, 0, 0], J, 100.0, torque)(100.0)
    assert np.allclose(rate, [0, 0, 0.2], atol=1e-9)
    assert body_torque(ORBIT, J, EPOCH) is None


def test_torque_acts_along_the_axes_of_a_body_that_points_anywhere():
    """Euler's equations in body axes (Wertz 1978, eq. 16-49), by other means than the momentum along ECI.

    The body starts far from ECI's axes and turns about none of its own: a torque taken as one along ECI is off by
    radians here, the two integrations by 1e-9.
    """
    q0 = quat_from_rotvec([1.1, -0.7, 1.6])
    rate, push = np.array([0.002, -0.003, 0.001]), np.array([2e-5, 3e-5, -1e-5])

    def euler(_t, y):
        (w, x, y_, z), omega = y[:4], y[4:]
        turn = np.array([[-x, -y_, -z], [w, -z, y_], [z, w, -x], [-y_, x, w]])
        spin = np.linalg.solve(J, push - np.cross(omega, J @ omega))
        return np.concatenate([0.5 * turn @ omega, spin])

    span = 1500.0
    end = solve_ivp(euler, (0, span), np.concatenate([q0, rate]), method="DOP853", rtol=1e-12, atol=1e-14).y[
        :, -1
    ]
    torque = body_torque(ORBIT, J, EPOCH, constant_nm=tuple(push))
    q, w = propagate_attitude(q0, rate, J, span, torque)(span)
    assert abs(q @ end[:4]) == pytest.approx(1.0, abs=1e-12)
    assert w == pytest.approx(end[4:], abs=1e-9)
    assert np.linalg.norm(w - rate) > 0.01  # the torque did act


@pytest.mark.parametrize("body", [EARTH, MOON], ids=lambda body: body.name)
def test_gravitys_gradient_is_that_of_the_body_that_is_circled(body):
    """A dumbbell's torque from the pull on each of its two ends."""
    r = np.array([2.1, -1.3, 0.7]) * body.radius_m
    end, mass = np.array([0.3, 0.8, -0.4]), 5.0
    pulls = [-body.mu_m3_s2 * (r + x) / np.linalg.norm(r + x) ** 3 for x in (end, -end)]
    dumbbell = mass * np.cross(end, pulls[0] - pulls[1])
    inertia = 2 * mass * (end @ end * np.eye(3) - np.outer(end, end))
    orbit = propagate(r, np.zeros(3), 1.0, Gravity(j2=0.0, mu_m3_s2=body.mu_m3_s2))
    torque = body_torque(orbit, inertia, EPOCH, gravity_gradient=True)
    assert torque is not None
    assert torque(0.0, np.eye(3)) == pytest.approx(dumbbell, rel=1e-5)
