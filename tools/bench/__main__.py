"""``python -m tools.bench combinations | fixed | scaling | throughput``: the cost of rendering."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from flyaround.cli.terminal import progress_bar, terminal
from flyaround.simulator.bench.scenes import check_scenes
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import write_atomic
from tools.bench.combinations import bench_combinations, goals_of
from tools.bench.combinations_page import combinations_page
from tools.bench.fixed_cost import bench_fixed_cost
from tools.bench.scaling import bench_scaling
from tools.bench.throughput import THROUGHPUT_SCENES, bench_throughput

app = typer.Typer(help="Measure the cost of rendering a frame.")
Gpu = Annotated[int | None, typer.Option("--gpu", help="EGL device to draw on.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]


@app.command()
def scaling(*, gpu: Gpu = None, as_json: AsJson = False) -> None:
    """Measure the cost of a frame by its number of pixels and by the number of triangles, up to a million."""
    with progress_bar("bench", quiet=as_json) as progress:
        scaling_result = bench_scaling(device_index=gpu, progress=progress)
    if as_json:
        typer.echo(
            json.dumps({"schema": "flyaround.scaling", "version": 1, **asdict(scaling_result)}, indent=1)
        )
        return
    for kind, costs, powers in (
        ("Earth behind Tango", scaling_result.by_pixels, scaling_result.pixel_powers),
        ("dimpled sphere before space", scaling_result.by_triangles, scaling_result.triangle_powers),
    ):
        table = Table(
            "pixels", "triangles", "processor ms", "wall ms", "first frame s", "grows as", title=kind
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


@app.command()
def fixed(*, gpu: Gpu = None, as_json: AsJson = False) -> None:
    """Measure the cost of a frame apart from its pixels: processor time of the calling thread, and calls."""
    costs = bench_fixed_cost(gpu)
    if as_json:
        typer.echo(
            json.dumps({"schema": "flyaround.fixed-cost", "version": 1, "costs": [asdict(c) for c in costs]})
        )
        return
    table = Table("labels", "thread ms", "least", "in draw calls", "calls of Python functions", "all calls")
    for c in costs:
        times = (f"{c.thread_ms:.1f}", f"{c.least_thread_ms:.1f}", f"{c.draw_calls_ms:.1f}")
        table.add_row("yes" if c.labels else "no", *times, f"{c.python_calls:,}", f"{c.all_calls:,}")
    terminal().print(table)


@app.command()
def combinations(
    *,
    scenario: Annotated[
        list[str] | None, typer.Option("--scene", help="Only this scenario (repeatable).")
    ] = None,
    page: Annotated[Path | None, typer.Option(help="Also write the tables to this Markdown file.")] = None,
    gpu: Gpu = None,
    as_json: AsJson = False,
) -> None:
    """Time every built-in scenario x camera x mono and RGB, with labels and capture; takes half an hour."""
    if page is not None and not page.parent.is_dir():
        raise UserError(f"--page {page}: the folder does not exist")
    scenarios = tuple(scenario or ())
    with progress_bar("bench", quiet=as_json) as progress:
        machine, costs = bench_combinations(scenarios, device_index=gpu, progress=progress)
    if page is not None:
        scene_options = "".join(f" --scene {name}" for name in scenarios)
        write_atomic(
            page,
            combinations_page(machine, costs, f"python -m tools.bench combinations{scene_options}").encode(),
        )
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


@app.command()
def throughput(
    *,
    processes: Annotated[int, typer.Argument(min=1, max=64, help="Maximum number of concurrent processes.")],
    scene: Annotated[list[str] | None, typer.Option(help="Only this scene (repeatable).")] = None,
    gpu: Gpu = None,
    as_json: AsJson = False,
) -> None:
    """Measure the frame rate of 1, 2, 4 ... concurrent processes."""
    scenes = tuple(scene or ())
    check_scenes(scenes)
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


if __name__ == "__main__":
    try:
        app()
    except UserError as error:
        sys.exit(str(error))
