"""From a scenario's [chaser] section to guidance, thrusters and keep-out: degrees become radians."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from simulator import scenario as sc
from simulator.arrays import vec3
from simulator.errors import UserError
from simulator.world.guidance import (
    ForcedFlyaround,
    FreeDrift,
    Guidance,
    Hold,
    NaturalCircumnavigation,
    StraightApproach,
)
from simulator.world.guidance_paths import Glideslope, RangeKeeping, Waypoints
from simulator.world.recording import Recording
from simulator.world.safety import KeepOut
from simulator.world.thrusters import Thrusters


def guidance(chaser: sc.AnyChaser) -> Guidance:
    """The motion mode that a ``[chaser]`` section asks for."""
    match chaser:
        case sc.ReplayChaser():
            # the recording flies; this tells how far away it starts
            return Hold(position_lvlh_m=vec3(Recording.read(Path(chaser.file)).arrays["relative_eci_m"][0]))
        case sc.HoldChaser():
            return Hold(position_lvlh_m=chaser.position_lvlh_m)
        case sc.DriftChaser():
            return FreeDrift(
                position_lvlh_m=chaser.position_lvlh_m, velocity_lvlh_m_s=chaser.velocity_lvlh_m_s
            )
        case sc.CircumnavigationChaser():
            return NaturalCircumnavigation(
                radial_m=chaser.radial_m,
                phase_rad=np.radians(chaser.phase_deg),
                cross_track_m=chaser.cross_track_m,
                cross_phase_rad=np.radians(chaser.cross_phase_deg),
                centre_along_track_m=chaser.centre_along_track_m,
            )
        case sc.VbarChaser() | sc.RbarChaser():
            axis = np.array([0.0, 1.0, 0.0] if isinstance(chaser, sc.VbarChaser) else [1.0, 0.0, 0.0])
            return StraightApproach(
                start_lvlh_m=tuple(chaser.start_m * axis),
                hold_lvlh_m=tuple(chaser.hold_m * axis),
                speed_m_s=chaser.speed_m_s,
                braking_m_s2=chaser.braking_m_s2,
            )
        case sc.FlyaroundChaser():
            return ForcedFlyaround(
                radius_m=chaser.radius_m,
                period_s=chaser.period_s,
                inclination_rad=np.radians(chaser.inclination_deg),
                node_rad=np.radians(chaser.node_deg),
                phase_rad=np.radians(chaser.phase_deg),
                far_radius_m=chaser.far_radius_m,
                range_period_s=chaser.range_period_s,
            )
        case sc.WaypointsChaser():
            return Waypoints(
                points_lvlh_m=tuple(chaser.points_lvlh_m), speed_m_s=chaser.speed_m_s, rest_s=chaser.rest_s
            )
        case sc.GlideslopeChaser():
            return Glideslope(
                start_lvlh_m=chaser.start_lvlh_m,
                end_lvlh_m=chaser.end_lvlh_m,
                start_m_s=chaser.start_m_s,
                end_m_s=chaser.end_m_s,
            )
        case sc.KeepRangeChaser():
            return RangeKeeping(
                position_lvlh_m=chaser.position_lvlh_m,
                near_m=chaser.near_m,
                far_m=chaser.far_m,
                turn_m_s=chaser.turn_m_s,
                margin_m=chaser.margin_m,
            )


def thrusters(chaser: sc.AnyChaser) -> Thrusters | None:
    """The thrusters of a ``[chaser]`` section, or None when its path is followed exactly.

    A mode that decides impulses cannot do without: it gets the default ones.
    """
    section = chaser.thrusters
    if section is None:
        return Thrusters() if isinstance(chaser, sc.KeepRangeChaser) else None
    return Thrusters(
        mass_kg=section.mass_kg,
        force_n=section.force_n,
        minimum_impulse_ns=section.minimum_impulse_ns,
        specific_impulse_s=section.specific_impulse_s,
        period_s=section.period_s,
    )


def keep_out(chaser: sc.AnyChaser) -> KeepOut | None:
    """The keep-out sphere of a ``[chaser]`` section."""
    section = chaser.keep_out
    if section is None:
        return None
    return KeepOut(
        radius_m=section.radius_m,
        corridor_axis_lvlh=section.corridor_axis_lvlh,
        corridor_half_angle_rad=np.radians(section.corridor_half_angle_deg),
        retreat_m_s=section.retreat_m_s,
    )


def check_chaser(chaser: sc.AnyChaser, where: str) -> None:
    """Refuse a start too close to the target, and sections that contradict each other.

    Raises
    ------
    UserError
        With file, key, value and what is allowed.
    """
    if isinstance(chaser, sc.ReplayChaser) and chaser.thrusters is not None:
        raise UserError(
            f"{where}: a replay has no [chaser.thrusters], the recording flies: remove the section"
        )
    start, _ = guidance(chaser).state_lvlh(0.0, 1e-3)
    distance, least = float(np.linalg.norm(start)), chaser.minimum_start_range_m
    if distance < least:
        raise UserError(
            f"{where}: section [chaser] starts {distance:.3g} m from the target, allowed: at least "
            f"{least:g} m (key chaser.minimum_start_range_m)"
        )
    if chaser.thrusters is not None and guidance(chaser).ballistic:
        raise UserError(
            f"{where}: section [chaser.thrusters] is given, but the chaser's mode is free flight without "
            "thrust: remove the section or choose another mode"
        )
    sphere = keep_out(chaser)
    if sphere is not None:
        if thrusters(chaser) is None:
            raise UserError(
                f"{where}: section [chaser.keep_out] needs [chaser.thrusters], which would carry out an abort"
            )
        axis = sphere.corridor_axis_lvlh
        if axis is not None and not np.any(axis):
            raise UserError(
                f"{where}: key chaser.keep_out.corridor_axis_lvlh is [0, 0, 0], allowed: a direction"
            )
        if sphere.violated(start):
            raise UserError(
                f"{where}: section [chaser] starts {distance:.3g} m from the target, inside the keep-out sphere "
                f"and outside its corridor, allowed: at least {sphere.radius_m:g} m (key chaser.keep_out.radius_m)"
            )
    if isinstance(chaser, sc.GlideslopeChaser) and chaser.end_m_s > chaser.start_m_s:
        raise UserError(
            f"{where}: key chaser.end_m_s is {chaser.end_m_s:g}, allowed: at most chaser.start_m_s = "
            f"{chaser.start_m_s:g}"
        )
    if isinstance(chaser, sc.KeepRangeChaser) and not (
        chaser.near_m + chaser.margin_m < distance < chaser.far_m - chaser.margin_m
    ):
        raise UserError(
            f"{where}: section [chaser] starts {distance:.3g} m from the target, allowed: between near_m + margin_m "
            f"= {chaser.near_m + chaser.margin_m:g} and far_m - margin_m = {chaser.far_m - chaser.margin_m:g} m"
        )
