"""Milliseconds per frame of each built-in bench scene, beside a reference pass of the same run."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from simulator.labels.frame import take_frame
from simulator.loop import plan_flight
from simulator.render.reference_pass import reference_pass_ms
from simulator.render.renderer import Renderer
from simulator.scenario_load import load_scenario

if TYPE_CHECKING:
    from collections.abc import Callable

BENCH_SCENES = (
    "tango-earth-10m",
    "tango-earth-10m-1024",
    "tango-space-10m",
    "tango-limb",
    "tango-night",
    "tango-close-3m",
)
WARM_UP = 3


@dataclass(frozen=True, kw_only=True)
class SceneCost:
    """Cost of one scene [ms]: the whole frame (render, read-back, sensor) and its parts."""

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
    reference_ms: float


@dataclass(frozen=True, kw_only=True)
class BenchMachine:
    """What drew."""

    gl_renderer: str
    gl_version: str
    threads: int


def bench_scenes(
    names: tuple[str, ...] = BENCH_SCENES,
    *,
    n_frames: int = 20,
    device_index: int | None = None,
    progress: Callable[[int, int], None] = lambda _done, _of: None,
) -> tuple[BenchMachine, tuple[SceneCost, ...]]:
    """Time scenes without labels, frames taken one after the other in one process.

    The reference pass is timed in the same run at each scene's size, so that figures from different machines
    compare.
    """
    cameras = {name: load_scenario(name).camera_model for name in names}
    sizes = {(c.width_px, c.height_px) for c in cameras.values()}
    reference = reference_pass_ms(sorted(sizes), device_index=device_index)
    costs = []
    with Renderer(device_index=device_index, timed=True) as renderer:
        for done, (name, camera) in enumerate(cameras.items()):
            costs.append(_bench_one(renderer, name, n_frames, reference[camera.width_px, camera.height_px]))
            progress(done + 1, len(names))
        info = renderer.info
    machine = BenchMachine(
        gl_renderer=info.renderer, gl_version=info.version, threads=len(os.sched_getaffinity(0))
    )
    return machine, tuple(costs)


def _bench_one(renderer: Renderer, name: str, n_frames: int, reference_ms: float) -> SceneCost:
    # a short span around the middle: neighbouring frames, all different
    scenario = load_scenario(name)
    middle = scenario.duration_s / 2
    times = tuple(middle + 0.05 * k for k in range(n_frames + WARM_UP))
    plan = plan_flight(scenario, times=times)
    total, rows = [], []
    for k in range(n_frames + WARM_UP):
        scene = replace(plan.scene(k), frame_index=k)
        start = time.perf_counter()
        frame = take_frame(renderer, scene, plan.target, labels=False)
        elapsed = (time.perf_counter() - start) * 1e3
        if k >= WARM_UP:
            total.append(elapsed)
            rows.append(frame.stage_ms)
    passes = {key: float(np.median([r[key] for r in rows])) for key in rows[0]}
    return SceneCost(
        name=name,
        width_px=plan.camera.width_px,
        height_px=plan.camera.height_px,
        bands=plan.bands,
        frame_ms_p50=float(np.percentile(total, 50)),
        frame_ms_p95=float(np.percentile(total, 95)),
        render_ms_p50=passes["render"],
        sensor_ms_p50=passes["sensor"],
        readback_ms_p50=passes.get("render.readback", 0.0),
        passes_ms_p50=passes,
        reference_ms=reference_ms,
    )
