"""Consistency checks of a scenario or recipe: combinations of individually valid values."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.messages import chaser_ephemeris, orbit_at_epoch
from flyaround.simulator.scenario.recipe import EulerAttitude, PoseList, Recipe
from flyaround.simulator.world.attitude.rigid_body import check_inertia
from flyaround.simulator.world.ephemeris.body import body_named
from flyaround.simulator.world.flight.recording import Replay
from flyaround.simulator.world.guidance.command_script import CommandScript
from flyaround.simulator.world.guidance.free_flight import FollowedChaser, RangeKeeping, SafeEllipse
from flyaround.simulator.world.guidance.paths import Glideslope
from flyaround.simulator.world.orbit.initial_orbit import ElementsOrbit, OemOrbit

if TYPE_CHECKING:
    from collections.abc import Iterator

    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scenario.recipe import Background, Sky
    from flyaround.simulator.scenario.scenario import AnyChaser, Scenario
    from flyaround.simulator.world.attitude.target_attitude import Attitude, Point
    from flyaround.simulator.world.ephemeris.body import Body
    from flyaround.simulator.world.orbit.forces import Forces

_MAX_PHASE = 0.5
"""Product of bandwidth and period of the wheels' control above which it is unstable, because the torque is held."""

_MAX_RANGE_M = 1e6
"""Largest start range, as for the other modes of a chaser [m]."""

_PARALLEL_SINE = 1e-3
"""Sine of the angle between two axes below which they count as parallel."""


def check_document(document: Scenario | Recipe, source: str) -> None:
    """Raise if a combination of values is invalid.

    Raises
    ------
    UserError
        If a combination is invalid; the message states file, key, value and allowed values.
    """
    problems = _recipe_problems(document) if isinstance(document, Recipe) else _scenario_problems(document)
    raise_first_problem(problems, source)
    document.auto_exposure  # noqa: B018 - raises if its limits are reversed


def raise_first_problem(problems: Iterator[str], source: str) -> None:
    """Raise a `UserError` with the first problem, if there is one."""
    problem = next(problems, None)
    if problem is not None:
        raise UserError(f"{source}: {problem}")


def _scenario_problems(scenario: Scenario) -> Iterator[str]:
    """Yield combinations of values that are not physical."""
    o = orbit_at_epoch(scenario)
    body = o.body
    if isinstance(o, ElementsOrbit):
        altitude = o.lowest_altitude_m
        if altitude < body.lowest_m:
            key, value = (
                ("eccentricity", o.eccentricity) if o.eccentricity else ("altitude_km", o.altitude_km)
            )
            yield (
                f"key orbit.{key} is {value:g}, which puts the orbit's lowest point at "
                f"{altitude / 1e3:.0f} km, allowed: at least {body.lowest_m / 1e3:.0f} km above {body.title}"
            )
        if o.highest_m > body.reach_m:
            yield (
                f"key orbit.eccentricity is {o.eccentricity:g}, which puts the orbit's highest point at "
                f"{o.highest_m / 1e3:.0f} km from the centre of {body.title}, allowed: at most "
                f"{body.reach_m / 1e3:.0f} km"
            )
    elif (problem := o.problem()) is not None:
        yield f"{problem[0]} {problem[1]}"
    yield from _forces_problems(scenario.forces, body)
    yield from _attitude_problems(scenario.attitude, body)
    yield from _chaser_problems(scenario.chaser)
    yield from _followed_problems(scenario)
    yield from _burns_problems(scenario)


def _forces_problems(f: Forces, body: Body) -> Iterator[str]:
    """Yield forces that have no model for the central body."""
    if f.gravity_degree is not None and f.gravity_degree not in body.degrees:
        yield (
            f"key forces.gravity_degree is {f.gravity_degree}, allowed about {body.title}: "
            f"{' or '.join(map(str, body.degrees))}"
        )
    for key in ("sun", "moon", "drag", "solar_pressure"):
        if getattr(f, key) and key not in body.acting:
            why = f"has no model about {body.title}"
            if key == body.name:
                why = "is the centre of this orbit"
            elif body.air is None and key == "drag":
                why = f"needs air, and {body.title} has none"
            yield f"key forces.{key} is true, but it {why}: remove the key"


def _attitude_problems(a: Attitude, body: Body) -> Iterator[str]:
    """Yield duplicate or missing attitudes, and sections that conflict with the motion."""
    if a.q_wxyz is not None and a.euler_deg is not None:
        yield "section [attitude] has both q_wxyz and euler_deg, allowed: one of them"
    if a.q_wxyz is not None:
        norm = float(np.linalg.norm(a.q_wxyz))
        if abs(norm - 1) > 1e-3:  # four printed digits pass
            yield (
                f"key attitude.q_wxyz is {list(a.q_wxyz)} with norm {norm:.6g}, "
                "allowed: a unit quaternion, scalar first"
            )
    if a.inertia_kg_m2 is not None:
        try:
            check_inertia(np.array(a.inertia_kg_m2))
        except ValueError as error:
            yield f"key attitude.inertia_kg_m2: {error}"
    if not body.has_field and any(a.residual_dipole_a_m2):
        yield (
            f"key attitude.residual_dipole_a_m2 needs the Earth's field, and this orbit is about "
            f"{body.title}: remove the key"
        )
    yield from _motion_problems(a)


def _motion_problems(a: Attitude) -> Iterator[str]:
    torques = any((*a.torque_body_nm, *a.residual_dipole_a_m2)) or a.gravity_gradient
    if a.motion != "tumble" and torques:
        yield (
            f"section [attitude] has a torque, but attitude.motion is {a.motion}: remove it, or choose tumble"
        )
    if a.motion == "spin" and not any(a.rate_deg_s):
        yield "key attitude.rate_deg_s is [0, 0, 0], allowed: the rate and axis of the spin"
    if a.motion in {"fixed", "point", "aem"} and any(a.rate_deg_s):
        yield f"key attitude.rate_deg_s is given, but attitude.motion is {a.motion}: remove one of them"
    if (a.motion == "aem") != (a.aem_file is not None):
        yield (
            f"attitude.motion is {a.motion}, and motion aem and key attitude.aem_file require each other: "
            "give both or neither"
        )
    if (a.motion == "point") != (a.point is not None):
        yield (
            f"attitude.motion is {a.motion}, and motion point and section [attitude.point] require each other: "
            "give both or neither"
        )
    if a.point is not None:
        yield from _point_problems(a.point)


def _point_problems(p: Point) -> Iterator[str]:
    axes = np.array(p.axis, float), np.array(p.second_axis, float)
    norms = [float(np.linalg.norm(x)) for x in axes]
    if min(norms) == 0 or float(np.linalg.norm(np.cross(*axes))) < _PARALLEL_SINE * norms[0] * norms[1]:
        yield (
            f"attitude.point.axis {list(p.axis)} and second_axis {list(p.second_axis)} must be two "
            "directions apart from each other"
        )
    if p.at == p.second_at or {p.at, p.second_at} == {"nadir", "zenith"}:
        yield (
            f"attitude.point.at and second_at are {p.at} and {p.second_at}, allowed: two different directions"
        )


def _chaser_problems(chaser: AnyChaser) -> Iterator[str]:
    """Yield a start too close to the target, and sections that contradict each other."""
    if isinstance(chaser, Replay):
        for name in ("thrusters", "wheels"):
            if getattr(chaser, name) is not None:
                yield f"a replay has no [chaser.{name}], the recording flies: remove the section"
        if chaser.approach_axis_lvlh is not None and not any(chaser.approach_axis_lvlh):
            yield "key chaser.approach_axis_lvlh is [0, 0, 0], allowed: a direction"
    if isinstance(chaser, FollowedChaser):
        return
    start = (
        chaser.read().arrays["relative_eci_m"][0]
        if isinstance(chaser, Replay)
        else chaser.state_lvlh(0.0, 1e-3)[0]
    )
    distance, min_distance = float(np.linalg.norm(start)), chaser.minimum_start_range_m
    if distance < min_distance:
        yield (
            f"section [chaser] starts {distance:.3g} m from the target, allowed: at least "
            f"{min_distance:g} m (key chaser.minimum_start_range_m)"
        )
    if chaser.thrusters is not None and (chaser.ballistic or isinstance(chaser, CommandScript)):
        reason = (
            "steered by accelerations" if isinstance(chaser, CommandScript) else "free flight without thrust"
        )
        yield (
            f"section [chaser.thrusters] is given, but the chaser's mode is {reason}: remove the section or "
            "choose another mode"
        )
    thrusters = chaser.acting_thrusters
    if thrusters is not None and thrusters.minimum_impulse_ns > thrusters.force_n * thrusters.period_s:
        yield (
            f"key chaser.thrusters.minimum_impulse_ns is {thrusters.minimum_impulse_ns:g}, allowed: at most force_n "
            f"times period_s, {thrusters.force_n * thrusters.period_s:g}; the thrusters would never fire"
        )
    yield from _keep_out_problems(chaser, start)
    yield from _wheels_problems(chaser)
    if isinstance(chaser, Glideslope) and chaser.end_m_s > chaser.start_m_s:
        yield (
            f"key chaser.end_m_s is {chaser.end_m_s:g}, allowed: at most chaser.start_m_s = "
            f"{chaser.start_m_s:g}"
        )
    if isinstance(chaser, RangeKeeping) and not (
        chaser.near_m + chaser.margin_m < distance < chaser.far_m - chaser.margin_m
    ):
        yield (
            f"section [chaser] starts {distance:.3g} m from the target, allowed: between near_m + margin_m "
            f"= {chaser.near_m + chaser.margin_m:g} and far_m - margin_m = {chaser.far_m - chaser.margin_m:g} m"
        )


def _followed_problems(scenario: Scenario) -> Iterator[str]:
    """Yield sections that conflict with a target or chaser that follows an ephemeris file."""
    chaser = scenario.chaser
    if isinstance(chaser, FollowedChaser):
        for name in ("thrusters", "keep_out"):
            if getattr(chaser, name) is not None:
                yield (
                    f"a chaser of mode oem follows its file, and section [chaser.{name}] has no part in "
                    "that: remove the section"
                )
        ephemeris = chaser_ephemeris(scenario)
        assert ephemeris is not None  # noqa: S101 - present in this mode
        distance_m = float(np.linalg.norm(ephemeris(0.0)[0] - orbit_at_epoch(scenario).state()[0]))
        if not chaser.minimum_start_range_m <= distance_m <= _MAX_RANGE_M:
            yield (
                f"{chaser.file} starts {distance_m:.4g} m from the target, allowed: "
                f"{chaser.minimum_start_range_m:g} (key chaser.minimum_start_range_m) to {_MAX_RANGE_M:g} m: is it the "
                "other craft's file?"
            )
    followed = {"target": isinstance(scenario.orbit, OemOrbit), "chaser": isinstance(chaser, FollowedChaser)}
    for k, burn in enumerate(scenario.burns):
        if followed[burn.craft]:
            yield (
                f"key burns[{k}] is of the {burn.craft}, which follows an OEM with its burns in "
                "it: remove the "
                'burn, or set orbit.motion = "propagate"'
            )


def _keep_out_problems(chaser: AnyChaser, start: FloatArray) -> Iterator[str]:
    sphere = chaser.keep_out
    if sphere is None:
        return
    if isinstance(chaser, SafeEllipse):
        if chaser.min_distance_m < sphere.radius_m:
            yield (
                f"the safe ellipse comes within {chaser.min_distance_m:g} m of the along-track axis, "
                f"allowed: at least {sphere.radius_m:g} m (key chaser.keep_out.radius_m)"
            )
        return
    if chaser.acting_thrusters is None and not isinstance(chaser, CommandScript | Replay):
        yield "section [chaser.keep_out] needs [chaser.thrusters], which would carry out an abort"
    axis = sphere.corridor_axis_lvlh
    if axis is not None and not np.any(axis):
        yield "key chaser.keep_out.corridor_axis_lvlh is [0, 0, 0], allowed: a direction"
    if sphere.violated(start):
        yield (
            f"section [chaser] starts {float(np.linalg.norm(start)):.3g} m from the target, inside the "
            f"keep-out sphere and outside its corridor, allowed: at least {sphere.radius_m:g} m "
            "(key chaser.keep_out.radius_m)"
        )


def _wheels_problems(chaser: AnyChaser) -> Iterator[str]:
    w = chaser.wheels
    if w is None:
        return
    if isinstance(chaser, CommandScript) and not chaser.tracking:
        yield (
            "section [chaser.wheels] is given, but chaser.tracking is false, so that the commands turn the "
            "camera: remove one of them"
        )
    try:
        check_inertia(np.diag(w.inertia_kg_m2))
    except ValueError as error:
        yield f"key chaser.wheels.inertia_kg_m2: {error}"
    if w.bandwidth_rad_s * w.period_s > _MAX_PHASE:
        yield (
            f"key chaser.wheels.period_s is {w.period_s:g}, allowed with this bandwidth: at most "
            f"{_MAX_PHASE / w.bandwidth_rad_s:.3g} s, or the control swings itself up"
        )


def _burns_problems(scenario: Scenario) -> Iterator[str]:
    """Yield burns outside the flight, and burns of a chaser whose mode determines its motion."""
    for k, b in enumerate(scenario.burns):
        if b.start_s + b.duration_s > scenario.duration_s:
            yield (
                f"key burns[{k}] ends {b.start_s + b.duration_s:g} s after the start, allowed: within the "
                f"flight of {scenario.duration_s:g} s"
            )
        if isinstance(scenario.chaser, Replay):
            yield "a replay has no burns, they are in the recording: remove section burns"
        if b.craft == "chaser" and not scenario.chaser.ballistic:
            yield (
                f"key burns[{k}].craft is chaser, but the chaser's mode moves it: choose drift, "
                "circumnavigation or safe_ellipse, or give the burn to the target"
            )


def _recipe_problems(recipe: Recipe) -> Iterator[str]:
    """Yield reversed bounds and contradictory sections."""
    yield from _ordered("range", recipe.range.near_m, recipe.range.far_m, "near_m", "far_m")
    if isinstance(recipe.attitude, EulerAttitude):
        yield from _ordered(
            "attitude", recipe.attitude.from_deg, recipe.attitude.to_deg, "from_deg", "to_deg"
        )
    for number, sky in enumerate(recipe.sky):
        yield from _location_problems(f"sky[{number}]", sky)
    if recipe.background is not None:
        yield from _location_problems("background", recipe.background)
    for key in ("sky", "poses", "vary"):
        yield from reversed_intervals(getattr(recipe, key), key)
    yield from _poses_problems(recipe)


def reversed_intervals(value: object, key: str = "") -> Iterator[str]:
    """Yield a message for each interval, at any depth of a section, with its larger end first.

    Parameters
    ----------
    value : object
        Section, list of sections or value.
    key : str, optional
        Key of the value in the file.
    """
    if isinstance(value, msgspec.Struct):
        for name, inner in msgspec.structs.asdict(value).items():
            yield from reversed_intervals(inner, f"{key}.{name}" if key else name)
    elif isinstance(value, list):
        for number, inner in enumerate(value):
            yield from reversed_intervals(inner, f"{key}[{number}]")
    elif isinstance(value, tuple) and value[0] > value[1]:
        low, high = value
        yield f"key {key} is [{low:g}, {high:g}], allowed: the smaller first"


def _poses_problems(recipe: Recipe) -> Iterator[str]:
    """Yield sections that conflict with poses from a list or a flight."""
    if recipe.poses is None:
        return
    c = recipe.constraints
    if c.clearance_m is not None or c.origin_in_image or c.inside is not None:
        yield (
            "section [constraints] has poses drawn again, and those of [poses] are given: remove one of them"
        )
    if not isinstance(recipe.poses, PoseList) and recipe.background is not None:
        yield "section [background] is given, but a flight in [poses] has its own sky: remove one of them"


def _location_problems(section: str, location: Sky | Background) -> Iterator[str]:
    """Yield an unknown body, and an altitude below the lowest orbit about it."""
    try:
        body = body_named(location.body)
    except UserError as error:
        yield f"key {section}.body: {error}"
    if location.altitude_km * 1e3 < body.lowest_m:
        yield (
            f"key {section}.altitude_km is {location.altitude_km:g}, allowed above {body.title}: at least "
            f"{body.lowest_m / 1e3:g}"
        )


def _ordered(section: str, low: float, high: float, low_key: str, high_key: str) -> Iterator[str]:
    if low > high:
        yield f"section [{section}] has {low_key} {low:g} beyond {high_key} {high:g}: exchange them"
