"""Hold points on the approach axis: their distances, their conditions, and the operator's go or no-go decisions."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

from flyaround.simulator.piloting.docking_figures import CORRIDOR_DEG, judge
from flyaround.simulator.piloting.readouts import speed_text

if TYPE_CHECKING:
    from flyaround.simulator.piloting.docking_figures import DockingFigures, DockingLimits

Decision = Literal["open", "go", "no-go", "passed", "behind"]

DISTANCES_M = (150.0, 100.0, 50.0, 20.0, 10.0, 5.0)
"""Distances from the port [m]; those beyond the chaser's start are omitted."""

POSITION_TOLERANCE, MIN_POSITION_TOLERANCE_M = 0.03, 0.2
"""Tolerance of a hold point's position: a share of its distance, at least this distance [m]."""

REST_SPEED_M_S = 0.02
"""Speed below which the chaser counts as at rest at a hold point [m s-1], plus 1e-3 of its distance per second."""


@dataclass(frozen=True, kw_only=True)
class HoldPoint:
    """One hold point.

    Parameters
    ----------
    name : str
        Name on the display.
    axial_m : float
        Distance of the docking point in front of the port.
    decision : Decision, optional
        Open until the operator decides, or until the chaser passes the point without a go; ``behind`` if the chaser
        came into the corridor nearer than the point.
    """

    name: str
    axial_m: float
    decision: Decision = "open"

    @property
    def within_m(self) -> float:
        """Tolerance of its position [m]."""
        return max(MIN_POSITION_TOLERANCE_M, POSITION_TOLERANCE * self.axial_m)


class HoldPoints:
    """The hold points from far to near, with the decision for each.

    Parameters
    ----------
    start_m : float
        Distance at which the approach begins.
    distances_m : tuple of float, optional
        Distances of the points.
    """

    def __init__(self, start_m: float, distances_m: tuple[float, ...] = DISTANCES_M) -> None:
        self._distances_m = distances_m
        self.begin(start_m)

    def begin(self, start_m: float) -> None:
        """Reset the decisions; only hold points nearer than ``start_m`` remain."""
        self._farthest_m = -math.inf  # in the corridor
        remaining = sorted((d for d in self._distances_m if d < start_m), reverse=True)
        self.points = tuple(HoldPoint(name=f"H{k}", axial_m=d) for k, d in enumerate(remaining, start=1))

    @property
    def next(self) -> HoldPoint | None:
        """The first hold point without a go; None if contact is next."""
        return next((p for p in self.points if p.decision in ("open", "no-go")), None)

    def watch(self, figures: DockingFigures, corridor_deg: float = CORRIDOR_DEG) -> HoldPoint | None:
        """Mark the next point as passed, or as behind, and return it, if the chaser is beyond it without a go."""
        point = self.next
        if figures.off_axis_deg > corridor_deg:
            return None
        self._farthest_m = max(self._farthest_m, figures.axial_m)
        if point is None or figures.axial_m >= point.axial_m - 2 * point.within_m:
            return None
        self._decide(point, "passed" if self._farthest_m >= point.axial_m - point.within_m else "behind")
        return point

    def rearm(self, figures: DockingFigures, corridor_deg: float = CORRIDOR_DEG) -> None:
        """Reset the hold points ahead if the chaser is outside the corridor; at least the nearest one remains."""
        if figures.off_axis_deg > corridor_deg:
            nearest_m = min(self._distances_m)
            self.begin(max(figures.range_m, nearest_m * (1 + POSITION_TOLERANCE)))

    def go(
        self, figures: DockingFigures, limits: DockingLimits, corridor_deg: float = CORRIDOR_DEG
    ) -> tuple[str, ...]:
        """Give a go for the next point; if there are reasons against it, return them instead."""
        point = self.next
        if point is None:
            return ("there is no hold point left",)
        reasons = not_ready(point, figures, limits, corridor_deg)
        if not reasons:
            self._decide(point, "go")
        return reasons

    def no_go(self) -> HoldPoint | None:
        """Give a no-go for the next point, and return it, if there is one."""
        point = self.next
        if point is not None:
            self._decide(point, "no-go")
        return point

    def _decide(self, point: HoldPoint, decision: Decision) -> None:
        self.points = tuple(replace(p, decision=decision) if p.name == point.name else p for p in self.points)


def not_ready(
    point: HoldPoint, figures: DockingFigures, limits: DockingLimits, corridor_deg: float = CORRIDOR_DEG
) -> tuple[str, ...]:
    """Return the reasons why the chaser may not leave a hold point; empty if it may."""
    reasons = []
    distance = figures.axial_m - point.axial_m
    if abs(distance) > point.within_m:
        where = "before" if distance > 0 else "behind"
        reasons.append(f"{abs(distance):.1f} m {where} {point.name}")
    # far out, orbital motion moves even a craft at rest by about the mean motion times the distance (1e-3 per second)
    if figures.speed_m_s > REST_SPEED_M_S + 1e-3 * point.axial_m:
        reasons.append(f"moving at {speed_text(figures.speed_m_s)}")
    reasons += [
        f"{row.name} {row.text} {row.unit}"
        for row in judge(figures, limits, corridor_deg)
        if row.state != "within"
    ]
    return tuple(reasons)
