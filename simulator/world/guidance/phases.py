"""What a chaser is about at a moment, in one word or two: cruise, braking, hold, the leg between two points."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from simulator.world.guidance.modes import (
    ForcedFlyaround,
    FreeDrift,
    Hold,
    NaturalCircumnavigation,
    StraightApproach,
)
from simulator.world.guidance.paths import Glideslope, RangeKeeping, SafeEllipse, Waypoints

if TYPE_CHECKING:
    from simulator.world.guidance.modes import Guidance

_NAMES: dict[type, str] = {
    Hold: "hold",
    FreeDrift: "drift",
    NaturalCircumnavigation: "circumnavigation",
    SafeEllipse: "safe ellipse",
    ForcedFlyaround: "flyaround",
    RangeKeeping: "range keeping",
}


def phase_of(guidance: Guidance, t_s: float) -> str:
    """The phase that a mode of motion is in, ``t_s`` seconds after its start."""
    if isinstance(guidance, StraightApproach):
        return _straight(guidance, t_s)
    if isinstance(guidance, Waypoints):
        return _waypoints(guidance, t_s)
    if isinstance(guidance, Glideslope):
        p, _ = guidance.state_lvlh(t_s, 0.0)
        return "hold" if np.array_equal(p, np.array(guidance.end_lvlh_m, float)) else "glideslope"
    return _NAMES.get(type(guidance), type(guidance).__name__.lower())


def _straight(mode: StraightApproach, t_s: float) -> str:
    start, hold = np.array(mode.start_lvlh_m, float), np.array(mode.hold_lvlh_m, float)
    speed = float(np.linalg.norm(mode.state_lvlh(t_s, 0.0)[1]))
    if speed == 0.0:
        return "hold"
    length = float(np.linalg.norm(hold - start))
    cruise = min(mode.speed_m_s, float(np.sqrt(2 * mode.braking_m_s2 * length)))
    return "cruise" if speed >= cruise * (1 - 1e-12) else "braking"


def _waypoints(mode: Waypoints, t_s: float) -> str:
    left_s = t_s
    points = np.array(mode.points_lvlh_m, float)
    for k, (a, b) in enumerate(pairwise(points), start=1):
        left_s -= mode.rest_s
        if left_s <= 0 < mode.rest_s:
            return f"rest {k}"
        leg_s = float(np.linalg.norm(b - a)) / mode.speed_m_s
        if left_s < leg_s:
            return f"leg {k}"
        left_s -= leg_s
    return "hold"
