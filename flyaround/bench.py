"""The bench of every part, composed: each folder times itself."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from hil.evaluate.bench import bench_estimator
from hil.host.bench import bench_link
from simulator.bench.parts import bench_capture, bench_world
from simulator.bench.scenes import BENCH_SCENES, bench_scenes
from simulator.bench.sensor import bench_sensor
from simulator.bench.start import bench_start
from simulator.errors import UserError

if TYPE_CHECKING:
    from collections.abc import Callable


def run_bench(
    *,
    n_frames: int,
    scenes: tuple[str, ...],
    device_index: int | None,
    progress: Callable[[int, int], None],
) -> dict[str, Any]:
    """Time scenes, start-up, world, sensors, link, estimator and capture; the document of ``bench --json``.

    Raises
    ------
    UserError
        If a scene is not one of the bench's.
    """
    check_scenes(scenes)
    machine, costs = bench_scenes(
        scenes or BENCH_SCENES, n_frames=n_frames, device_index=device_index, progress=progress
    )
    parts = scenes == ()
    return {
        "schema": "flyaround.bench",
        "version": 1,
        "machine": asdict(machine),
        "scenes": [asdict(c) for c in costs],
        "start": [asdict(p) for p in bench_start()] if parts else [],
        "world": [asdict(p) for p in bench_world()] if parts else [],
        "sensor": [asdict(p) for p in bench_sensor()] if parts else [],
        "link": [asdict(p) for p in bench_link()] if parts else [],
        "estimator": [asdict(p) for p in bench_estimator()] if parts else [],
        "capture": [asdict(p) for p in bench_capture()] if parts else [],
    }


def check_scenes(names: tuple[str, ...]) -> None:
    """Raise ``UserError`` where a scene is not one of the bench's."""
    for name in names:
        if name not in BENCH_SCENES:
            raise UserError(f"unknown bench scene '{name}' in --scene; choose from {', '.join(BENCH_SCENES)}")
