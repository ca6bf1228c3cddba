"""Frame time of each built-in bench scene, next to a reference pass of the same run."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.errors import UserError
from flyaround.simulator.frame import take_frame
from flyaround.simulator.labels.request import LAYERS, LabelRequest
from flyaround.simulator.labels.truth import FlowLabel
from flyaround.simulator.render.reference_pass import ReferencePass
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from flyaround.simulator.scenario.plan import Plan
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

BENCH_SCENES = (
    "tango-earth-10m",
    "tango-earth-10m-1024",
    "tango-space-10m",
    "tango-limb",
    "tango-night",
    "tango-close-3m",
    "tango-earth-10m-1024+rgb",
    "tango-earth-10m-1024+blur",
    "tango-space-10m+1024",
    "tango-close-3m+1024",
)
"""Built-in scenarios; ``+rgb``: three bands, ``+blur``: ground motion of half a pixel, ``+1024``: 1024 x 1024
pixels.
"""

SQUARE_CAMERA = "square-1024"

# Exposure time of the scene with motion blur [s].
BLUR_EXPOSURE_S = 0.02
BLOCK = 5  # frames between two reference passes, so that both see the same machine load

# Number of reference passes per block of frames.
REFERENCE_LAPS = 2

# Number of frames whose stages are timed, and of frames with labels, odd for a median.
TIMED_FRAMES = 7
LABELLED_FRAMES = 5


@dataclass(frozen=True, kw_only=True)
class SceneCost:
    """Time per frame of one scene [ms]: in total (render, read-back, sensor), and by part.

    Pass times are measured on frames that wait for the driver after each pass, so they add up to more than the total.
    ``labels_ms_p50`` is the cost of truth, mask and all layers; ``labelled_over_plain`` is the ratio of a frame with
    them to one without.
    """

    name: str
    width_px: int
    height_px: int
    bands: str
    frame_ms_p50: float
    frame_ms_p95: float
    render_ms_p50: float
    sensor_ms_p50: float
    readback_ms_p50: float
    passes_ms_p50: dict[str, float]
    labels_ms_p50: float
    labelled_over_plain: float
    reference_ms: float


@dataclass(frozen=True, kw_only=True)
class BenchMachine:
    """Machine and driver of a bench."""

    gl_renderer: str
    gl_version: str
    threads: int


def bench_scenes(
    names: tuple[str, ...] = BENCH_SCENES,
    *,
    n_frames: int = 20,
    device_index: int | None = None,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> tuple[BenchMachine, tuple[SceneCost, ...]]:
    """Time scenes without labels, one frame after the other in one process.

    Frames are timed without waits between the passes; the passes' own times come from other frames, which wait for the
    driver after each. The reference pass runs between the frames, at each scene's size, so that results from different
    machines compare.

    Returns
    -------
    machine : BenchMachine
        Driver of the renderer, and the number of usable processors.
    costs : tuple of SceneCost
        Costs in the order of ``names``.
    """
    costs = []
    with (
        ReferencePass(device_index=device_index) as reference,
        Renderer(device_index=device_index) as renderer,
    ):
        for done, name in enumerate(names):
            costs.append(_bench_one(renderer, reference, name, n_frames))
            progress(done + 1, len(names))
        machine = bench_machine(renderer)
    return machine, tuple(costs)


def check_scenes(names: Sequence[str]) -> None:
    """Raise if a scene is not one of the bench's.

    Raises
    ------
    UserError
        If one is not; the message lists the scenes.
    """
    for name in names:
        if name not in BENCH_SCENES:
            raise UserError(f"unknown bench scene '{name}' in --scene; choose from {', '.join(BENCH_SCENES)}")


def bench_machine(renderer: Renderer) -> BenchMachine:
    """Describe the machine and driver of a renderer.

    Returns
    -------
    BenchMachine
        Driver's name and version, and the number of processors that this process may run on.
    """
    info = renderer.info
    return BenchMachine(
        gl_renderer=info.renderer, gl_version=info.version, threads=len(os.sched_getaffinity(0))
    )


def bench_views(name: str, n_frames: int) -> tuple[Plan, tuple[SceneState, ...]]:
    """Plan consecutive, different frames around the middle of a scenario.

    Returns
    -------
    plan : Plan
        Flight with the camera of the variant that follows ``+`` in the name.
    scenes : tuple of SceneState
        ``n_frames`` scenes, 0.05 s apart, with the bands and exposure of the variant.
    """
    scenario_name, _, variant = name.partition("+")
    scenario = load_scenario(scenario_name)
    times = tuple(scenario.duration_s / 2 + 0.05 * k for k in range(n_frames))
    plan = plan_flight(scenario, times=times)
    if variant == "1024":
        plan = replace(plan, camera=load_camera(SQUARE_CAMERA))
    scenes = tuple(replace(plan.scene(k), frame_index=k) for k in range(n_frames))
    if variant == "rgb":
        scenes = tuple(replace(scene, bands="rgb") for scene in scenes)
    if variant == "blur":
        # same exposure for the smaller image
        scenes = tuple(
            replace(
                scene,
                exposure_s=BLUR_EXPOSURE_S,
                sensor=replace(
                    scene.sensor,
                    full_scale_j_m2_sr=scene.sensor.full_scale_j_m2_sr * BLUR_EXPOSURE_S / scene.exposure_s,
                ),
            )
            for scene in scenes
        )
    return plan, scenes


def _bench_one(renderer: Renderer, reference: ReferencePass, name: str, n_frames: int) -> SceneCost:
    blocks = -(-n_frames // BLOCK)
    # one more frame in each block: the first after the reference pass has cold caches
    plan, scenes = bench_views(name, n_frames + blocks)
    size = (plan.camera.width_px, plan.camera.height_px)
    laps, reference_laps, rows = [], [], []
    for scene in scenes[:2]:
        take_frame(renderer, scene, plan.target, labels=False)
    for first in range(0, len(scenes), BLOCK + 1):
        reference_laps += reference.laps_ms(size, REFERENCE_LAPS)
        for k, scene in enumerate(scenes[first : first + BLOCK + 1]):
            start = time.perf_counter()
            frame = take_frame(renderer, scene, plan.target, labels=False)
            if k > 0:
                laps.append((time.perf_counter() - start) * 1e3)
                rows.append(frame.stage_ms)
    renderer.timed = True
    timed = [
        take_frame(renderer, scene, plan.target, labels=False).stage_ms for scene in scenes[:TIMED_FRAMES]
    ]
    renderer.timed = False
    labels_ms, labelled = labels_cost(renderer, plan.target, scenes, min(n_frames, LABELLED_FRAMES))
    passes = {key: float(np.median([r.get(key, 0.0) for r in timed])) for key in timed[0]}
    return SceneCost(
        name=name,
        width_px=size[0],
        height_px=size[1],
        bands=scenes[0].bands,
        frame_ms_p50=float(np.percentile(laps, 50)),
        frame_ms_p95=float(np.percentile(laps, 95)),
        render_ms_p50=float(np.median([r["render"] for r in rows])),
        sensor_ms_p50=float(np.median([r["sensor"] for r in rows])),
        readback_ms_p50=passes.get("render.readback", 0.0),
        passes_ms_p50=passes,
        labels_ms_p50=labels_ms,
        labelled_over_plain=labelled,
        reference_ms=float(np.median(reference_laps)),
    )


def labels_cost(
    renderer: Renderer, target: Target, scenes: Sequence[SceneState], n_frames: int
) -> tuple[float, float]:
    """Return the median time that truth, mask and all layers add to a frame [ms], and the ratio with to without.

    Parameters
    ----------
    renderer : Renderer
        Renderer of the images.
    target : Target
        Target model.
    scenes : sequence of SceneState
        At least two; the optical flow of each leads to the next one.
    n_frames : int
        Number of frames to time.

    Returns
    -------
    tuple of float
        Time [ms], and ratio.
    """
    added_ms, ratios = [], []
    for k in range(n_frames + 1):
        scene, following = scenes[k % (len(scenes) - 1)], scenes[k % (len(scenes) - 1) + 1]
        flow = FlowLabel(
            t_s=following.t_s,
            q_camera_from_target_wxyz=following.q_camera_from_target_wxyz,
            t_camera_from_target_m=following.t_camera_from_target_m,
        )
        costs = []
        for request in (False, LabelRequest(layers=LAYERS, flow=flow)):
            start = time.perf_counter()
            take_frame(renderer, scene, target, labels=request)
            costs.append((time.perf_counter() - start) * 1e3)
        if k > 0:  # the first frame uploads and compiles
            added_ms.append(costs[1] - costs[0])
            ratios.append(costs[1] / costs[0])
    return float(np.median(added_ms)), float(np.median(ratios))
