"""Sections of a scenario file that say how both craft move: orbit, forces, burns, attitude, the chaser's motion."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from simulator.scenario.units import (
    Aim,
    Centre,
    Degrees,
    DirectionXyz,
    Inclination,
    Inertia,
    Metres,
    MetresXyz,
    Range,
    Rate,
    Seconds,
    Section,
    SpeedXyz,
    Torque,
)


class ElementsOrbit(Section, tag_field="kind", tag="elements", frozen=True, kw_only=True):
    """Osculating Keplerian elements on GCRS axes; altitude = semi-major axis less 6378.137 km (Moon: 1737.4 km)."""

    centre: Centre = "earth"
    altitude_km: Annotated[float, Meta(ge=10, le=50_000)]
    eccentricity: Annotated[float, Meta(ge=0, le=0.9)] = 0.0
    inclination_deg: Inclination = 0.0
    raan_deg: Degrees = 0.0
    argp_deg: Degrees = 0.0
    true_anomaly_deg: Degrees = 0.0


class StateOrbit(Section, tag_field="kind", tag="state", frozen=True, kw_only=True):
    """Position and velocity of the target's centre of mass at the epoch from ``centre``, along GCRS axes."""

    centre: Centre = "earth"
    r_eci_km: tuple[float, float, float]
    v_eci_km_s: tuple[float, float, float]


class TleOrbit(Section, tag_field="kind", tag="tle", frozen=True, kw_only=True):
    """Two-line elements, carried by SGP4 to the scenario's epoch; from there the forces move the target."""

    line1: str
    line2: str


class OemOrbit(Section, tag_field="kind", tag="oem", frozen=True, kw_only=True):
    """A CCSDS orbit ephemeris message (a path from the scenario's folder), read at the scenario's epoch."""

    centre: Centre = "earth"
    file: str


class Point(Section, frozen=True, kw_only=True):
    """``axis`` of the target exactly at ``at``; ``second_axis`` as near to ``second_at`` as it can be."""

    axis: DirectionXyz
    at: Aim
    second_axis: DirectionXyz
    second_at: Aim


class Attitude(Section, frozen=True, kw_only=True):
    """The target at the epoch, and how it turns from there.

    ``q_wxyz`` is ``q_frame_from_target`` (Hamilton, scalar first); instead of it ``euler_deg`` gives yaw,
    pitch, roll (turns about z, then the new y, then the new x) that carry the frame's axes to the target's.
    Or ``aem_file`` names a CCSDS attitude ephemeris message, which gives attitude and rate at the epoch.
    ``rate_deg_s`` is relative to the stars, about the target's axes.

    ``motion``: ``tumble`` as a rigid body, free or under the torques below; ``spin`` steadily by ``rate_deg_s``, the
    axis fixed in the target and among the stars; ``fixed`` in ``frame``; ``point`` as section ``point`` says;
    ``aem`` follows the file all through the flight.
    """

    motion: Literal["tumble", "spin", "fixed", "point", "aem"] = "tumble"
    frame: Literal["eci", "lvlh"] = "lvlh"
    q_wxyz: tuple[float, float, float, float] | None = None
    euler_deg: tuple[Degrees, Degrees, Degrees] | None = None
    rate_deg_s: tuple[Rate, Rate, Rate] = (0.0, 0.0, 0.0)
    aem_file: str | None = None
    point: Point | None = None
    gravity_gradient: bool = False
    torque_body_nm: tuple[Torque, Torque, Torque] = (0.0, 0.0, 0.0)
    residual_dipole_a_m2: tuple[Torque, Torque, Torque] = (0.0, 0.0, 0.0)
    inertia_kg_m2: (
        tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]] | None
    ) = None


class Pointing(Section, frozen=True, kw_only=True):
    """Boresight at the target's centre of mass, then turned by constant angles.

    ``right_deg`` and ``below_deg`` turn the boresight to the right of and below the target; ``roll_deg``
    turns the camera clockwise about it. ``down`` is what the picture's down side follows; ``auto`` takes the
    first of nadir, cross_track, along_track that stays clear of the boresight all through the flight.
    """

    down: Literal["auto", "nadir", "cross_track", "along_track"] = "auto"
    right_deg: Annotated[float, Meta(ge=-90, le=90)] = 0.0
    below_deg: Annotated[float, Meta(ge=-90, le=90)] = 0.0
    roll_deg: Degrees = 0.0


class ThrustersSection(Section, frozen=True, kw_only=True):
    """With this section the chaser flies by thrusters and follows its path only as well as they let it."""

    mass_kg: Annotated[float, Meta(gt=0, le=1e6)] = 100.0
    force_n: Annotated[float, Meta(gt=0, le=1e5)] = 1.0
    minimum_impulse_ns: Annotated[float, Meta(ge=0, le=1e3)] = 0.01
    specific_impulse_s: Annotated[float, Meta(gt=0, le=1e4)] = 220.0
    period_s: Annotated[float, Meta(ge=0.05, le=60)] = 1.0


class WheelsSection(Section, frozen=True, kw_only=True):
    """With this section reaction wheels turn the camera, and it points only as well as they can.

    Three wheels along the camera's axes (right, down, forward). ``start_error_deg`` turns the camera at the start.
    """

    inertia_kg_m2: tuple[Inertia, Inertia, Inertia] = (20.0, 20.0, 20.0)
    torque_nm: Annotated[float, Meta(gt=0, le=1e3)] = 0.05
    momentum_nms: Annotated[float, Meta(gt=0, le=1e4)] = 4.0
    bandwidth_rad_s: Annotated[float, Meta(gt=0, le=10)] = 0.2
    damping: Annotated[float, Meta(gt=0, le=5)] = 0.9
    period_s: Annotated[float, Meta(ge=0.01, le=10)] = 0.25
    start_error_deg: tuple[Degrees, Degrees, Degrees] = (0.0, 0.0, 0.0)


class KeepOutSection(Section, frozen=True, kw_only=True):
    """A sphere about the target that may be entered through a cone only; else the chaser aborts and retreats."""

    radius_m: Range
    corridor_axis_lvlh: tuple[float, float, float] | None = None
    corridor_half_angle_deg: Annotated[float, Meta(ge=0, le=90)] = 10.0
    retreat_m_s: Annotated[float, Meta(gt=0, le=10)] = 0.1


class _Chaser(Section, frozen=True, kw_only=True):
    """What every mode of motion has; positions are in LVLH: radial outward, along-track, cross-track.

    ``keep_out`` takes effect for a chaser that flies by thrusters or is steered.
    """

    pointing: Pointing = Pointing()
    thrusters: ThrustersSection | None = None
    wheels: WheelsSection | None = None
    keep_out: KeepOutSection | None = None
    minimum_start_range_m: Range = 1.5


class HoldChaser(_Chaser, tag_field="mode", tag="hold", frozen=True, kw_only=True):
    """Station keeping at a point."""

    position_lvlh_m: MetresXyz


class DriftChaser(_Chaser, tag_field="mode", tag="drift", frozen=True, kw_only=True):
    """Free flight from a state in the rotating LVLH frame."""

    position_lvlh_m: MetresXyz
    velocity_lvlh_m_s: SpeedXyz = (0.0, 0.0, 0.0)


class CircumnavigationChaser(_Chaser, tag_field="mode", tag="circumnavigation", frozen=True, kw_only=True):
    """Free flight on the 2:1 ellipse, once per orbit; ``cross_phase_deg = 90`` makes it passively safe."""

    radial_m: Range
    phase_deg: Degrees = 0.0
    cross_track_m: Annotated[float, Meta(ge=0, le=1e5)] = 0.0
    cross_phase_deg: Degrees = 90.0
    centre_along_track_m: Metres = 0.0


class SafeEllipseChaser(_Chaser, tag_field="mode", tag="safe_ellipse", frozen=True, kw_only=True):
    """Free flight on an ellipse that stays clear of the along-track axis by the smaller of its two half sizes."""

    radial_m: Range
    cross_track_m: Range
    phase_deg: Degrees = 0.0
    centre_along_track_m: Metres = 0.0


class _StraightChaser(_Chaser, frozen=True, kw_only=True):
    """Along one axis from ``start_m`` to ``hold_m``."""

    start_m: Metres
    hold_m: Metres
    speed_m_s: Annotated[float, Meta(gt=0, le=100)]
    braking_m_s2: Annotated[float, Meta(gt=0, le=100)] = 0.005


class VbarChaser(_StraightChaser, tag_field="mode", tag="vbar", frozen=True, kw_only=True):
    """Straight along the velocity axis from ``start_m`` to ``hold_m`` (positive: ahead of the target)."""


class RbarChaser(_StraightChaser, tag_field="mode", tag="rbar", frozen=True, kw_only=True):
    """Straight along the radial axis from ``start_m`` to ``hold_m`` (positive: above the target)."""


class FlyaroundChaser(_Chaser, tag_field="mode", tag="flyaround", frozen=True, kw_only=True):
    """Forced circle in a plane fixed in LVLH; with ``far_radius_m`` the range swings out and back."""

    radius_m: Range
    period_s: Seconds
    inclination_deg: Inclination = 0.0
    node_deg: Degrees = 0.0
    phase_deg: Degrees = 0.0
    far_radius_m: Range | None = None
    range_period_s: Seconds = 120.0


class WaypointsChaser(_Chaser, tag_field="mode", tag="waypoints", frozen=True, kw_only=True):
    """From point to point along straight lines, starting and ending each leg at rest."""

    points_lvlh_m: Annotated[list[MetresXyz], Meta(min_length=1, max_length=1000)]
    speed_m_s: Annotated[float, Meta(gt=0, le=100)]
    rest_s: Annotated[float, Meta(ge=0, le=1e6)] = 0.0


class GlideslopeChaser(_Chaser, tag_field="mode", tag="glideslope", frozen=True, kw_only=True):
    """A straight line on which the speed falls with the distance left."""

    start_lvlh_m: MetresXyz
    end_lvlh_m: MetresXyz
    start_m_s: Annotated[float, Meta(gt=0, le=100)]
    end_m_s: Annotated[float, Meta(gt=0, le=100)]


class KeepRangeChaser(_Chaser, tag_field="mode", tag="keep_range", frozen=True, kw_only=True):
    """Free drift that thrusters turn back before the range leaves ``near_m`` to ``far_m``."""

    position_lvlh_m: MetresXyz
    near_m: Range
    far_m: Range
    turn_m_s: Annotated[float, Meta(gt=0, le=1)] = 0.01
    margin_m: Annotated[float, Meta(gt=0, le=1e3)] = 1.0


class SteerCommand(Section, frozen=True, kw_only=True):
    """A push, or a turn of the camera, for a while; commands that overlap add up."""

    start_s: Annotated[float, Meta(ge=0, le=1e6)]
    duration_s: Seconds
    acceleration_m_s2: SpeedXyz = (0.0, 0.0, 0.0)
    axes: Literal["lvlh", "camera"] = "lvlh"
    rate_camera_deg_s: tuple[Rate, Rate, Rate] = (0.0, 0.0, 0.0)


class SteeredChaser(_Chaser, tag_field="mode", tag="steered", frozen=True, kw_only=True):
    """Free flight with an operator's commands, written down; ``tracking`` keeps the camera on the target."""

    position_lvlh_m: MetresXyz
    velocity_lvlh_m_s: SpeedXyz = (0.0, 0.0, 0.0)
    commands: Annotated[list[SteerCommand], Meta(max_length=10_000)] = msgspec.field(default_factory=list)
    tracking: bool = True
    brake_m_s2: Annotated[float, Meta(gt=0, le=100)] = 0.05
    period_s: Annotated[float, Meta(ge=0.05, le=60)] = 0.5


class ReplayChaser(_Chaser, tag_field="mode", tag="replay", frozen=True, kw_only=True):
    """A recorded flight of both craft (a path from the scenario's folder); orbit and attitude come from it too."""

    file: str


AnyChaser = (
    ReplayChaser
    | HoldChaser
    | DriftChaser
    | CircumnavigationChaser
    | SafeEllipseChaser
    | VbarChaser
    | RbarChaser
    | FlyaroundChaser
    | WaypointsChaser
    | GlideslopeChaser
    | KeepRangeChaser
    | SteeredChaser
)


class SurfaceSection(Section, frozen=True, kw_only=True):
    """A craft for drag and sunlight; the target's mass comes from its model unless given."""

    mass_kg: Annotated[float, Meta(gt=0, le=1e6)] | None = None
    area_m2: Annotated[float, Meta(gt=0, le=1e5)] = 1.0
    drag_coefficient: Annotated[float, Meta(ge=0, le=10)] = 2.2
    reflectivity: Annotated[float, Meta(ge=0, le=2)] = 1.3


class Forces(Section, frozen=True, kw_only=True):
    """What moves both craft. ``gravity_degree``: 0 a point mass, 2 to 70 EGM96; without it a point mass + J2.

    About the Moon the Earth always pulls, and the degree is 0 (the default) or 2.
    """

    gravity_degree: Annotated[int, Meta(ge=0, le=70)] | None = None
    sun: bool = False
    moon: bool = False
    drag: bool = False
    solar_pressure: bool = False
    target: SurfaceSection = SurfaceSection()
    chaser: SurfaceSection = SurfaceSection()


class BurnSection(Section, frozen=True, kw_only=True):
    """A change of velocity of either craft along the target's LVLH axes: at once, or evenly over ``duration_s``.

    The chaser's burns are for one in free flight (drift, circumnavigation, safe_ellipse).
    """

    craft: Literal["target", "chaser"]
    start_s: Annotated[float, Meta(ge=0, le=1e6)]
    delta_v_lvlh_m_s: SpeedXyz
    duration_s: Annotated[float, Meta(ge=0, le=1e6)] = 0.0
