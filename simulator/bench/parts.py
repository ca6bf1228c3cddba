"""Milliseconds of the parts that are not pictures: the world's step, and a captured frame with its labels."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from simulator.dataset.capture import capture
from simulator.loop import plan_flight
from simulator.scenario_load import load_scenario

SCENARIO = "tango-flyaround"
N_STATES = 200
N_CAPTURED = 4


@dataclass(frozen=True, kw_only=True)
class PartCost:
    """Cost of one operation of a part [ms]."""

    name: str
    ms_p50: float
    ms_p95: float


def cost(name: str, laps_ms: list[float]) -> PartCost:
    """Median and 95th percentile of measured laps."""
    return PartCost(
        name=name, ms_p50=float(np.percentile(laps_ms, 50)), ms_p95=float(np.percentile(laps_ms, 95))
    )


def bench_world() -> tuple[PartCost, ...]:
    """Propagating a minute's flight, and one scene of it."""
    laps = []
    for _ in range(5):
        start = time.perf_counter()
        plan = plan_flight(load_scenario(SCENARIO), n=N_STATES)
        laps.append((time.perf_counter() - start) * 1e3)
    scenes = []
    for k in range(N_STATES):
        start = time.perf_counter()
        plan.scene(k)
        scenes.append((time.perf_counter() - start) * 1e3)
    return (cost("propagate a minute", laps), cost("state and scene of one frame", scenes))


def bench_capture() -> tuple[PartCost, ...]:
    """A frame with all labels, checked and written."""
    laps: list[float] = []
    last = 0.0

    def lap(done: int, _of: int) -> None:
        nonlocal last
        now = time.perf_counter()
        if done > 1:
            laps.append((now - last) * 1e3)
        last = now

    with TemporaryDirectory() as folder:
        plan = plan_flight(load_scenario(SCENARIO), n=N_CAPTURED)
        capture(plan, Path(folder) / "set", progress=lap)
    return (cost("labelled frame, checked and written", laps),)
