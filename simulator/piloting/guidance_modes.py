"""The world's guidance modes from where the chaser is: a path that joins the mode's, then the mode's own."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.world.guidance.free_flight import NaturalCircumnavigation, RangeKeeping, SafeEllipse
from flyaround.simulator.world.guidance.paths import (
    ForcedFlyaround,
    Glideslope,
    Hold,
    RbarApproach,
    VbarApproach,
    Waypoints,
)
from flyaround.simulator.world.guidance.thruster_control import path_impulse
from flyaround.simulator.world.orbit.propagation import elements_from_state
from flyaround.simulator.world.relative.clohessy_wiltshire import transition_matrix
from flyaround.simulator.world.relative.yamanaka_ankersen import true_anomaly_after

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.guidance.chaser import Chaser
    from flyaround.simulator.world.orbit.propagation import OrbitTrack

    LvlhState = tuple[FloatArray, FloatArray]

CONTROL_S = 1.0
"""Period of control; thrust is constant over it."""
LARGEST_M_S2 = 0.05
"""Thrust per mass along each LVLH axis."""
JOIN_M_S = 0.2
"""Mean speed of the way to where a mode begins."""
LEAST_JOIN_S = 10.0
CLEAR_RADII = 1.5
"""No mode may lead nearer to the centre of mass than so many radii of the target."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Guided:
    """A mode that was begun.

    Parameters
    ----------
    title : for people. mode : of the world. n_rad_s : mean motion. start_s : when it was begun.
    join : states of the chaser then and of the mode's start. join_s : how long the way between them takes.
    """

    title: str
    mode: Chaser
    n_rad_s: float
    start_s: float
    join: tuple[LvlhState, LvlhState]
    join_s: float

    @property
    def coasts_from_s(self) -> float:
        """When its control ends and gravity alone is left; never for a path."""
        return self.start_s + self.join_s if self.mode.ballistic else float("inf")

    def aim(self, t_s: float) -> LvlhState:
        """Where the chaser should be at a time, and how fast."""
        since = t_s - self.start_s
        if since >= self.join_s:
            if not self.mode.ballistic:
                return self.mode.state_lvlh(since - self.join_s, self.n_rad_s)
            # a step of control that reaches beyond the end of the way aims along the free flight
            p, v = self.join[1]
            later = transition_matrix(self.n_rad_s, since - self.join_s) @ np.concatenate([p, v])
            return later[:3], later[3:]
        return cubic_between(*self.join, self.join_s, since)

    def phase(self, t_s: float) -> str:
        """What it does at a time, in a word or two."""
        since = t_s - self.start_s
        return "on the way to its start" if since < self.join_s else self.mode.phase(since - self.join_s)

    def acceleration_lvlh(self, t_s: float, state: LvlhState) -> FloatArray:
        """(3,) thrust per mass to hold for the next period of control [m s-2].

        Parameters
        ----------
        state : position [m] and velocity [m s-1] of the chaser now, LVLH.
        """
        if t_s >= self.coasts_from_s:
            return np.zeros(3)
        decide = getattr(self.mode, "impulse_lvlh", None)
        if decide is not None and t_s - self.start_s >= self.join_s:
            wanted = decide(*state, self.n_rad_s)
        else:
            Phi = transition_matrix(self.n_rad_s, CONTROL_S)
            wanted = path_impulse(state, self.aim(t_s + CONTROL_S), Phi, CONTROL_S)
        return np.asarray(np.clip(wanted / CONTROL_S, -LARGEST_M_S2, LARGEST_M_S2))


def begin_mode(
    title: str, mode: Chaser, state: LvlhState, n_rad_s: float, t_s: float, orbit: OrbitTrack | None = None
) -> Guided:
    """A mode begun now; the chaser first flies to its start on a curve that suits both velocities.

    Parameters
    ----------
    orbit : of the target, to whose eccentricity free flight is fitted; a circular one unless given.
    """
    end = mode.state_lvlh(0.0, n_rad_s)
    join_s = _join_s(state, end)
    if orbit is not None and mode.ballistic:
        mu = orbit.forces.mu_m3_s2
        now = elements_from_state(*orbit(t_s), mu)
        end = mode.start_lvlh(replace(now, true_anomaly_rad=true_anomaly_after(now, join_s, mu)), mu)
    return Guided(
        title=title,
        mode=mode,
        n_rad_s=n_rad_s,
        start_s=t_s,
        join=(state, end),
        join_s=join_s,
    )


def hold_here(state: LvlhState) -> Hold:
    """Station keeping where the chaser is."""
    return Hold(position_lvlh_m=_triple(state[0]))


def hold_at(place_lvlh_m: tuple[float, float, float], radius_m: float) -> Hold:
    """Station keeping at a point.

    Raises
    ------
    UserError
        If the point is in the target or next to it.
    """
    _check_clear(float(np.linalg.norm(place_lvlh_m)), radius_m, "the point")
    return Hold(position_lvlh_m=place_lvlh_m)


def vbar(state: LvlhState, hold_m: float, speed_m_s: float, radius_m: float) -> VbarApproach:
    """Along the velocity axis to ``hold_m`` before or behind, whichever side the chaser is on."""
    _check_clear(hold_m, radius_m, "the hold point")
    side = -1.0 if state[0][1] < 0 else 1.0
    away = max(float(np.linalg.norm(state[0])), hold_m)
    return VbarApproach(start_m=side * away, hold_m=side * hold_m, speed_m_s=speed_m_s)


def rbar(state: LvlhState, hold_m: float, speed_m_s: float, radius_m: float) -> RbarApproach:
    """Along the radius to ``hold_m`` above or below, whichever side the chaser is on."""
    _check_clear(hold_m, radius_m, "the hold point")
    side = -1.0 if state[0][0] < 0 else 1.0
    away = max(float(np.linalg.norm(state[0])), hold_m)
    return RbarApproach(start_m=side * away, hold_m=side * hold_m, speed_m_s=speed_m_s)


def glideslope(state: LvlhState, end_m: float, radius_m: float) -> Glideslope:
    """Straight in to ``end_m`` from the centre of mass; a hundredth of the distance a second, at last 1 cm/s."""
    _check_clear(end_m, radius_m, "the end of the glideslope")
    p = state[0]
    away = float(np.linalg.norm(p))
    if away <= end_m:
        raise UserError(f"the chaser is {away:.1f} m from the target, inside {end_m:g} m; name a nearer end")
    return Glideslope(
        start_lvlh_m=_triple(p),
        end_lvlh_m=_triple(p * (end_m / away)),
        start_m_s=max(0.01 * (away - end_m), 0.0101),
        end_m_s=0.01,
    )


def waypoint(
    state: LvlhState, place_lvlh_m: tuple[float, float, float], speed_m_s: float, radius_m: float
) -> Waypoints:
    """Along a straight line to a point, and hold there.

    Raises
    ------
    UserError
        If the line leads into the target.
    """
    a, b = state[0], np.array(place_lvlh_m, float)
    along = b - a
    share = float(np.clip(-(a @ along) / max(float(along @ along), 1e-12), 0.0, 1.0))
    _check_clear(float(np.linalg.norm(a + share * along)), radius_m, "the straight line to that point")
    return Waypoints(points_lvlh_m=[_triple(a), _triple(b)], speed_m_s=speed_m_s)


def flyaround(state: LvlhState, radius_m: float, period_s: float, target_radius_m: float) -> ForcedFlyaround:
    """A forced circle through the chaser's direction, in the plane of the orbit or the one nearest to it."""
    _check_clear(radius_m, target_radius_m, "the circle")
    p = state[0]
    in_plane = float(np.hypot(p[0], p[1]))
    # the node where the chaser is, and the plane raised until it holds the chaser a quarter turn before
    phase = float(np.degrees(np.arctan2(p[1], p[0])))
    tilt = float(np.degrees(np.arctan2(abs(p[2]), in_plane)))
    node = phase - 90.0 if p[2] >= 0 else phase + 90.0
    return ForcedFlyaround(
        radius_m=radius_m,
        period_s=period_s,
        inclination_deg=tilt,
        node_deg=(node + 360.0) % 360.0,
        phase_deg=90.0 if p[2] >= 0 else 270.0,
    )


def circumnavigation(
    state: LvlhState, radial_m: float | None, target_radius_m: float
) -> NaturalCircumnavigation:
    """The natural 2:1 ellipse about the target, through the chaser's place unless a size is given."""
    size, phase_deg = _ellipse(state, radial_m)
    _check_clear(size, target_radius_m, "the ellipse")
    return NaturalCircumnavigation(radial_m=size, phase_deg=phase_deg)


def safe_ellipse(state: LvlhState, radial_m: float | None, target_radius_m: float) -> SafeEllipse:
    """As the natural ellipse, with an equal swing out of plane that keeps clear of the velocity axis."""
    size, phase_deg = _ellipse(state, radial_m)
    _check_clear(size, target_radius_m, "the ellipse")
    return SafeEllipse(radial_m=size, cross_track_m=size, phase_deg=phase_deg)


def keep_range(state: LvlhState, near_m: float, far_m: float, target_radius_m: float) -> RangeKeeping:
    """Drift that is turned back at two distances.

    Raises
    ------
    UserError
        If the chaser is not between them, or they are less than four metres apart.
    """
    _check_clear(near_m, target_radius_m, "the nearer distance")
    away = float(np.linalg.norm(state[0]))
    if not near_m <= away <= far_m or far_m - near_m < 4:
        raise UserError(
            f"the chaser is {away:.1f} m away; name two distances, at least 4 m apart, that it is between"
        )
    return RangeKeeping(position_lvlh_m=_triple(state[0]), near_m=near_m, far_m=far_m)


def _ellipse(state: LvlhState, radial_m: float | None) -> tuple[float, float]:
    x, y = float(state[0][0]), float(state[0][1])
    size = float(np.hypot(x, y / 2)) if radial_m is None else radial_m
    return size, float(np.degrees(np.arctan2(-y / 2, x)))


def _check_clear(away_m: float, radius_m: float, what: str) -> None:
    least = CLEAR_RADII * radius_m
    if away_m < least:
        raise UserError(
            f"{what} comes within {away_m:.1f} m of the target's centre of mass; allowed: at least {least:.1f} m"
        )


def _join_s(start: LvlhState, end: LvlhState) -> float:
    """Long enough for the speed and for half the thrust there is."""
    way = float(np.linalg.norm(end[0] - start[0]))
    speeds = float(np.linalg.norm(start[1]) + np.linalg.norm(end[1]))
    most = LARGEST_M_S2 / 2
    return max(LEAST_JOIN_S, way / JOIN_M_S, float(np.sqrt(6 * way / most)), 4 * speeds / most)


def cubic_between(start: LvlhState, end: LvlhState, duration_s: float, t_s: float) -> LvlhState:
    """Position and velocity on the cubic of Hermite between two states.

    Parameters
    ----------
    duration_s : between them. t_s : since the first.
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


def _triple(p: FloatArray) -> tuple[float, float, float]:
    return (float(p[0]), float(p[1]), float(p[2]))
