"""One integration step of the chaser's motion relative to the target under thrust."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.world.orbit.burns import burn_edges_s, eci_from_own_lvlh
from flyaround.simulator.world.orbit.forces import attraction_difference

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.orbit.propagation import OrbitTrack

    Thrust = Callable[[float], list[float]]


@dataclass(frozen=True, eq=False)
class ThrustHold:
    """A constant thrust: (3,) acceleration along GCRS axes [m s-2]."""

    push: FloatArray

    def __call__(self, since_s: float) -> list[float]:  # noqa: ARG002
        """Return the constant thrust."""
        return [float(x) for x in self.push]


def relative_step(
    orbit: OrbitTrack, t_s: float, h: float, state: tuple[FloatArray, FloatArray], thrust: Thrust
) -> tuple[FloatArray, FloatArray]:
    """Return chaser minus target ``h`` seconds later.

    The difference of the central attraction is integrated by one classical Runge-Kutta step; what else acts
    (harmonics, third bodies, air, light) changes over an orbit and is taken once, at the middle: its error per
    step is some ``(n h)^2 / 24`` of it, below 1e-12 m s-2 for 10 m and steps of 5 s. Impulses of the target
    cut the step.

    Parameters
    ----------
    orbit : OrbitTrack
        The target's track.
    t_s : float
        Start of the step [s].
    h : float
        Length of the step [s].
    state : (3,) tuple of array
        Position [m] and (3,) velocity [m s-1], GCRS axes.
    thrust : Thrust
        The chaser's acceleration along GCRS axes [m s-2], of the time since ``t_s``.
    """
    if not orbit.burns:
        return _runge_kutta_step(orbit, t_s, h, state, thrust, 0.0)
    edges = [t_s, *burn_edges_s(orbit.burns, t_s, t_s + h), t_s + h]
    for a, b in pairwise(edges):
        if b > a:
            state = _runge_kutta_step(orbit, a, b - a, state, thrust, a - t_s)
        state = _after_target_impulses(orbit, b, state)
    return state


def _after_target_impulses(
    orbit: OrbitTrack, t_s: float, state: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Return the state right after the target's impulses of a moment."""
    p, v = state
    for burn in orbit.burns:
        if burn.duration_s == 0 and burn.start_s == t_s:
            v = v - eci_from_own_lvlh(burn.delta_v_lvlh_m_s, *orbit(t_s))
    return p, v


def _runge_kutta_step(
    orbit: OrbitTrack,
    t_s: float,
    h: float,
    state: tuple[FloatArray, FloatArray],
    thrust: Thrust,
    since_s: float,
) -> tuple[FloatArray, FloatArray]:
    if h == 0.0:
        return state
    mu = orbit.forces.mu_m3_s2
    p0, v0 = state
    r_end = orbit(t_s + h)[0].tolist()
    r_mid, v_mid = orbit(t_s + h / 2)
    p_mid = p0 + h / 2 * v0
    steady = orbit.forces.pair(t_s + h / 2, r_mid, v_mid, p_mid, v0)[1]
    steady = steady - np.array(attraction_difference(r_mid.tolist(), p_mid.tolist(), mu))
    for burn in orbit.burns:
        if burn.thrusts_throughout(t_s, t_s + h):
            steady = steady - eci_from_own_lvlh(burn.acceleration_lvlh_m_s2, r_mid, v_mid)
    middle = r_mid.tolist()
    first, half, last = (thrust(since_s + d) for d in (0.0, h / 2, h))
    sx, sy, sz = steady.tolist()

    def pull(r: list[float], p: list[float], push: list[float]) -> list[float]:
        x, y, z = attraction_difference(r, p, mu)
        return [x + push[0] + sx, y + push[1] + sy, z + push[2] + sz]

    p, v = p0.tolist(), v0.tolist()
    a1 = pull(orbit(t_s)[0].tolist(), p, first)
    v2 = _add_scaled(v, h / 2, a1)
    a2 = pull(middle, _add_scaled(p, h / 2, v), half)
    v3 = _add_scaled(v, h / 2, a2)
    a3 = pull(middle, _add_scaled(p, h / 2, v2), half)
    v4 = _add_scaled(v, h, a3)
    a4 = pull(r_end, _add_scaled(p, h, v3), last)
    return (
        np.array(
            [q + h / 6 * (a + 2 * b + 2 * c + d) for q, a, b, c, d in zip(p, v, v2, v3, v4, strict=True)]
        ),
        np.array(
            [w + h / 6 * (a + 2 * b + 2 * c + d) for w, a, b, c, d in zip(v, a1, a2, a3, a4, strict=True)]
        ),
    )


def _add_scaled(a: list[float], h: float, b: list[float]) -> list[float]:
    return [a[0] + h * b[0], a[1] + h * b[1], a[2] + h * b[2]]
