"""Trajectory control by thrusters: a controller commands impulses that steer the chaser to its reference path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.world.relative.clohessy_wiltshire import transition_matrix
from flyaround.simulator.world.relative.thrusted_step import ThrustHold, relative_step
from flyaround.simulator.world.time.steps import step_count

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.guidance.chaser import Chaser
    from flyaround.simulator.world.guidance.keep_out import KeepOut
    from flyaround.simulator.world.guidance.thrusters import Thrusters
    from flyaround.simulator.world.orbit.propagation import OrbitTrack

_CONVERGENCE_PERIODS = 10.0
"""Number of control periods over which a position error is removed."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ControlledTrack:
    """Trajectory of a controlled chaser: state at the start of each control period, and thrust during it.

    Parameters
    ----------
    orbit : OrbitTrack
        Trajectory of the target.
    period_s : float
        Control period.
    position_eci_m : (n, 3) array
        Chaser minus target, GCRS axes [m].
    velocity_eci_m_s : (n, 3) array
        Derivative of the same [m s-1].
    thrust_eci_m_s2 : (n, 3) array
        Acceleration held over each period.
    mass_kg : (n,) array
        Mass of the chaser.
    abort_s : float or None
        Time of an abort at the keep-out sphere, or None.
    end_mass_kg : float
        Mass after the last period.
    keep_out : KeepOut, optional
        The keep-out sphere, or None.
    """

    orbit: OrbitTrack
    period_s: float
    position_eci_m: FloatArray
    velocity_eci_m_s: FloatArray
    thrust_eci_m_s2: FloatArray
    mass_kg: FloatArray
    abort_s: float | None
    end_mass_kg: float
    keep_out: KeepOut | None = None

    def __call__(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Return position [m] and velocity [m s-1] relative to the target at ``t_s``, GCRS axes."""
        k = min(max(int(t_s // self.period_s), 0), len(self.mass_kg) - 1)
        start = k * self.period_s
        state = self.position_eci_m[k], self.velocity_eci_m_s[k]
        return relative_step(self.orbit, start, t_s - start, state, ThrustHold(self.thrust_eci_m_s2[k]))

    @property
    def delta_v_m_s(self) -> float:
        """Sum of the thrusters' velocity changes [m s-1]."""
        return float(np.sum(np.linalg.norm(self.thrust_eci_m_s2, axis=1))) * self.period_s


def fly_controlled(
    orbit: OrbitTrack,
    guidance: Chaser,
    n_rad_s: float,
    thrusters: Thrusters,
    keep_out: KeepOut | None = None,
) -> ControlledTrack:
    """Simulate the chaser under its guidance to the end of the target's track.

    At the start of each period the Clohessy-Wiltshire equations predict the state at its end without thrust. The
    commanded impulse removes the predicted velocity error, and a tenth of the position error (see `path_impulse`).
    Guidance with a method ``impulse_lvlh`` computes the impulse itself.

    Parameters
    ----------
    orbit : OrbitTrack
        Trajectory of the target.
    guidance : Chaser
        Reference path, or guidance that computes impulses itself.
    n_rad_s : float
        Mean motion.
    thrusters : Thrusters
        Thrusters of the chaser.
    keep_out : KeepOut, optional
        Sphere that the chaser must not enter. If it does, it aborts and retreats.

    Returns
    -------
    ControlledTrack
        Position [m], velocity [m s-1] and thrust of each period.
    """
    h = thrusters.period_s
    Phi = transition_matrix(n_rad_s, h)
    compute_impulse = getattr(guidance, "impulse_lvlh", None)
    frame = orbit.frame(0.0)
    state = frame.to_eci(*guidance.state_lvlh(0.0, n_rad_s))
    mass, abort_s = thrusters.mass_kg, None
    rows: list[FloatArray] = []
    for k in range(step_count(orbit.duration_s, h)):
        t = k * h
        frame = orbit.frame(t)
        p, v = frame.from_eci(*state)
        if abort_s is None and keep_out is not None and keep_out.violated(p):
            abort_s = t
        if abort_s is not None and keep_out is not None:
            impulse = retreat_impulse(p, v, keep_out)
        elif compute_impulse is not None:
            impulse = compute_impulse(p, v, n_rad_s)
        else:
            impulse = path_impulse((p, v), guidance.state_lvlh(t + h, n_rad_s), Phi, h)
        delivered, next_mass = thrusters.fire(impulse, mass)
        thrust = frame.R_eci_from_lvlh @ delivered / h
        rows.append(np.array([*state[0].tolist(), *state[1].tolist(), *thrust.tolist(), mass]))
        state = relative_step(orbit, t, min(h, orbit.duration_s - t), state, ThrustHold(thrust))
        mass = next_mass
    table = np.array(rows)
    return ControlledTrack(
        orbit=orbit,
        period_s=h,
        position_eci_m=table[:, :3],
        velocity_eci_m_s=table[:, 3:6],
        thrust_eci_m_s2=table[:, 6:9],
        mass_kg=table[:, 9],
        abort_s=abort_s,
        end_mass_kg=mass,
        keep_out=keep_out,
    )


def path_impulse(
    state_lvlh: tuple[FloatArray, FloatArray],
    aim_lvlh: tuple[FloatArray, FloatArray],
    transition: FloatArray,
    period_s: float,
) -> FloatArray:
    """Return the velocity change (3,) that steers the chaser towards its reference path, LVLH [m s-1].

    It removes the predicted velocity error at once, and the position error over `_CONVERGENCE_PERIODS` periods.

    Parameters
    ----------
    state_lvlh : tuple of array
        Present position [m] and velocity [m s-1].
    aim_lvlh : tuple of array
        Reference state one period later.
    transition : (6, 6) array
        Clohessy-Wiltshire transition matrix of one period.
    period_s : float
        Control period.

    Returns
    -------
    (3,) array
        Velocity change, LVLH [m s-1].
    """
    predicted = transition @ np.concatenate(state_lvlh)
    aim_p, aim_v = aim_lvlh
    return np.asarray(aim_v - predicted[3:] + (aim_p - predicted[:3]) / (_CONVERGENCE_PERIODS * period_s))


def retreat_impulse(p: FloatArray, v: FloatArray, keep_out: KeepOut) -> FloatArray:
    """Compute the velocity change of a radial retreat from the chaser's LVLH state.

    Returns
    -------
    (3,) array
        Difference from the present velocity to the outward one of ``keep_out.retreat_m_s``, LVLH [m s-1]; zero
        beyond twice the sphere's radius.
    """
    distance = float(np.linalg.norm(p))
    if distance > 2 * keep_out.radius_m:
        return np.zeros(3)
    return keep_out.retreat_m_s * p / max(distance, 1e-9) - v
