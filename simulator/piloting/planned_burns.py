"""Planned burns: times, LVLH components, the predicted path, and their execution."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.readouts import duration_text, mission_time, speed_text
from flyaround.simulator.runtime.arrays import Vec3, vec3
from flyaround.simulator.world.orbit.propagation import elements_from_state
from flyaround.simulator.world.relative.yamanaka_ankersen import (
    elliptic_transition_matrix,
    true_anomaly_after,
)

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.guidance.manual_control import ChaserState
    from flyaround.simulator.world.orbit.propagation import OrbitTrack

BURN_M_S2 = 0.05
"""Acceleration of a burn, which is centred on its time [m s-2]."""

# Limits of planned burns: number, size [m s-1], and time ahead [s]. They bound the
# time of a prediction, which spans all of them.
MAX_BURNS = 8
MAX_DELTA_V_M_S = 50.0
MAX_BURN_LEAD_S = 200_000.0


@dataclass(frozen=True, kw_only=True)
class PlannedBurn:
    """A velocity change at a time.

    Parameters
    ----------
    t_s : float
        Time of its centre, since the scenario's start.
    delta_v_lvlh_m_s : array
        Radial, along-track, cross-track.
    """

    t_s: float
    delta_v_lvlh_m_s: Vec3

    @property
    def size_m_s(self) -> float:
        """Its delta-v."""
        return float(np.linalg.norm(self.delta_v_lvlh_m_s))

    @property
    def duration_s(self) -> float:
        """Duration of the thrust [s]."""
        return self.size_m_s / BURN_M_S2

    @property
    def start_s(self) -> float:
        """Start of the thrust [s]."""
        return self.t_s - self.duration_s / 2

    @property
    def end_s(self) -> float:
        """End of the thrust [s]."""
        return self.t_s + self.duration_s / 2


@dataclass(frozen=True)
class BurnPlan:
    """Future burns, in order of time."""

    burns: tuple[PlannedBurn, ...] = ()

    def with_burn(self, burn: PlannedBurn, now_s: float) -> BurnPlan:
        """Add a burn to the plan; it replaces one at the same time.

        Returns
        -------
        BurnPlan
            New plan, in order of time.

        Raises
        ------
        UserError
            If a number of the burn is not finite; if it is zero or too large, would start in the past, is too far
            ahead, or overlaps another; or if there are too many.
        """
        if not np.isfinite([burn.t_s, *burn.delta_v_lvlh_m_s]).all():
            raise UserError("a burn's time and its three parts of delta-v must be finite numbers")
        if burn.size_m_s == 0.0 or burn.size_m_s > MAX_DELTA_V_M_S:
            raise UserError(
                f"a burn of {speed_text(burn.size_m_s)} cannot be planned; allowed: more than 0, at most "
                f"{speed_text(MAX_DELTA_V_M_S)}"
            )
        if burn.start_s < now_s:
            raise UserError(
                f"the burn would begin at {mission_time(burn.start_s)}, and it is {mission_time(now_s)}; plan it later"
            )
        if burn.t_s > now_s + MAX_BURN_LEAD_S:
            raise UserError(f"the burn is more than {duration_text(MAX_BURN_LEAD_S)} ahead; plan it sooner")
        other_burns = tuple(b for b in self.burns if b.t_s != burn.t_s)
        if len(other_burns) >= MAX_BURNS:
            raise UserError(f"{MAX_BURNS} burns are planned already; cancel one first")
        burns = tuple(sorted((*other_burns, burn), key=lambda b: b.t_s))
        for a, b in pairwise(burns):
            if a.end_s > b.start_s:
                raise UserError(
                    f"the burns at {mission_time(a.t_s)} and {mission_time(b.t_s)} overlap; move one"
                )
        return BurnPlan(burns)

    def without(self, t_s: float | None = None) -> BurnPlan:
        """Remove the burn nearest to a time, or all burns.

        Returns
        -------
        BurnPlan
            New plan; empty if ``t_s`` is None.
        """
        if t_s is None or not self.burns:
            return BurnPlan()
        nearest = min(self.burns, key=lambda b: abs(b.t_s - t_s))
        return BurnPlan(tuple(b for b in self.burns if b is not nearest))

    def with_change(self, before: BurnPlan, after: BurnPlan, now_s: float) -> BurnPlan:
        """Apply the difference between two plans to this one, which may have changed since.

        Parameters
        ----------
        before : BurnPlan
            Plan before the change.
        after : BurnPlan
            Plan after it.
        now_s : float
            Present time.

        Returns
        -------
        BurnPlan
            New plan, in order of time.

        Raises
        ------
        UserError
            If a burn that the change removes is no longer planned, or `with_burn` refuses one that it adds.
        """
        removed, added = set(before.burns) - set(after.burns), set(after.burns) - set(before.burns)
        if missing := removed - set(self.burns):
            raise UserError(
                f"the {burn_text(min(missing, key=lambda b: b.t_s))} was flown or cancelled since"
            )
        plan = BurnPlan(tuple(b for b in self.burns if b not in removed))
        for burn in sorted(added, key=lambda b: b.t_s):
            plan = plan.with_burn(burn, now_s)
        return plan

    def acceleration_lvlh_m_s2(self, start_s: float, end_s: float) -> FloatArray:
        """Return the acceleration during a step that contains no start or end of a burn.

        Returns
        -------
        (3,) array
            Acceleration, LVLH [m s-2]; zero if no burn acts.
        """
        middle = (start_s + end_s) / 2
        for burn in self.burns:
            if burn.start_s <= middle < burn.end_s:
                return np.array(burn.delta_v_lvlh_m_s) / burn.duration_s
        return np.zeros(3)

    def next_edge_s(self, t_s: float) -> float:
        """Return the next start or end of a burn after a time.

        Returns
        -------
        float
            Time since the scenario's start [s], later than ``t_s``; infinity if there is none.
        """
        edges = [t for b in self.burns for t in (b.start_s, b.end_s) if t > t_s]
        return min(edges, default=float("inf"))

    def after(self, t_s: float) -> BurnPlan:
        """Remove the burns that end by ``t_s``.

        Returns
        -------
        BurnPlan
            New plan, or this one if none has ended.
        """
        if all(b.end_s > t_s for b in self.burns):
            return self
        return BurnPlan(tuple(b for b in self.burns if b.end_s > t_s))


def burn_text(burn: PlannedBurn) -> str:
    """Return a burn in words: its size and time.

    Returns
    -------
    str
        Noun phrase without article.
    """
    return f"burn of {speed_text(burn.size_m_s)} at {mission_time(burn.t_s)}"


def change_text(before: BurnPlan, after: BurnPlan) -> str:
    """Return the difference between two plans in words.

    Returns
    -------
    str
        Imperative clause; empty if the plans are equal.
    """
    removed = [b for b in before.burns if b not in after.burns]
    added = [b for b in after.burns if b not in before.burns]
    if added and removed:
        return f"change the {burn_text(removed[0])} to {burn_text(added[0]).removeprefix('burn of ')}"
    if added:
        return f"plan a {burn_text(added[0])}"
    if len(removed) > 1:
        return f"cancel {len(removed)} burns"
    return f"cancel the {burn_text(removed[0])}" if removed else ""


@dataclass(frozen=True, eq=False)
class PredictedPath:
    """Free flight with the planned burns as impulses.

    Parameters
    ----------
    times_s : (n,) array
        Times.
    points_lvlh_m : (n, 3) array
        Positions.
    nodes_lvlh_m : (burns, 3) array
        Position of each burn.
    """

    times_s: FloatArray
    points_lvlh_m: FloatArray
    nodes_lvlh_m: FloatArray


def predicted_path(
    orbit: OrbitTrack, chaser: ChaserState, plan: BurnPlan, after_s: float, samples: int = 60
) -> PredictedPath:
    """Predict the chaser's path through its planned burns, to first order in the distance (Yamanaka-Ankersen).

    Parameters
    ----------
    orbit : OrbitTrack
        Orbit of the target.
    chaser : ChaserState
        Present state.
    plan : BurnPlan
        Planned burns.
    after_s : float
        Time after the last burn.
    samples : int, optional
        Points per leg between burns.

    Returns
    -------
    PredictedPath
        Path from now to ``after_s`` after the last burn that is still ahead, or after now if none is. A leg includes
        both ends, so that the time and position of each node occur twice.
    """
    mu = orbit.forces.mu_m3_s2
    elements = elements_from_state(*orbit(chaser.t_s), mu)
    frame = orbit.frame(chaser.t_s)
    p, v = frame.from_eci(np.array(chaser.position_eci_m), np.array(chaser.velocity_eci_m_s))
    state, now = np.concatenate([p, v]), chaser.t_s
    times, points, nodes = [], [], []
    burns = [b for b in plan.burns if b.t_s >= now]
    ends = [*(b.t_s for b in burns), (burns[-1].t_s if burns else now) + after_s]
    for k, end in enumerate(ends):
        spans = np.linspace(0.0, end - now, samples)
        leg = [elliptic_transition_matrix(elements, float(t), mu) @ state for t in spans]
        times.append(now + spans)
        points.append(np.array(leg)[:, :3])
        state = leg[-1].copy()
        elements = replace(elements, true_anomaly_rad=true_anomaly_after(elements, end - now, mu))
        now = end
        if k < len(burns):
            nodes.append(state[:3].copy())
            state[3:] += burns[k].delta_v_lvlh_m_s
    return PredictedPath(np.concatenate(times), np.concatenate(points), np.array(nodes, float).reshape(-1, 3))


def burn_of(t_s: float, radial_m_s: float, along_m_s: float, cross_m_s: float) -> PlannedBurn:
    """Build a burn from the command's four numbers, without checking them.

    Returns
    -------
    PlannedBurn
        Burn centred on ``t_s`` [s], with the three components of its delta-v in LVLH [m s-1].
    """
    return PlannedBurn(
        t_s=float(t_s), delta_v_lvlh_m_s=vec3(np.array([radial_m_s, along_m_s, cross_m_s], float))
    )
