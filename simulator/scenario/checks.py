"""Checks of a scenario as a whole: values that are allowed one by one, but not together."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.messages import chaser_ephemeris, known_orbit
from flyaround.simulator.world.attitude.rigid_body import check_inertia
from flyaround.simulator.world.flight.recording import Replay
from flyaround.simulator.world.guidance.command_script import CommandScript
from flyaround.simulator.world.guidance.free_flight import FollowedChaser, RangeKeeping, SafeEllipse
from flyaround.simulator.world.guidance.paths import Glideslope
from flyaround.simulator.world.orbit.initial_orbit import ElementsOrbit, OemOrbit

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scenario.scenario import AnyChaser, Scenario
    from flyaround.simulator.world.attitude.target_attitude import Attitude, Point
    from flyaround.simulator.world.ephemeris.body import Body
    from flyaround.simulator.world.orbit.forces import Forces

_MOST_PHASE = 0.5
"""Bandwidth times period of the wheels' control above which holding the torque makes it swing."""
_FARTHEST_M = 1e6
"""As far as other modes of a chaser may start."""
_PARALLEL = 1e-3
"""Sine of the angle between two axes below which they are taken for one."""


def check_physics(scenario: Scenario, where: str) -> None:
    """Refuse what each key allows alone but physics does not allow together.

    Raises
    ------
    UserError
        With file, key, value and what is allowed.
    """
    o = known_orbit(scenario)
    body = o.body
    if isinstance(o, ElementsOrbit):
        altitude = o.lowest_altitude_m
        if altitude < body.lowest_m:
            key, value = (
                ("eccentricity", o.eccentricity) if o.eccentricity else ("altitude_km", o.altitude_km)
            )
            raise UserError(
                f"{where}: key orbit.{key} is {value:g}, which puts the orbit's lowest point at "
                f"{altitude / 1e3:.0f} km, allowed: at least {body.lowest_m / 1e3:.0f} km above {body.title}"
            )
        if o.highest_m > body.reach_m:
            raise UserError(
                f"{where}: key orbit.eccentricity is {o.eccentricity:g}, which puts the orbit's highest point at "
                f"{o.highest_m / 1e3:.0f} km from the centre of {body.title}, allowed: at most "
                f"{body.reach_m / 1e3:.0f} km"
            )
    elif (problem := o.problem()) is not None:
        raise UserError(f"{where}: {problem[0]} {problem[1]}")
    _check_forces(scenario.forces, body, where)
    _check_attitude(scenario.attitude, body, where)
    _check_chaser(scenario.chaser, where)
    _check_followed(scenario, where)
    _check_burns(scenario, where)


def _check_forces(f: Forces, body: Body, where: str) -> None:
    """Refuse forces that have no model about the body."""
    if f.gravity_degree is not None and f.gravity_degree not in body.degrees:
        raise UserError(
            f"{where}: key forces.gravity_degree is {f.gravity_degree}, allowed about {body.title}: "
            f"{' or '.join(map(str, body.degrees))}"
        )
    for key in ("sun", "moon", "drag", "solar_pressure"):
        if getattr(f, key) and key not in body.acting:
            why = f"has no model about {body.title}"
            if key == body.name:
                why = "is the centre of this orbit"
            elif body.air is None and key == "drag":
                why = f"needs air, and {body.title} has none"
            raise UserError(f"{where}: key forces.{key} is true, but it {why}: remove the key")


def _check_attitude(a: Attitude, body: Body, where: str) -> None:
    """Refuse an attitude given twice or not at all, and what does not go with the motion."""
    if a.q_wxyz is not None and a.euler_deg is not None:
        raise UserError(f"{where}: section [attitude] has both q_wxyz and euler_deg, allowed: one of them")
    if a.q_wxyz is not None:
        norm = float(np.linalg.norm(a.q_wxyz))
        if abs(norm - 1) > 1e-3:
            raise UserError(
                f"{where}: key attitude.q_wxyz is {list(a.q_wxyz)} with norm {norm:.6g}, "
                "allowed: a unit quaternion, scalar first"
            )
    if a.inertia_kg_m2 is not None:
        try:
            check_inertia(np.array(a.inertia_kg_m2))
        except ValueError as error:
            raise UserError(f"{where}: key attitude.inertia_kg_m2: {error}") from error
    if not body.has_field and any(a.residual_dipole_a_m2):
        raise UserError(
            f"{where}: key attitude.residual_dipole_a_m2 needs the Earth's field, and this orbit is about "
            f"{body.title}: remove the key"
        )
    _check_motion(a, where)


def _check_motion(a: Attitude, where: str) -> None:
    torques = any((*a.torque_body_nm, *a.residual_dipole_a_m2)) or a.gravity_gradient
    if a.motion != "tumble" and torques:
        raise UserError(
            f"{where}: section [attitude] has a torque, but attitude.motion is {a.motion}: remove it, or choose tumble"
        )
    if a.motion == "spin" and not any(a.rate_deg_s):
        raise UserError(
            f"{where}: key attitude.rate_deg_s is [0, 0, 0], allowed: the rate and axis of the spin"
        )
    if a.motion in {"fixed", "point", "aem"} and any(a.rate_deg_s):
        raise UserError(
            f"{where}: key attitude.rate_deg_s is given, but attitude.motion is {a.motion}: remove one of them"
        )
    if (a.motion == "aem") != (a.aem_file is not None):
        raise UserError(
            f"{where}: attitude.motion is {a.motion}, which goes with key attitude.aem_file and no other: give the file"
        )
    if (a.motion == "point") != (a.point is not None):
        raise UserError(
            f"{where}: attitude.motion is {a.motion}, but section [attitude.point] goes with motion point alone"
        )
    if a.point is not None:
        _check_point(a.point, where)


def _check_point(p: Point, where: str) -> None:
    axes = np.array(p.axis, float), np.array(p.second_axis, float)
    sizes = [float(np.linalg.norm(x)) for x in axes]
    if min(sizes) == 0 or float(np.linalg.norm(np.cross(*axes))) < _PARALLEL * sizes[0] * sizes[1]:
        raise UserError(
            f"{where}: attitude.point.axis {list(p.axis)} and second_axis {list(p.second_axis)} must be two "
            "directions apart from each other"
        )
    if p.at == p.second_at or {p.at, p.second_at} == {"nadir", "zenith"}:
        raise UserError(
            f"{where}: attitude.point.at and second_at are {p.at} and {p.second_at}, allowed: two different directions"
        )


def _check_chaser(chaser: AnyChaser, where: str) -> None:
    """Refuse a start too close to the target, and sections that contradict each other."""
    if isinstance(chaser, Replay):
        for name in ("thrusters", "wheels"):
            if getattr(chaser, name) is not None:
                raise UserError(
                    f"{where}: a replay has no [chaser.{name}], the recording flies: remove the section"
                )
    if isinstance(chaser, FollowedChaser):
        return
    start, _ = chaser.state_lvlh(0.0, 1e-3)
    distance, least = float(np.linalg.norm(start)), chaser.minimum_start_range_m
    if distance < least:
        raise UserError(
            f"{where}: section [chaser] starts {distance:.3g} m from the target, allowed: at least "
            f"{least:g} m (key chaser.minimum_start_range_m)"
        )
    if chaser.thrusters is not None and (chaser.ballistic or isinstance(chaser, CommandScript)):
        what = (
            "steered by accelerations" if isinstance(chaser, CommandScript) else "free flight without thrust"
        )
        raise UserError(
            f"{where}: section [chaser.thrusters] is given, but the chaser's mode is {what}: remove the section or "
            "choose another mode"
        )
    _check_keep_out(chaser, start, where)
    _check_wheels(chaser, where)
    if isinstance(chaser, Glideslope) and chaser.end_m_s > chaser.start_m_s:
        raise UserError(
            f"{where}: key chaser.end_m_s is {chaser.end_m_s:g}, allowed: at most chaser.start_m_s = "
            f"{chaser.start_m_s:g}"
        )
    if isinstance(chaser, RangeKeeping) and not (
        chaser.near_m + chaser.margin_m < distance < chaser.far_m - chaser.margin_m
    ):
        raise UserError(
            f"{where}: section [chaser] starts {distance:.3g} m from the target, allowed: between near_m + margin_m "
            f"= {chaser.near_m + chaser.margin_m:g} and far_m - margin_m = {chaser.far_m - chaser.margin_m:g} m"
        )


def _check_followed(scenario: Scenario, where: str) -> None:
    """Refuse what does not go with craft that follow files."""
    chaser = scenario.chaser
    if isinstance(chaser, FollowedChaser):
        for name in ("thrusters", "keep_out"):
            if getattr(chaser, name) is not None:
                raise UserError(
                    f"{where}: a chaser of mode oem follows its file, and section [chaser.{name}] has no part in "
                    "that: remove the section"
                )
        ephemeris = chaser_ephemeris(scenario)
        assert ephemeris is not None  # noqa: S101 - of this mode it is there
        away = float(np.linalg.norm(ephemeris(0.0)[0] - known_orbit(scenario).state()[0]))
        if not chaser.minimum_start_range_m <= away <= _FARTHEST_M:
            raise UserError(
                f"{where}: {chaser.file} starts {away:.4g} m from the target, allowed: "
                f"{chaser.minimum_start_range_m:g} (key chaser.minimum_start_range_m) to {_FARTHEST_M:g} m: is it the "
                "other craft's file?"
            )
    followed = {"target": isinstance(scenario.orbit, OemOrbit), "chaser": isinstance(chaser, FollowedChaser)}
    for k, burn in enumerate(scenario.burns):
        if followed[burn.craft]:
            raise UserError(
                f"{where}: key burns[{k}] is of the {burn.craft}, which follows an OEM with its burns in "
                "it: remove the "
                'burn, or set orbit.motion = "propagate"'
            )


def _check_keep_out(chaser: AnyChaser, start: FloatArray, where: str) -> None:
    sphere = chaser.keep_out
    if sphere is None:
        return
    if isinstance(chaser, SafeEllipse):
        if chaser.least_distance_m < sphere.radius_m:
            raise UserError(
                f"{where}: the safe ellipse comes within {chaser.least_distance_m:g} m of the along-track axis, "
                f"allowed: at least {sphere.radius_m:g} m (key chaser.keep_out.radius_m)"
            )
        return
    if chaser.acting_thrusters is None and not isinstance(chaser, CommandScript):
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


def _check_wheels(chaser: AnyChaser, where: str) -> None:
    w = chaser.wheels
    if w is None:
        return
    if isinstance(chaser, CommandScript) and not chaser.tracking:
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


def _check_burns(scenario: Scenario, where: str) -> None:
    """Refuse burns outside the flight, or of a chaser whose mode moves it."""
    for k, b in enumerate(scenario.burns):
        if b.start_s + b.duration_s > scenario.duration_s:
            raise UserError(
                f"{where}: key burns[{k}] ends {b.start_s + b.duration_s:g} s after the start, allowed: within the "
                f"flight of {scenario.duration_s:g} s"
            )
        if isinstance(scenario.chaser, Replay):
            raise UserError(
                f"{where}: a replay has no burns, they are in the recording: remove section burns"
            )
        if b.craft == "chaser" and not scenario.chaser.ballistic:
            raise UserError(
                f"{where}: key burns[{k}].craft is chaser, but the chaser's mode moves it: choose drift, "
                "circumnavigation or safe_ellipse, or give the burn to the target"
            )
