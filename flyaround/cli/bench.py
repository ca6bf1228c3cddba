"""bench: frame cost per scene, and every other part; each folder times itself, and this composes them."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from flyaround.cli.terminal import progress_bar, terminal
from flyaround.hil.bench.estimator_time import bench_estimator
from flyaround.hil.bench.link_latency import bench_link
from flyaround.simulator.bench.combinations import bench_combinations, goals_of
from flyaround.simulator.bench.combinations_page import combinations_page
from flyaround.simulator.bench.parts import bench_capture, bench_sensor, bench_world
from flyaround.simulator.bench.scaling import bench_scaling
from flyaround.simulator.bench.scenes import BENCH_SCENES, bench_scenes
from flyaround.simulator.bench.start import bench_start
from flyaround.simulator.bench.throughput import THROUGHPUT_SCENES, bench_throughput
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import write_atomic

if TYPE_CHECKING:
    from collections.abc import Callable


def bench(
    frames: Annotated[int, typer.Option("-n", min=3, help="Frames timed per scene.")] = 20,
    scene: Annotated[list[str] | None, typer.Option(help="Only these scenes (repeat the option).")] = None,
    scaling: Annotated[
        bool,
        typer.Option(
            "--scaling", help="Instead: cost against pixels, and against triangles up to a million."
        ),
    ] = False,
    processes: Annotated[
        int | None,
        typer.Option(
            min=1, max=64, help="Instead: frames a second of 1, 2, 4 ... so many processes that draw at once."
        ),
    ] = None,
    everything: Annotated[
        bool,
        typer.Option(
            "--all",
            help="Instead: every built-in scenario x camera x mono and RGB, with labels and capture, and the goals; "
            "half an hour.",
        ),
    ] = False,
    page: Annotated[
        Path | None, typer.Option("--page", help="With --all: also write the tables to this Markdown file.")
    ] = None,
    gpu: Annotated[int | None, typer.Option("--gpu", help="EGL device to draw on.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Frame cost per scene beside a reference pass of the same run."""
    if scaling + (processes is not None) + everything > 1:
        raise UserError("--scaling, --processes and --all are three benches; ask for one of them")
    if page is not None and not (everything and page.parent.is_dir()):
        raise UserError(f"--page {page} goes with --all, into a folder that exists")
    if everything:
        _bench_combinations(tuple(scene or ()), gpu, page, as_json=as_json)
        return
    if scaling:
        _bench_scaling(gpu, as_json=as_json)
        return
    if processes is not None:
        _bench_throughput(processes, tuple(scene or ()), gpu, as_json=as_json)
        return
    with progress_bar("bench", quiet=as_json) as progress:
        document = _run_bench(n_frames=frames, scenes=tuple(scene or ()), device_index=gpu, progress=progress)
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


def _bench_scaling(gpu: int | None, *, as_json: bool) -> None:
    with progress_bar("bench", quiet=as_json) as progress:
        found = bench_scaling(device_index=gpu, progress=progress)
    if as_json:
        typer.echo(json.dumps({"schema": "flyaround.scaling", "version": 1, **asdict(found)}, indent=1))
        return
    for what, costs, powers in (
        ("Earth behind Tango", found.by_pixels, found.pixel_powers),
        ("dimpled sphere before space", found.by_triangles, found.triangle_powers),
    ):
        table = Table(
            "pixels", "triangles", "processor ms", "wall ms", "first frame s", "grows as", title=what
        )
        for cost, power in zip(costs, (None, *powers), strict=True):
            table.add_row(
                f"{cost.pixels:,}",
                f"{cost.triangles:,}",
                f"{cost.cpu_ms:.0f}",
                f"{cost.wall_ms:.0f}",
                f"{cost.first_ms / 1e3:.1f}",
                "" if power is None else f"power {power:.2f}",
            )
        terminal().print(table)


def _bench_combinations(
    scenarios: tuple[str, ...], gpu: int | None, page: Path | None, *, as_json: bool
) -> None:
    with progress_bar("bench", quiet=as_json) as progress:
        machine, costs = bench_combinations(scenarios, device_index=gpu, progress=progress)
    if page is not None:
        chosen = "".join(f" --scene {name}" for name in scenarios)
        write_atomic(page, combinations_page(machine, costs, f"flyaround bench --all{chosen}").encode())
    goals = goals_of(costs)
    if as_json:
        document = {
            "schema": "flyaround.combinations",
            "version": 1,
            "machine": asdict(machine),
            "combinations": [asdict(c) for c in costs],
            "goals": [{**asdict(g), "met": g.met} for g in goals],
        }
        typer.echo(json.dumps(document, indent=1))
        return
    columns = ("frame_ms", "render_ms", "sensor_ms", "labels_ms", "capture_ms", "reference_ms")
    table = Table("scenario", "camera", "bands", *(name.removesuffix("_ms") for name in columns))
    for c in costs:
        name = f"{c.scenario} {c.variant}".strip()
        table.add_row(name, c.camera, c.bands, *(f"{getattr(c, key):.1f}" for key in columns))
    console = terminal()
    console.print(f"{machine.gl_renderer}, {machine.threads} threads; medians in ms")
    console.print(table)
    table = Table("goal", "measured", "at most", "", "worst")
    for g in goals:
        table.add_row(
            g.name,
            f"{g.measured:.2f} {g.unit}",
            f"{g.limit:g} {g.unit}",
            "met" if g.met else "missed",
            g.worst,
        )
    console.print(table)


def _bench_throughput(processes: int, scenes: tuple[str, ...], gpu: int | None, *, as_json: bool) -> None:
    _check_scenes(scenes)
    with progress_bar("bench", quiet=as_json) as progress:
        machine, rates = bench_throughput(
            scenes or THROUGHPUT_SCENES, most=processes, device_index=gpu, progress=progress
        )
    if as_json:
        document = {
            "schema": "flyaround.throughput",
            "version": 1,
            "machine": asdict(machine),
            "rates": [asdict(r) for r in rates],
        }
        typer.echo(json.dumps(document, indent=1))
        return
    table = Table("scene", "processes", "frames/s", "reference ms")
    for rate in rates:
        table.add_row(
            f"{rate.name} {rate.width_px}x{rate.height_px}",
            str(rate.processes),
            f"{rate.frames_per_s:.1f}",
            f"{rate.reference_ms:.1f}",
        )
    console = terminal()
    console.print(f"{machine.gl_renderer}, {machine.threads} processors")
    console.print(table)


def _run_bench(
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
    _check_scenes(scenes)
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


def _check_scenes(names: tuple[str, ...]) -> None:
    """Raise ``UserError`` where a scene is not one of the bench's."""
    for name in names:
        if name not in BENCH_SCENES:
            raise UserError(f"unknown bench scene '{name}' in --scene; choose from {', '.join(BENCH_SCENES)}")
