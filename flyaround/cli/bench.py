"""bench: frame cost per scene, and the cost of every other part."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from flyaround.cli.run_options import with_run_options
from flyaround.cli.terminal import progress_bar, terminal
from flyaround.hil.bench.estimator_time import bench_estimator
from flyaround.hil.bench.link_latency import bench_link
from flyaround.runs.bench import BenchRun
from flyaround.simulator.bench.parts import bench_capture, bench_sensor, bench_world
from flyaround.simulator.bench.scenes import BENCH_SCENES, bench_scenes, check_scenes
from flyaround.simulator.bench.start import bench_start

if TYPE_CHECKING:
    from collections.abc import Callable


@with_run_options
def bench(
    run: BenchRun,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Measure the frame cost per scene and that of a reference pass of the same run."""
    with progress_bar("bench", quiet=as_json) as progress:
        document = _run_bench(n_frames=run.frames, scenes=run.scene, device_index=run.gpu, progress=progress)
    if as_json:
        typer.echo(json.dumps(document, indent=1))
        return
    table = Table("scene", "p50 ms", "p95", "render", "sensor", "read", "labels", "ref", "ratio")
    for s in document["scenes"]:
        table.add_row(
            f"{s['name']} {s['width_px']}x{s['height_px']}",
            *(
                f"{s[key]:.1f}"
                for key in (
                    "frame_ms_p50",
                    "frame_ms_p95",
                    "render_ms_p50",
                    "sensor_ms_p50",
                    "readback_ms_p50",
                    "labels_ms_p50",
                )
            ),
            f"{s['reference_ms']:.1f}",
            f"{s['frame_ms_p50'] / s['reference_ms']:.2f}",
        )
    console = terminal()
    console.print(f"{document['machine']['gl_renderer']}, {document['machine']['threads']} threads")
    console.print(table)
    for part in ("start", "world", "sensor", "link", "estimator", "capture"):
        for row in document[part]:
            memory = f", peak {row['peak_mb']:.0f} MB" if row.get("peak_mb") else ""
            kernels = f", kernels {row['kernels']}" if row.get("kernels") else ""
            console.print(
                f"{part}: {row['name']} p50 {row['ms_p50']:.3g} ms, p95 {row['ms_p95']:.3g} ms{memory}{kernels}"
            )


def _run_bench(
    *,
    n_frames: int,
    scenes: tuple[str, ...],
    device_index: int | None,
    progress: Callable[[int, int], None],
) -> dict[str, Any]:
    """Time scenes, start-up, world, sensors, link, estimator and capture; return the document of ``bench --json``.

    Raises
    ------
    UserError
        If a scene is unknown.
    """
    check_scenes(scenes)
    machine, costs = bench_scenes(
        scenes or BENCH_SCENES, n_frames=n_frames, device_index=device_index, progress=progress
    )
    parts = scenes == ()
    return {
        "schema": "flyaround.commands.bench",
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
