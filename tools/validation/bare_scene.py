"""Minimal scene for validation: a target in front of the camera and the Sun in a given direction, nothing else."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.scene.environments import NOTHING
from flyaround.simulator.scene.state import Quality, SceneState, TargetRef
from flyaround.simulator.scene.viewpoint import scene_above
from flyaround.simulator.targets.model import MassProperties, Material, Part, Target
from flyaround.simulator.world.constants import AU_M
from flyaround.simulator.world.frames.rotation import matrix_from_quat, quat_from_rotvec, quat_normalize

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def bare_target(parts: list[Part], materials: list[Material]) -> Target:
    """Return a target of these parts, without labels."""
    digest = hashlib.sha256(repr(materials).encode())
    for part in parts:
        digest.update(part.positions_m.tobytes() + part.material.encode())
    return Target(
        name="test",
        title="test",
        sha256=digest.hexdigest(),
        materials=tuple(materials),
        parts=tuple(parts),
        keypoints=(),
        wireframe=(),
        mass=MassProperties(mass_kg=1.0, com_m=(0, 0, 0), inertia_kg_m2=((1, 0, 0), (0, 1, 0), (0, 0, 1))),
    )


def flat_plate(name: str, x: tuple[float, float], y: tuple[float, float], z: float) -> Part:
    """Return a rectangle with normal -z at depth ``z``."""
    corners = np.array([(x[0], y[0], z), (x[0], y[1], z), (x[1], y[1], z), (x[1], y[0], z)], np.float32)
    return Part(
        name=name,
        material="m",
        positions_m=corners,
        normals=np.tile(np.array([0, 0, -1], np.float32), (4, 1)),
        triangles=np.array([[0, 1, 2], [0, 2, 3]]),
    )


def ball(radius_m: float, n_around: int = 160) -> Part:
    """Return a smooth sphere about the origin."""
    down = n_around // 2
    a, b = np.meshgrid(np.linspace(0, 2 * np.pi, n_around + 1), np.linspace(0, np.pi, down + 1))
    n = np.stack([np.sin(b) * np.cos(a), np.sin(b) * np.sin(a), np.cos(b)], axis=-1).reshape(-1, 3)
    row, column = (q.ravel() for q in np.meshgrid(np.arange(down), np.arange(n_around), indexing="ij"))
    first = row * (n_around + 1) + column
    below = first + n_around + 1
    triangles = np.concatenate(
        [np.stack([first, below, below + 1], axis=1), np.stack([first, below + 1, first + 1], axis=1)]
    )
    return Part(
        name="ball",
        material="m",
        positions_m=(radius_m * n).astype(np.float32),
        normals=n.astype(np.float32),
        triangles=triangles,
    )


def square_camera(size_px: int, focal_px: float) -> Camera:
    """Return a square pinhole camera."""
    middle = (size_px - 1) / 2
    return Camera(
        width_px=size_px, height_px=size_px, fx_px=focal_px, fy_px=focal_px, cx_px=middle, cy_px=middle
    )


def bare_scene(
    target: Target,
    camera: Camera,
    t_m: ArrayLike,
    rotvec_rad: ArrayLike = (0.0, 0.0, 0.0),
    *,
    sun_camera: ArrayLike = (0.0, 0.0, -1.0),
    sunlit: bool = True,
    quality: Quality = "default",
) -> SceneState:
    """Return the scene of a target at a pose in the camera frame, sunlit from a direction in that frame."""
    ref = TargetRef(name=target.name, sha256=target.sha256)
    scene = scene_above(
        "2026-03-20T12:00:00Z",
        (0.0, 0.0, 500.0),
        camera=camera,
        target=ref,
        bands="mono",
        environment=NOTHING,
    )
    R = matrix_from_quat(scene.q_camera_from_eci_wxyz)
    t, sun = np.asarray(t_m, float), np.asarray(sun_camera, float)
    r_target = np.asarray(scene.r_camera_eci_m) + R.T @ t
    return replace(
        scene,
        quality=quality,
        t_camera_from_target_m=vec3(t),
        q_camera_from_target_wxyz=quat(quat_normalize(quat_from_rotvec(np.asarray(rotvec_rad, float)))),
        r_target_eci_m=vec3(r_target),
        r_sun_eci_m=vec3(r_target + R.T @ (sun / np.linalg.norm(sun)) * AU_M),
        sun_visible_fraction=float(sunlit),
    )
