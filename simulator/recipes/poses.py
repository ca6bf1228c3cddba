"""Random poses of a recipe: depth, then attitude, then position in the image."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.recipes.board_poses import board_pose
from flyaround.simulator.recipes.euler_poses import from_left_handed, quat_from_euler, to_left_handed
from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.scenario.random_draws import uniform_attitude
from flyaround.simulator.scenario.recipe import (
    BoundsPlacement,
    EulerAttitude,
    FacingAttitude,
    InverseRange,
    NormalPlacement,
    NormalRange,
    ScaledRange,
    UniformRange,
)
from flyaround.simulator.scene.sample import RawPose

if TYPE_CHECKING:
    from numpy.random import Generator

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scenario.recipe import AnyPlacement, AnyRange, Recipe
    from flyaround.simulator.targets.model import Target

# Maximum number of draws until a pose meets all conditions.
MAX_DRAWS = 10_000

TANGO_SIZE_M = 0.80320
"""Half the diagonal of Tango's bounding box."""


@dataclass(frozen=True, eq=False)
class DrawnPose:
    """A random pose of the target relative to the camera; ``raw`` holds its Euler angles, if it was drawn as such."""

    q_camera_from_target_wxyz: FloatArray
    t_camera_from_target_m: FloatArray
    raw: RawPose | None = None


def draw_pose(rng: Generator, recipe: Recipe, camera: Camera, target: Target, k: int) -> DrawnPose:
    """Draw one pose from a recipe's range, attitude and placement.

    Parameters
    ----------
    rng : Generator
        Random generator.
    recipe : Recipe
        Recipe with the ranges.
    camera : Camera
        Camera of the image.
    target : Target
        Target model.
    k : int
        Number of the sample, which selects the cell of a board.

    Raises
    ------
    UserError
        If the recipe's bounds are empty.
    """
    attitude = recipe.attitude
    if isinstance(attitude, FacingAttitude):
        return DrawnPose(*board_pose(rng, camera, target, k, attitude.within_deg))
    z = _depth_m(rng, recipe.range, target)
    if isinstance(attitude, EulerAttitude):
        angles = rng.uniform(attitude.from_deg, attitude.to_deg, 3)
        q_raw = quat_from_euler(angles)
        q = from_left_handed(q_raw)
        t = _translation_m(rng, recipe.placement, camera, target, z)
        position = t * (1.0, -1.0, 1.0)
        raw = RawPose(position_m=vec3(position), euler_deg=vec3(angles), q_wxyz=quat(q_raw))
        return DrawnPose(q if q[0] >= 0 else -q, t, raw)
    q = uniform_attitude(rng)
    return DrawnPose(q, _translation_m(rng, recipe.placement, camera, target, z))


def resolve_range(kind: AnyRange, target: Target) -> AnyRange:
    """Replace a ``scaled`` range by the bounds for the target.

    Returns
    -------
    AnyRange
        A `UniformRange` [m] for a scaled range; any other as given.
    """
    if not isinstance(kind, ScaledRange):
        return kind
    near, far = scaled_range_m(target, (kind.near_m, kind.far_m))
    return UniformRange(near_m=near, far_m=far)


def scaled_range_m(target: Target, tango_m: tuple[float, float] = (3.0, 18.0)) -> tuple[float, float]:
    """Return the ranges at which a target appears as large as Tango at two ranges [m], by the extent of its mesh."""
    corners = np.concatenate([(p.positions_m.min(axis=0), p.positions_m.max(axis=0)) for p in target.parts])
    size_m = float(np.linalg.norm(np.ptp(corners.astype(float), axis=0))) / 2
    near, far = (round(r * size_m / TANGO_SIZE_M, 3) for r in tango_m)
    return near, far


@lru_cache(maxsize=8)
def radius_m(target: Target) -> float:
    """Return the distance of the mesh's farthest vertex from the model's origin.

    Returns
    -------
    float
        Distance [m].
    """
    return float(max(np.linalg.norm(p.positions_m, axis=1).max() for p in target.parts))


def _depth_m(rng: Generator, kind: AnyRange, target: Target) -> float:
    kind = resolve_range(kind, target)
    if isinstance(kind, InverseRange):
        return 1 / float(rng.uniform(1 / kind.far_m, 1 / kind.near_m))
    if isinstance(kind, NormalRange):
        for _ in range(MAX_DRAWS):
            z = float(rng.normal(kind.mean_m, kind.sigma_m))
            if kind.near_m <= z <= kind.far_m:
                return z
        raise UserError(
            f"section [range]: no draw from the normal of mean_m {kind.mean_m:g} and sigma_m {kind.sigma_m:g} is "
            f"between near_m {kind.near_m:g} and far_m {kind.far_m:g}: widen one of them"
        )
    return float(rng.uniform(kind.near_m, kind.far_m))


def _translation_m(
    rng: Generator, kind: AnyPlacement, camera: Camera, target: Target, z: float
) -> FloatArray:
    """Draw the position of the model's origin at depth z, camera axes."""
    if isinstance(kind, BoundsPlacement):
        # equation 1 of Hematulin et al. (2025): the field of view grows in proportion to the depth
        x_max, y_max = kind.x_m / kind.at_m * z, kind.y_m / kind.at_m * z
        x, y_up = rng.uniform(-x_max, x_max), rng.uniform(-y_max, y_max)
        return np.asarray(to_left_handed(np.array([x, y_up, z])), float)
    size = np.array([camera.width_px, camera.height_px])
    middle = (size - 1) / 2
    if isinstance(kind, NormalPlacement):
        for _ in range(MAX_DRAWS):
            offset = rng.normal(0.0, kind.sigma, 2) if kind.sigma else np.zeros(2)
            if np.abs(offset).max() <= 1:
                return _at(camera, middle + offset * size / 2, z)
        raise RuntimeError("fewer than one in ten thousand normal draws falls within the bounds")
    radius_px = np.array([camera.fx_px, camera.fy_px]) * radius_m(target) / z
    slack = np.maximum(size / 2 - radius_px, 0)
    return _at(camera, middle + rng.uniform(-1, 1, 2) * slack, z)


def _at(camera: Camera, pixel: FloatArray, z: float) -> FloatArray:
    """Return the point at depth z that an undistorted camera sees at a pixel."""
    x = (pixel[0] - camera.cx_px) / camera.fx_px * z
    y = (pixel[1] - camera.cy_px) / camera.fy_px * z
    return np.array([x, y, z])
