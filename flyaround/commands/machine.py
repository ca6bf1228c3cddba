"""bench, doctor, demo: what this machine is, how fast it draws, and the whole chain in one command."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from flyaround.bench import check_scenes, run_bench
from flyaround.demo import run_demo
from flyaround.doctor import examine
from flyaround.progress import progress_bar
from flyaround.terminal import say, terminal
from simulator.bench.scaling import bench_scaling
from simulator.bench.throughput import THROUGHPUT_SCENES, bench_throughput
from simulator.errors import UserError


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
    gpu: Annotated[int | None, typer.Option("--gpu", help="EGL device to draw on.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Frame cost per scene beside a reference pass of the same run."""
    if scaling and processes is not None:
        raise UserError("--scaling and --processes are two benches; ask for one of them")
    if scaling:
        _bench_scaling(gpu, as_json=as_json)
        return
    if processes is not None:
        _bench_throughput(processes, tuple(scene or ()), gpu, as_json=as_json)
        return
    with progress_bar("bench", quiet=as_json) as progress:
        document = run_bench(n_frames=frames, scenes=tuple(scene or ()), device_index=gpu, progress=progress)
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


def _bench_throughput(processes: int, scenes: tuple[str, ...], gpu: int | None, *, as_json: bool) -> None:
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


def doctor(as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False) -> None:
    """What OpenGL, GPU and optional parts this machine has, and how to get the rest."""
    findings = examine()
    if as_json:
        typer.echo(json.dumps([asdict(f) for f in findings], indent=1))
    else:
        table = Table("part", "state")
        for f in findings:
            table.add_row(f.part, Text(f.found, "green" if f.ok else "red"))
        terminal().print(table)
        # below the table and not in it: a command stays in one piece, to be copied
        for f in findings:
            if f.advice:
                say(f"- {f.part}: {f.advice}")
    if not all(f.ok or not f.required for f in findings):
        raise typer.Exit(1)


def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the page.")] = Path("out/demo"),
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace an earlier demo in that folder.")
    ] = False,
) -> None:
    """Fly, capture and check 20 images, run 30 frames through a board process, and make a page of it."""
    page = run_demo(output, overwrite=overwrite, executable=sys.executable)
    say(f"open {page}")
