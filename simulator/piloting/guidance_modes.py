"""Guidance modes that start from the present state, with a path that joins the mode's reference."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.world.guidance.thruster_control import path_impulse
from flyaround.simulator.world.orbit.propagation import elements_from_state
from flyaround.simulator.world.relative.clohessy_wiltshire import transition_matrix
from flyaround.simulator.world.relative.yamanaka_ankersen import true_anomaly_after

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.guidance.chaser import Chaser
    from flyaround.simulator.world.orbit.propagation import OrbitTrack

    LvlhState = tuple[FloatArray, FloatArray]

CONTROL_PERIOD_S = 1.0
"""Period of control with constant thrust [s]."""

LARGEST_M_S2 = 0.05
"""Largest thrust per mass along each LVLH axis [m s-2]."""

JOIN_SPEED_M_S = 0.2
"""Mean speed on the joining path [m s-1]."""

# Shortest duration of a joining path [s].
MIN_JOIN_S = 10.0
STARTS_HERE_M = 0.1  # distance to the start of a path below which its joining path only changes the speed


@dataclass(frozen=True, eq=False, kw_only=True)
class ActiveGuidance:
    """An active guidance mode.

    Parameters
    ----------
    title : str
        Name for people.
    mode : Chaser
        Mode of `flyaround.simulator.world`.
    n_rad_s : float
        Mean motion.
    start_s : float
        Start time.
    join : tuple of LvlhState
        States at the start and end of the joining path.
    join_s : float
        Duration of the transfer to the path.
    """

    title: str
    mode: Chaser
    n_rad_s: float
    start_s: float
    join: tuple[LvlhState, LvlhState]
    join_s: float

    @property
    def coasts_from_s(self) -> float:
        """Time at which control ends and gravity alone acts; infinity for a path."""
        return self.start_s + self.join_s if self.mode.ballistic else float("inf")

    def aim(self, t_s: float) -> LvlhState:
        """Return the reference position and velocity at a time."""
        elapsed = t_s - self.start_s
        if elapsed >= self.join_s:
            if not self.mode.ballistic:
                return self.mode.state_lvlh(elapsed - self.join_s, self.n_rad_s)
            # a control period that extends beyond the joining path aims at the free flight
            p, v = self.join[1]
            later = transition_matrix(self.n_rad_s, elapsed - self.join_s) @ np.concatenate([p, v])
            return later[:3], later[3:]
        return cubic_between(*self.join, self.join_s, elapsed)

    def phase(self, t_s: float) -> str:
        """Return the phase at a time."""
        elapsed = t_s - self.start_s
        if elapsed >= self.join_s:
            return self.mode.phase(elapsed - self.join_s)
        away_m = float(np.linalg.norm(self.join[1][0] - self.join[0][0]))
        return "matching speed" if away_m < STARTS_HERE_M else f"flying to its start, {away_m:.1f} m away"

    def acceleration_lvlh(self, t_s: float, state: LvlhState) -> FloatArray:
        """Return the (3,) thrust per mass for the next period of control [m s-2].

        Parameters
        ----------
        t_s : float
            Time of the flight [s].
        state : LvlhState
            Present position [m] and velocity [m s-1] of the chaser, LVLH.
        """
        if t_s >= self.coasts_from_s:
            return np.zeros(3)
        decide = getattr(self.mode, "impulse_lvlh", None)
        if decide is not None and t_s - self.start_s >= self.join_s:
            impulse = decide(*state, self.n_rad_s)
        else:
            Phi = transition_matrix(self.n_rad_s, CONTROL_PERIOD_S)
            impulse = path_impulse(state, self.aim(t_s + CONTROL_PERIOD_S), Phi, CONTROL_PERIOD_S)
        return np.asarray(np.clip(impulse / CONTROL_PERIOD_S, -LARGEST_M_S2, LARGEST_M_S2))


def begin_mode(
    title: str, mode: Chaser, state: LvlhState, n_rad_s: float, t_s: float, orbit: OrbitTrack | None = None
) -> ActiveGuidance:
    """Start a mode now; the chaser first flies to its start on a cubic that matches position and velocity at both ends.

    Parameters
    ----------
    title : str
        Name of the mode.
    mode : Chaser
        Guidance law of the mode.
    state : LvlhState
        State of the chaser now.
    n_rad_s : float
        Mean motion of the target.
    t_s : float
        Time of the flight [s].
    orbit : OrbitTrack, optional
        Orbit of the target, for free flight in eccentric orbits; by default circular.
    """
    end = mode.state_lvlh(0.0, n_rad_s)
    join_s = _join_s(state, end)
    if orbit is not None and mode.ballistic:
        mu = orbit.forces.mu_m3_s2
        now = elements_from_state(*orbit(t_s), mu)
        end = mode.start_lvlh(replace(now, true_anomaly_rad=true_anomaly_after(now, join_s, mu)), mu)
    return ActiveGuidance(
        title=title, mode=mode, n_rad_s=n_rad_s, start_s=t_s, join=(state, end), join_s=join_s
    )


def _join_s(start: LvlhState, end: LvlhState) -> float:
    """Return a duration suited to the speed and to half of the available thrust."""
    distance = float(np.linalg.norm(end[0] - start[0]))
    speeds = float(np.linalg.norm(start[1]) + np.linalg.norm(end[1]))
    max_m_s2 = LARGEST_M_S2 / 2
    return max(
        MIN_JOIN_S, distance / JOIN_SPEED_M_S, float(np.sqrt(6 * distance / max_m_s2)), 4 * speeds / max_m_s2
    )


def cubic_between(start: LvlhState, end: LvlhState, duration_s: float, t_s: float) -> LvlhState:
    """Return position and velocity on the Hermite cubic between two states.

    Parameters
    ----------
    start : LvlhState
        First state.
    end : LvlhState
        Last state.
    duration_s : float
        Time between them.
    t_s : float
        Time since the first.
    """
    (p0, v0), (p1, v1) = start, end
    x, T = t_s / duration_s, duration_s
    p = (
        (1 + 2 * x) * (1 - x) ** 2 * p0
        + x * (1 - x) ** 2 * T * v0
        + x * x * (3 - 2 * x) * p1
        - x * x * (1 - x) * T * v1
    )
    v = 6 * x * (1 - x) / T * (p1 - p0) + (1 - x) * (1 - 3 * x) * v0 + x * (3 * x - 2) * v1
    return p, v
