"""Cost of a frame by the pixels of the image, and by the triangles of a generated mesh, up to a million."""

from __future__ import annotations

import hashlib
import time
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.frame import take_frame
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.scene.state import TargetRef
from flyaround.simulator.targets.model import MassProperties, Material, Part, Target

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.simulator.scene.state import SceneState

TRIANGLES = (20_000, 80_000, 320_000, 1_000_000)  # numbers of triangles of the generated mesh
SCALES = (0.25, 0.5, 1.0)  # share of the width: 480 to 1920 pixels
FRAMES = 4  # timed frames per size
PIXEL_SCENE, TRIANGLE_SCENE = "tango-earth-10m", "tango-space-10m"


@dataclass(frozen=True, kw_only=True)
class Cost:
    """Cost of one frame at one size [ms]: processor time of all threads, and wall time; the minimum of several frames.

    ``first_ms`` is the time of the first frame, which builds and uploads the mesh's tables.
    """

    pixels: int
    triangles: int
    cpu_ms: float
    wall_ms: float
    first_ms: float


@dataclass(frozen=True, kw_only=True)
class Scaling:
    """Costs of one frame by size, and exponents of their growth between neighbouring sizes: 1 is linear.

    Parameters
    ----------
    by_pixels : tuple of Cost
        The Earth behind Tango at increasing sizes.
    by_triangles : tuple of Cost
        A craft of increasing meshes in front of space.
    pixel_powers : tuple of float
        Exponents of the growth with the number of pixels.
    triangle_powers : tuple of float
        Exponents of the growth with the number of triangles.
    by_wall : bool
        True if the exponents are those of the wall time, because a GPU's work takes no processor time.
    """

    by_pixels: tuple[Cost, ...]
    by_triangles: tuple[Cost, ...]
    pixel_powers: tuple[float, ...]
    triangle_powers: tuple[float, ...]
    by_wall: bool


def bench_scaling(
    *,
    device_index: int | None = None,
    triangles: tuple[int, ...] = TRIANGLES,
    scales: tuple[float, ...] = SCALES,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> Scaling:
    """Measure the costs by pixels and by triangles in one process, with the sensor model and without labels."""
    total = len(scales) + len(triangles)
    by_pixels, by_triangles = [], []
    with Renderer(device_index=device_index) as renderer:
        by_wall = not renderer.info.is_software
        plan = plan_flight(load_scenario(PIXEL_SCENE), n=1)
        for scale in scales:
            scene = replace(plan.scene(0), camera=plan.camera.resized(round(plan.camera.width_px * scale)))
            by_pixels.append(_cost(renderer, scene, plan.target))
            progress(len(by_pixels), total)
        plan = plan_flight(load_scenario(TRIANGLE_SCENE), n=1)
        for count in triangles:
            craft = dimpled_sphere(count)
            scene = replace(plan.scene(0), target=TargetRef(name=craft.name, sha256=craft.sha256))
            by_triangles.append(_cost(renderer, scene, craft))
            progress(len(by_pixels) + len(by_triangles), total)
    return Scaling(
        by_pixels=tuple(by_pixels),
        by_triangles=tuple(by_triangles),
        pixel_powers=_powers([(c.pixels, c.wall_ms if by_wall else c.cpu_ms) for c in by_pixels]),
        triangle_powers=_powers([(c.triangles, c.wall_ms if by_wall else c.cpu_ms) for c in by_triangles]),
        by_wall=by_wall,
    )


def dimpled_sphere(triangles: int) -> Target:
    """Return a target of about ``triangles`` triangles: a smooth sphere of 0.5 m with dimples."""
    rings = max(round((triangles / 4) ** 0.5), 4)
    n_around = 2 * rings
    polar, azimuth = (
        a.ravel() for a in np.mgrid[0 : np.pi : (rings + 1) * 1j, 0 : 2 * np.pi : (n_around + 1) * 1j]
    )
    out = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], -1)
    radius = 0.5 + 0.01 * np.sin(12 * polar) * np.cos(12 * azimuth)
    k = (np.arange(rings)[:, None] * (n_around + 1) + np.arange(n_around)).ravel()
    below = k + n_around + 1
    upper = np.stack([k, below, k + 1], -1)[n_around:]  # at the poles a cell is one triangle
    lower = np.stack([k + 1, below, below + 1], -1)[:-n_around]
    faces = np.concatenate([upper, lower])
    points = (radius[:, None] * out).astype(np.float32)
    part = Part(
        name="body",
        material="paint",
        positions_m=points,
        normals=out.astype(np.float32),
        triangles=faces.astype(np.int64),
    )
    return Target(
        name="dimpled-sphere",
        title=f"a dimpled sphere of {len(faces)} triangles",
        sha256=hashlib.sha256(points.tobytes()).hexdigest(),
        materials=(Material(name="paint", base_color=(0.6, 0.6, 0.6), roughness=0.6),),
        parts=(part,),
        keypoints=(),
        wireframe=(),
        mass=MassProperties(mass_kg=50.0, com_m=(0, 0, 0), inertia_kg_m2=((5, 0, 0), (0, 5, 0), (0, 0, 5))),
    )


def _cost(renderer: Renderer, scene: SceneState, target: Target) -> Cost:
    start = time.perf_counter()
    take_frame(renderer, scene, target, labels=False)
    first = time.perf_counter() - start
    cpu, wall = [], []
    for k in range(FRAMES):
        c, w = time.process_time(), time.perf_counter()
        take_frame(renderer, replace(scene, frame_index=k + 1), target, labels=False)
        cpu.append(time.process_time() - c)
        wall.append(time.perf_counter() - w)
    return Cost(
        pixels=scene.camera.width_px * scene.camera.height_px,
        triangles=sum(len(part.triangles) for part in target.parts),
        cpu_ms=1e3 * min(cpu),
        wall_ms=1e3 * min(wall),
        first_ms=1e3 * first,
    )


def _powers(costs: list[tuple[int, float]]) -> tuple[float, ...]:
    """Return the exponents by which the second number grows with the first, between neighbouring entries."""
    return tuple(float(np.log(b[1] / a[1]) / np.log(b[0] / a[0])) for a, b in pairwise(costs))
