"""Orders to fly a guidance mode from the present state."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import msgspec
import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.guidance_modes import begin_mode
from flyaround.simulator.piloting.orders import Order, flown_news
from flyaround.simulator.runtime.arrays import Vec3, vec3
from flyaround.simulator.runtime.untrusted_files import refuse_not_finite
from flyaround.simulator.runtime.validation_errors import convert_document
from flyaround.simulator.world.guidance.free_flight import NaturalCircumnavigation, RangeKeeping, SafeEllipse
from flyaround.simulator.world.guidance.paths import (
    ForcedFlyaround,
    Glideslope,
    Hold,
    RbarApproach,
    VbarApproach,
    Waypoints,
)

if TYPE_CHECKING:
    from flyaround.simulator.piloting.docking_watch import News
    from flyaround.simulator.piloting.guidance_modes import LvlhState
    from flyaround.simulator.piloting.piloted_craft import PilotedCraft
    from flyaround.simulator.world.guidance.chaser import Chaser

MIN_CLEARANCE_RADII = 1.5
"""Smallest distance of a guidance mode from the centre of mass, in radii of the target; chosen by eye."""

# Defaults of the pilot's orders, who may give others; chosen by eye.

HOLD_DISTANCE_M = 10.0
"""Default distance of a hold point from the centre of mass [m]; farther from a large target."""

# Default speed of an approach [m s-1].
APPROACH_M_S = 0.1

FLYAROUND_PERIOD_S = 900.0
"""Default period of a fly-around [s]."""

RANGE_AMPLITUDE_M = 5.0
"""Default amplitude of range keeping to both sides [m]."""

# Closing speed of a glideslope per metre of distance [s-1], and at its end [m s-1]: as slow as docking ports allow.
GLIDE_PER_S, GLIDE_END_M_S = 0.01, 0.01

# Minimum difference between the bounds of range keeping [m]: room to turn round in; chosen by eye.
MIN_SWING_M = 4.0


@dataclass(frozen=True)
class GuidanceOrder(Order):
    """Base of orders to fly a guidance mode."""

    title: ClassVar[str]

    def carry_out(self, craft: PilotedCraft) -> News:
        """Take over, and start the mode.

        Returns
        -------
        News
            Note of the mode; a caution if a burn is planned, which it would undo.

        Raises
        ------
        UserError
            If it leads into the target, or a number is not finite or out of range.
        """
        craft.take_over()
        state, flight = craft.state_lvlh(), craft.flight
        mode = self.mode(state, craft.docking.radius_m)
        # building the mode checks no bounds; converting its document does
        document, source = msgspec.to_builtins(mode), f"guidance: {self.title}"
        refuse_not_finite(document, source)
        convert_document(document, type(mode), source)
        craft.steering.guide(begin_mode(self.title, mode, state, flight.n_rad_s, craft.t_s, flight.orbit))
        return flown_news(craft, f"guidance: {self.title}", self.title)

    @abstractmethod
    def mode(self, state: LvlhState, radius_m: float) -> Chaser:
        """Return the mode for a chaser state and a target's radius.

        Raises
        ------
        UserError
            If it leads into the target.
        """


@dataclass(frozen=True)
class KeepStation(GuidanceOrder):
    """Keep a position in LVLH [m], or the present one."""

    title = "station keeping"
    place_lvlh_m: Vec3 | None = None

    def mode(self, state: LvlhState, radius_m: float) -> Hold:
        """Return station keeping."""
        if self.place_lvlh_m is None:
            return Hold(position_lvlh_m=vec3(state[0]))
        _check_clear(float(np.linalg.norm(self.place_lvlh_m)), radius_m, "the point")
        return Hold(position_lvlh_m=self.place_lvlh_m)


@dataclass(frozen=True)
class ApproachVbar(GuidanceOrder):
    """Approach along V-bar to a hold point, on the chaser's side."""

    title = "V-bar"
    path: ClassVar[type[VbarApproach | RbarApproach]] = VbarApproach
    along: ClassVar[int] = 1
    hold_m: float | None = None
    speed_m_s: float = APPROACH_M_S

    def mode(self, state: LvlhState, radius_m: float) -> VbarApproach | RbarApproach:
        """Return the approach."""
        hold_m = _near_m(radius_m) if self.hold_m is None else self.hold_m
        _check_clear(hold_m, radius_m, "the hold point")
        side = -1.0 if state[0][self.along] < 0 else 1.0
        distance = max(float(np.linalg.norm(state[0])), hold_m)
        return self.path(start_m=side * distance, hold_m=side * hold_m, speed_m_s=self.speed_m_s)


@dataclass(frozen=True)
class ApproachRbar(ApproachVbar):
    """Approach along R-bar to a hold point, on the chaser's side."""

    title = "R-bar"
    path = RbarApproach
    along = 0


@dataclass(frozen=True)
class FlyGlideslope(GuidanceOrder):
    """Fly straight towards the target up to a distance.

    The speed is 1 % of the remaining distance per second, and at least 1 cm/s.
    """

    title = "glideslope"
    end_m: float | None = None

    def mode(self, state: LvlhState, radius_m: float) -> Glideslope:
        """Return the glideslope.

        Raises
        ------
        UserError
            If the distances do not suit the chaser's position.
        """
        end_m = _near_m(radius_m) if self.end_m is None else self.end_m
        _check_clear(end_m, radius_m, "the end of the glideslope")
        p = state[0]
        distance = float(np.linalg.norm(p))
        if distance <= end_m:
            raise UserError(
                f"the chaser is {distance:.1f} m from the target, inside {end_m:g} m; choose a nearer end"
            )
        return Glideslope(
            start_lvlh_m=vec3(p),
            end_lvlh_m=vec3(p * (end_m / distance)),
            start_m_s=max(GLIDE_PER_S * (distance - end_m), 1.01 * GLIDE_END_M_S),
            end_m_s=GLIDE_END_M_S,
        )


@dataclass(frozen=True)
class FlyTo(GuidanceOrder):
    """Fly along a straight line to a position in LVLH [m], and hold there."""

    title = "waypoint"
    place_lvlh_m: Vec3
    speed_m_s: float = APPROACH_M_S

    def mode(self, state: LvlhState, radius_m: float) -> Waypoints:
        """Return the straight path.

        Returns
        -------
        Waypoints
            One leg, from rest at the chaser's position to rest at ``place_lvlh_m``.

        Raises
        ------
        UserError
            If the line leads into the target.
        """
        a, b = state[0], np.array(self.place_lvlh_m, float)
        along = b - a
        share = float(np.clip(-(a @ along) / max(float(along @ along), 1e-12), 0.0, 1.0))
        place = ", ".join(f"{c:z.2f}" for c in b)
        nearest_m = float(np.linalg.norm(a + share * along))
        _check_clear(nearest_m, radius_m, f"the straight line to {place} m (radial, along, cross)")
        return Waypoints(points_lvlh_m=[vec3(a), vec3(b)], speed_m_s=self.speed_m_s)


@dataclass(frozen=True)
class FlyAround(GuidanceOrder):
    """Fly a forced circle through the chaser's direction, in the plane nearest to the orbit's."""

    title = "fly-around"
    circle_m: float | None = None
    period_s: float = FLYAROUND_PERIOD_S

    def mode(self, state: LvlhState, radius_m: float) -> ForcedFlyaround:
        """Return the circle, through the chaser unless its radius is given."""
        p = state[0]
        circle_m = float((p @ p) ** 0.5) if self.circle_m is None else self.circle_m
        _check_clear(circle_m, radius_m, "the circle")
        in_plane = float(np.hypot(p[0], p[1]))
        # the node is at the chaser, and the plane is rotated until it contains the chaser
        phase = float(np.degrees(np.arctan2(p[1], p[0])))
        tilt = float(np.degrees(np.arctan2(abs(p[2]), in_plane)))
        node = phase - 90.0 if p[2] >= 0 else phase + 90.0
        return ForcedFlyaround(
            radius_m=circle_m,
            period_s=self.period_s,
            inclination_deg=tilt,
            node_deg=(node + 360.0) % 360.0,
            phase_deg=90.0 if p[2] >= 0 else 270.0,
        )


@dataclass(frozen=True)
class Circumnavigate(GuidanceOrder):
    """Fly the natural 2:1 ellipse around the target, through the chaser unless a size is given."""

    title = "natural circumnavigation"
    radial_m: float | None = None

    def mode(self, state: LvlhState, radius_m: float) -> NaturalCircumnavigation | SafeEllipse:
        """Return the ellipse."""
        size, phase_deg = self.ellipse(state, radius_m)
        return NaturalCircumnavigation(radial_m=size, phase_deg=phase_deg)

    def ellipse(self, state: LvlhState, radius_m: float) -> tuple[float, float]:
        """Return half of the radial size [m] and the phase [deg]."""
        x, y = float(state[0][0]), float(state[0][1])
        size = float(np.hypot(x, y / 2)) if self.radial_m is None else self.radial_m
        _check_clear(size, radius_m, "the ellipse")
        return size, float(np.degrees(np.arctan2(-y / 2, x)))


@dataclass(frozen=True)
class FlySafeEllipse(Circumnavigate):
    """Fly the natural ellipse with an equal out-of-plane amplitude, clear of the velocity axis."""

    title = "safe ellipse"

    def mode(self, state: LvlhState, radius_m: float) -> SafeEllipse:
        """Return the ellipse."""
        size, phase_deg = self.ellipse(state, radius_m)
        return SafeEllipse(radial_m=size, cross_track_m=size, phase_deg=phase_deg)


@dataclass(frozen=True)
class KeepRange(GuidanceOrder):
    """Drift between two distances, and reverse the direction at each."""

    title = "range keeping"
    near_m: float | None = None
    far_m: float | None = None

    def mode(self, state: LvlhState, radius_m: float) -> RangeKeeping:
        """Return range keeping.

        Raises
        ------
        UserError
            If the distances do not suit the chaser's position.
        """
        distance = float((state[0] @ state[0]) ** 0.5)
        near_m = (
            max(distance - RANGE_AMPLITUDE_M, MIN_CLEARANCE_RADII * radius_m)
            if self.near_m is None
            else self.near_m
        )
        far_m = distance + RANGE_AMPLITUDE_M if self.far_m is None else self.far_m
        _check_clear(near_m, radius_m, "the nearer distance")
        distance = float(np.linalg.norm(state[0]))
        if not near_m <= distance <= far_m or far_m - near_m < MIN_SWING_M:
            raise UserError(
                f"the chaser is {distance:.1f} m away; give a smaller and a larger distance, "
                f"{MIN_SWING_M:g} m apart"
            )
        return RangeKeeping(position_lvlh_m=vec3(state[0]), near_m=near_m, far_m=far_m)


def _near_m(radius_m: float) -> float:
    return max(HOLD_DISTANCE_M, 2 * MIN_CLEARANCE_RADII * radius_m)


def _check_clear(away_m: float, radius_m: float, what: str) -> None:
    min_distance = MIN_CLEARANCE_RADII * radius_m
    if away_m < min_distance:
        raise UserError(
            f"{what} comes within {away_m:.1f} m of the target's centre of mass; allowed: at least {min_distance:.1f} m"
        )
