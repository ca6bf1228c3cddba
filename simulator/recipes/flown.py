"""Samples out of flights: about one trajectory, or sequences that start at random."""

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
from flyaround.simulator.scenario.recipe import AboutTrajectory, Sequences
from flyaround.simulator.scene.sample import Sample, SequenceStep
from flyaround.simulator.world.frames.pose import Pose
from flyaround.simulator.world.frames.rotation import quat_from_rotvec, quat_multiply
from flyaround.simulator.world.orbit.initial_orbit import ElementsOrbit

if TYPE_CHECKING:
    from numpy.random import Generator

    from flyaround.simulator.scenario.recipe import Recipe
    from flyaround.simulator.scenario.scenario import AnyChaser, Scenario
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

_SEQUENCES = 0x5E0
_MOST_STARTS = 30
_LIT = 0.5


def flown_scene(
    rng: Generator, recipe: Recipe, target: Target, seed: int, k: int, n_frames: int
) -> SceneState:
    """Sample k of a recipe whose poses are flown, with the light and the sky of its moment."""
    poses = recipe.poses
    if isinstance(poses, Sequences):
        number, step = divmod(k, poses.frames)
        plan = _sequence(_Asked(recipe, target.name, seed, number))
        scene = plan.shifted((step * poses.every_s,)).scene(0)
        return replace(scene, sample=Sample(sequence=SequenceStep(sequence=number, step=step)))
    if not isinstance(poses, AboutTrajectory):
        raise TypeError("poses are of no flight")
    plan = _trajectory(_Asked(recipe, target.name, seed, 0))
    duration = plan.scenario.duration_s
    share = k / max(n_frames - 1, 1) if poses.moments == "even" else float(rng.random())
    scene = plan.shifted((share * duration,)).scene(0)
    if not poses.position_sigma_m and not poses.attitude_sigma_deg:
        return scene
    off = rng.normal(0.0, poses.position_sigma_m, 3)
    turn = rng.normal(0.0, np.radians(poses.attitude_sigma_deg), 3)
    q = quat_multiply(scene.q_camera_from_target_wxyz, quat_from_rotvec(turn))
    pose = Pose.of("camera", "target", q, np.asarray(scene.t_camera_from_target_m) + off)
    return scene_with_pose(scene, target, pose, k)


class _Asked:
    """A flight of a recipe, told apart by what it depends on."""

    def __init__(self, recipe: Recipe, target: str, seed: int, number: int) -> None:
        self.recipe, self.target, self.seed, self.number = recipe, target, seed, number
        self._key = (msgspec.json.encode(recipe), target, seed, number)

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Asked) and self._key == other._key


@lru_cache(maxsize=2)
def _trajectory(asked: _Asked) -> Plan:
    """The one flight of a recipe about a trajectory."""
    poses = asked.recipe.poses
    if not isinstance(poses, AboutTrajectory):
        raise TypeError("poses are about no trajectory")
    return _as_seen(_template(poses.scenario, asked), asked)


@lru_cache(maxsize=8)
def _sequence(asked: _Asked) -> Plan:
    """The flight of one sequence: its own start, attitude and rate."""
    poses = asked.recipe.poses
    if not isinstance(poses, Sequences):
        raise TypeError("poses are no sequences")
    rng = numbered_generator(asked.seed, asked.number, _SEQUENCES)
    scenario = _template(poses.scenario, asked)
    distance, rate = float(rng.uniform(*poses.range_m)), float(rng.uniform(*poses.rate_deg_s))
    attitude = msgspec.structs.replace(
        scenario.attitude,
        q_wxyz=tuple(float(x) for x in uniform_attitude(rng)),
        euler_deg=None,
        rate_deg_s=vec3(rate * uniform_direction(rng)),
    )
    chaser = _started_at(scenario.chaser, distance, f"recipe {asked.recipe.name}: scenario {poses.scenario}")
    duration = poses.every_s * (poses.frames - 1)
    scenario = msgspec.structs.replace(
        scenario, attitude=attitude, chaser=chaser, duration_s=duration, burns=[]
    )
    for _ in range(_MOST_STARTS):
        if isinstance(scenario.orbit, ElementsOrbit):
            place = float(rng.uniform(0.0, 360.0))
            scenario = msgspec.structs.replace(
                scenario, orbit=msgspec.structs.replace(scenario.orbit, true_anomaly_deg=place)
            )
        plan = _as_seen(scenario, asked)
        lit = all(plan.shifted((t,)).scene(0).sun_visible_fraction > _LIT for t in (0.0, duration))
        if lit or not poses.sunlit:
            return plan
    raise UserError(
        f"recipe {asked.recipe.name}: no start of scenario {poses.scenario} leaves {duration:g} s of sunlight: take "
        "fewer frames, or set sunlit = false in [poses]"
    )


def _started_at(chaser: AnyChaser, distance_m: float, where: str) -> AnyChaser:
    """The chaser's way from another distance along the line from the target to its start."""
    for key in ("position_lvlh_m", "start_lvlh_m"):
        start = getattr(chaser, key, None)
        if start is not None and np.any(start):
            place = np.asarray(start, float) * (distance_m / np.linalg.norm(start))
            return msgspec.structs.replace(chaser, **{key: vec3(place)})
    start = getattr(chaser, "start_m", None)
    if start:
        return msgspec.structs.replace(chaser, start_m=float(np.copysign(distance_m, start)))
    raise UserError(
        f"{where}: its chaser has no start to bring to range_m of [poses]; name a scenario that has (mode hold, drift, "
        "keep_range, vbar, rbar, glideslope)"
    )


def _template(name: str, asked: _Asked) -> Scenario:
    try:
        return load_scenario(name)
    except UserError as error:
        raise UserError(f"recipe {asked.recipe.name}: section [poses]: {error}") from error


def _as_seen(scenario: Scenario, asked: _Asked) -> Plan:
    """The flight with the recipe's target, camera, sensor, optics and layers."""
    r = asked.recipe
    seen = msgspec.structs.replace(
        scenario,
        target=asked.target,
        camera=r.camera,
        sensor=r.sensor,
        optics=r.optics,
        environment=r.environment,
        lamp=r.lamp,
        lights=r.lights,
    )
    return plan_flight(seen, times=(0.0,), seed=asked.seed)
