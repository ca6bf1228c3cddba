"""Samples from flights: around one trajectory, or sequences with random starts."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import Plan, plan_flight
from flyaround.simulator.scenario.poses import scene_with_pose
from flyaround.simulator.scenario.random_draws import (
    numbered_generator,
    uniform_attitude,
    uniform_direction,
)
from flyaround.simulator.scenario.recipe import AboutTrajectory, Recipe, Sequences
from flyaround.simulator.scene.sample import Sample, SequenceStep
from flyaround.simulator.world.frames.pose import Pose
from flyaround.simulator.world.frames.rotation import quat_from_rotvec, quat_multiply
from flyaround.simulator.world.orbit.initial_orbit import ElementsOrbit

if TYPE_CHECKING:
    from numpy.random import Generator

    from flyaround.simulator.scenario.scenario import AnyChaser, Scenario
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

_SEQUENCES = 0x5E0  # key of the random numbers of sequences
_MAX_STARTS = 30  # starts that are tried for a sunlit sequence
_MIN_SUNLIT_SHARE = 0.5  # least visible share of the Sun in a sunlit frame


def flight_scene(
    rng: Generator, recipe: Recipe, target: Target, seed: int, k: int, n_frames: int
) -> SceneState:
    """Return sample k of a recipe whose poses come from flights, with light and sky of that time.

    Raises
    ------
    TypeError
        If the recipe's poses do not come from a flight.
    """
    poses, document = recipe.poses, msgspec.json.encode(recipe)
    if isinstance(poses, Sequences):
        number, step = divmod(k, poses.frames)
        plan = _flight(document, target.name, seed, number)
        scene = plan.shifted((step * poses.every_s,)).scene(0)
        return replace(scene, sample=Sample(sequence=SequenceStep(sequence=number, step=step)))
    if not isinstance(poses, AboutTrajectory):
        raise TypeError("the recipe's poses do not come from a flight")
    plan = _flight(document, target.name, seed, 0)
    share = k / max(n_frames - 1, 1) if poses.moments == "even" else float(rng.random())
    scene = plan.shifted((share * plan.scenario.duration_s,)).scene(0)
    if not poses.position_sigma_m and not poses.attitude_sigma_deg:
        return scene
    position_error_m = rng.normal(0.0, poses.position_sigma_m, 3)
    turn = rng.normal(0.0, np.radians(poses.attitude_sigma_deg), 3)
    q = quat_multiply(scene.q_camera_from_target_wxyz, quat_from_rotvec(turn))
    pose = Pose.from_arrays(
        "camera", "target", q, np.asarray(scene.t_camera_from_target_m) + position_error_m
    )
    return scene_with_pose(scene, target, pose, k)


@lru_cache(maxsize=8)
def _flight(document: bytes, target: str, seed: int, number: int) -> Plan:
    """Return flight ``number`` of a recipe, encoded as JSON, with the recipe's target, camera and light."""
    recipe = msgspec.json.decode(document, type=Recipe)
    poses = recipe.poses
    assert isinstance(poses, AboutTrajectory | Sequences)  # noqa: S101 - callers check this
    try:
        scenario = load_scenario(poses.scenario)
    except UserError as error:
        raise UserError(f"{recipe.where}: section [poses]: {error}") from error
    names = ("camera", "sensor", "optics", "environment", "lamp", "lights")
    scenario = msgspec.structs.replace(
        scenario, target=target, **{name: getattr(recipe, name) for name in names}
    )
    if isinstance(poses, AboutTrajectory):
        return plan_flight(scenario, times=(0.0,), seed=seed)
    return _sequence(scenario, poses, seed, number, recipe.where)


def _sequence(scenario: Scenario, poses: Sequences, seed: int, number: int, source: str) -> Plan:
    """Return the flight of one sequence: its own start, attitude and rate."""
    rng = numbered_generator(seed, number, _SEQUENCES)
    distance, rate = float(rng.uniform(*poses.range_m)), float(rng.uniform(*poses.rate_deg_s))
    attitude = msgspec.structs.replace(
        scenario.attitude,
        q_wxyz=tuple(float(x) for x in uniform_attitude(rng)),
        euler_deg=None,
        rate_deg_s=vec3(rate * uniform_direction(rng)),
    )
    chaser = _with_start_distance(scenario.chaser, distance, f"{source}: scenario {poses.scenario}")
    duration = poses.every_s * (poses.frames - 1)
    scenario = msgspec.structs.replace(
        scenario, attitude=attitude, chaser=chaser, duration_s=duration, burns=[]
    )
    for _ in range(_MAX_STARTS):
        if isinstance(scenario.orbit, ElementsOrbit):
            position_deg = float(rng.uniform(0.0, 360.0))
            scenario = msgspec.structs.replace(
                scenario, orbit=msgspec.structs.replace(scenario.orbit, true_anomaly_deg=position_deg)
            )
        plan = plan_flight(scenario, times=(0.0,), seed=seed)
        is_lit = all(
            plan.shifted((t,)).scene(0).sun_visible_fraction > _MIN_SUNLIT_SHARE for t in (0.0, duration)
        )
        if is_lit or not poses.sunlit:
            return plan
    raise UserError(
        f"{source}: no start of scenario {poses.scenario} leaves {duration:g} s of sunlight: take fewer frames, or set "
        "sunlit = false in [poses]"
    )


def _with_start_distance(chaser: AnyChaser, distance_m: float, source: str) -> AnyChaser:
    """Return the chaser with its start at another distance along the line from the target."""
    for key in ("position_lvlh_m", "start_lvlh_m"):
        start = getattr(chaser, key, None)
        if start is not None and np.any(start):
            position = np.asarray(start, float) * (distance_m / np.linalg.norm(start))
            return msgspec.structs.replace(chaser, **{key: vec3(position)})
    start = getattr(chaser, "start_m", None)
    if start:
        return msgspec.structs.replace(chaser, start_m=float(np.copysign(distance_m, start)))
    raise UserError(
        f"{source}: its chaser cannot start at range_m of [poses]; use a chaser with an initial position (mode "
        "hold, drift, keep_range, vbar, rbar, glideslope)"
    )
