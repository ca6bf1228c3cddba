"""From a scenario's [chaser] section to guidance, thrusters and keep-out: degrees become radians."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from simulator.errors import UserError
from simulator.runtime.arrays import FloatArray, vec3
from simulator.scenario import motion as sm
from simulator.scenario import scenario as sc
from simulator.world.attitude.reaction_wheels import Wheels
from simulator.world.attitude.rigid_body import check_inertia
from simulator.world.flight.recording import Recording
from simulator.world.guidance.command_script import ScriptedCommand, Steered
from simulator.world.guidance.keep_out import KeepOut
from simulator.world.guidance.modes import (
    ForcedFlyaround,
    FreeDrift,
    Guidance,
    Hold,
    NaturalCircumnavigation,
    StraightApproach,
)
from simulator.world.guidance.paths import Glideslope, RangeKeeping, SafeEllipse, Waypoints
from simulator.world.guidance.thrusters import Thrusters
from simulator.world.orbit.burns import Burn

_MOST_PHASE = 0.5
"""Bandwidth times period of the wheels' control above which holding the torque makes it swing."""


def guidance(chaser: sm.AnyChaser) -> Guidance:
    """The motion mode that a ``[chaser]`` section asks for."""
    match chaser:
        case sm.ReplayChaser():
            # the recording flies; this tells how far away it starts
            return Hold(position_lvlh_m=vec3(Recording.read(Path(chaser.file)).arrays["relative_eci_m"][0]))
        case sm.HoldChaser():
            return Hold(position_lvlh_m=chaser.position_lvlh_m)
        case sm.DriftChaser():
            return FreeDrift(
                position_lvlh_m=chaser.position_lvlh_m, velocity_lvlh_m_s=chaser.velocity_lvlh_m_s
            )
        case sm.CircumnavigationChaser():
            return NaturalCircumnavigation(
                radial_m=chaser.radial_m,
                phase_rad=np.radians(chaser.phase_deg),
                cross_track_m=chaser.cross_track_m,
                cross_phase_rad=np.radians(chaser.cross_phase_deg),
                centre_along_track_m=chaser.centre_along_track_m,
            )
        case sm.SafeEllipseChaser():
            return SafeEllipse(
                radial_m=chaser.radial_m,
                cross_track_m=chaser.cross_track_m,
                phase_rad=np.radians(chaser.phase_deg),
                centre_along_track_m=chaser.centre_along_track_m,
            )
        case sm.VbarChaser() | sm.RbarChaser():
            axis = np.array([0.0, 1.0, 0.0] if isinstance(chaser, sm.VbarChaser) else [1.0, 0.0, 0.0])
            return StraightApproach(
                start_lvlh_m=tuple(chaser.start_m * axis),
                hold_lvlh_m=tuple(chaser.hold_m * axis),
                speed_m_s=chaser.speed_m_s,
                braking_m_s2=chaser.braking_m_s2,
            )
        case sm.FlyaroundChaser():
            return ForcedFlyaround(
                radius_m=chaser.radius_m,
                period_s=chaser.period_s,
                inclination_rad=np.radians(chaser.inclination_deg),
                node_rad=np.radians(chaser.node_deg),
                phase_rad=np.radians(chaser.phase_deg),
                far_radius_m=chaser.far_radius_m,
                range_period_s=chaser.range_period_s,
            )
        case sm.WaypointsChaser():
            return Waypoints(
                points_lvlh_m=tuple(chaser.points_lvlh_m), speed_m_s=chaser.speed_m_s, rest_s=chaser.rest_s
            )
        case sm.GlideslopeChaser():
            return Glideslope(
                start_lvlh_m=chaser.start_lvlh_m,
                end_lvlh_m=chaser.end_lvlh_m,
                start_m_s=chaser.start_m_s,
                end_m_s=chaser.end_m_s,
            )
        case sm.KeepRangeChaser():
            return RangeKeeping(
                position_lvlh_m=chaser.position_lvlh_m,
                near_m=chaser.near_m,
                far_m=chaser.far_m,
                turn_m_s=chaser.turn_m_s,
                margin_m=chaser.margin_m,
            )
        case sm.SteeredChaser():
            return Steered(
                position_lvlh_m=chaser.position_lvlh_m,
                velocity_lvlh_m_s=chaser.velocity_lvlh_m_s,
                commands=tuple(_command(c) for c in chaser.commands),
                tracking=chaser.tracking,
                brake_m_s2=chaser.brake_m_s2,
                period_s=chaser.period_s,
            )


def _command(c: sm.SteerCommand) -> ScriptedCommand:
    return ScriptedCommand(
        start_s=c.start_s,
        duration_s=c.duration_s,
        acceleration_m_s2=c.acceleration_m_s2,
        axes=c.axes,
        rate_camera_rad_s=vec3(np.radians(c.rate_camera_deg_s)),
    )


def thrusters(chaser: sm.AnyChaser) -> Thrusters | None:
    """The thrusters of a ``[chaser]`` section, or None when its path is followed exactly.

    A mode that decides impulses cannot do without: it gets the default ones.
    """
    section = chaser.thrusters
    if section is None:
        return Thrusters() if isinstance(chaser, sm.KeepRangeChaser) else None
    return Thrusters(
        mass_kg=section.mass_kg,
        force_n=section.force_n,
        minimum_impulse_ns=section.minimum_impulse_ns,
        specific_impulse_s=section.specific_impulse_s,
        period_s=section.period_s,
    )


def wheels(chaser: sm.AnyChaser) -> Wheels | None:
    """The reaction wheels of a ``[chaser]`` section, or None when the camera points exactly."""
    section = chaser.wheels
    if section is None:
        return None
    return Wheels(
        inertia_kg_m2=section.inertia_kg_m2,
        torque_nm=section.torque_nm,
        momentum_nms=section.momentum_nms,
        bandwidth_rad_s=section.bandwidth_rad_s,
        damping=section.damping,
        period_s=section.period_s,
        start_error_rad=vec3(np.radians(section.start_error_deg)),
    )


def burns(sections: list[sm.BurnSection]) -> tuple[Burn, ...]:
    """The burns of both craft."""
    return tuple(
        Burn(craft=b.craft, start_s=b.start_s, delta_v_lvlh_m_s=b.delta_v_lvlh_m_s, duration_s=b.duration_s)
        for b in sections
    )


def keep_out(chaser: sm.AnyChaser) -> KeepOut | None:
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


def check_chaser(chaser: sm.AnyChaser, where: str) -> None:
    """Refuse a start too close to the target, and sections that contradict each other.

    Raises
    ------
    UserError
        With file, key, value and what is allowed.
    """
    if isinstance(chaser, sm.ReplayChaser):
        for name in ("thrusters", "wheels"):
            if getattr(chaser, name) is not None:
                raise UserError(
                    f"{where}: a replay has no [chaser.{name}], the recording flies: remove the section"
                )
    mode = guidance(chaser)
    start, _ = mode.state_lvlh(0.0, 1e-3)
    distance, least = float(np.linalg.norm(start)), chaser.minimum_start_range_m
    if distance < least:
        raise UserError(
            f"{where}: section [chaser] starts {distance:.3g} m from the target, allowed: at least "
            f"{least:g} m (key chaser.minimum_start_range_m)"
        )
    if chaser.thrusters is not None and (mode.ballistic or isinstance(mode, Steered)):
        what = "steered by accelerations" if isinstance(mode, Steered) else "free flight without thrust"
        raise UserError(
            f"{where}: section [chaser.thrusters] is given, but the chaser's mode is {what}: remove the section or "
            "choose another mode"
        )
    _check_keep_out(chaser, mode, start, where)
    _check_wheels(chaser, where)
    if isinstance(chaser, sm.GlideslopeChaser) and chaser.end_m_s > chaser.start_m_s:
        raise UserError(
            f"{where}: key chaser.end_m_s is {chaser.end_m_s:g}, allowed: at most chaser.start_m_s = "
            f"{chaser.start_m_s:g}"
        )
    if isinstance(chaser, sm.KeepRangeChaser) and not (
        chaser.near_m + chaser.margin_m < distance < chaser.far_m - chaser.margin_m
    ):
        raise UserError(
            f"{where}: section [chaser] starts {distance:.3g} m from the target, allowed: between near_m + margin_m "
            f"= {chaser.near_m + chaser.margin_m:g} and far_m - margin_m = {chaser.far_m - chaser.margin_m:g} m"
        )


def _check_keep_out(chaser: sm.AnyChaser, mode: Guidance, start: FloatArray, where: str) -> None:
    sphere = keep_out(chaser)
    if sphere is None:
        return
    if isinstance(mode, SafeEllipse):
        if mode.least_distance_m < sphere.radius_m:
            raise UserError(
                f"{where}: the safe ellipse comes within {mode.least_distance_m:g} m of the along-track axis, allowed: "
                f"at least {sphere.radius_m:g} m (key chaser.keep_out.radius_m)"
            )
        return
    if thrusters(chaser) is None and not isinstance(mode, Steered):
        raise UserError(
            f"{where}: section [chaser.keep_out] needs [chaser.thrusters], which would carry out an abort"
        )
    axis = sphere.corridor_axis_lvlh
    if axis is not None and not np.any(axis):
        raise UserError(f"{where}: key chaser.keep_out.corridor_axis_lvlh is [0, 0, 0], allowed: a direction")
    if sphere.violated(start):
        raise UserError(
            f"{where}: section [chaser] starts {float(np.linalg.norm(start)):.3g} m from the target, inside the "
            f"keep-out sphere and outside its corridor, allowed: at least {sphere.radius_m:g} m "
            "(key chaser.keep_out.radius_m)"
        )


def _check_wheels(chaser: sm.AnyChaser, where: str) -> None:
    w = chaser.wheels
    if w is None:
        return
    if isinstance(chaser, sm.SteeredChaser) and not chaser.tracking:
        raise UserError(
            f"{where}: section [chaser.wheels] is given, but chaser.tracking is false, so that the commands turn the "
            "camera: remove one of them"
        )
    try:
        check_inertia(np.diag(w.inertia_kg_m2))
    except ValueError as error:
        raise UserError(f"{where}: key chaser.wheels.inertia_kg_m2: {error}") from error
    if w.bandwidth_rad_s * w.period_s > _MOST_PHASE:
        raise UserError(
            f"{where}: key chaser.wheels.period_s is {w.period_s:g}, allowed with this bandwidth: at most "
            f"{_MOST_PHASE / w.bandwidth_rad_s:.3g} s, or the control swings itself up"
        )


def check_burns(scenario: sc.Scenario, where: str) -> None:
    """Refuse burns outside the flight, or of a chaser whose mode moves it.

    Raises
    ------
    UserError
        With file, key, value and what is allowed.
    """
    for k, b in enumerate(scenario.burns):
        if b.start_s + b.duration_s > scenario.duration_s:
            raise UserError(
                f"{where}: key burns[{k}] ends {b.start_s + b.duration_s:g} s after the start, allowed: within the "
                f"flight of {scenario.duration_s:g} s"
            )
        if isinstance(scenario.chaser, sm.ReplayChaser):
            raise UserError(
                f"{where}: a replay has no burns, they are in the recording: remove section burns"
            )
        if b.craft == "chaser" and not guidance(scenario.chaser).ballistic:
            raise UserError(
                f"{where}: key burns[{k}].craft is chaser, but the chaser's mode moves it: choose drift, "
                "circumnavigation or safe_ellipse, or give the burn to the target"
            )
