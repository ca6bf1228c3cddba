"""render, capture, check: pictures, data sets, and the proof that their labels are right."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from rich.console import Console
from rich.table import Table

from flyaround.plans import choose_plan
from flyaround.progress import progress_bar
from simulator.dataset.capture import FORMATS, parse_formats
from simulator.dataset.capture import capture as capture_plan
from simulator.dataset.check import check_dataset
from simulator.dataset.picture import render_poses, render_scene, save_picture, time_passes
from simulator.dataset.poses import read_poses
from simulator.errors import UserError
from simulator.labels.request import LAYERS, LabelRequest, parse_labels
from simulator.labels.truth import read_truth
from simulator.loop import plan_flight
from simulator.render.earth_maps import EarthMaps, begin_earth_maps
from simulator.scenario_load import load_scenario
from simulator.scenario_picture import environment_section
from simulator.scene.environments import ENVIRONMENTS
from simulator.scene.state import Bands, Quality, SceneState
from simulator.targets.library import load_target
from simulator.targets.model import Target

Seed = Annotated[
    int | None, typer.Option("--seed", min=0, help="Seed of every random choice (default: the scenario's).")
]
Labels = Annotated[
    str | None,
    typer.Option(
        "--labels", help=f"Label layers beyond truth and mask: all, none, or of {', '.join(LAYERS)}."
    ),
]
World = Annotated[
    str | None,
    typer.Option(
        "--environment",
        help=f"Layers of the world instead of the scenario's: {', '.join(ENVIRONMENTS)}.",
    ),
]
Device = Annotated[
    int | None, typer.Option("--gpu", help="EGL device to draw on (default: the driver's choice).")
]


def render(
    scenario: Annotated[str | None, typer.Argument(help="Built-in name or TOML file.")] = None,
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            help=".png image, .npy raw numbers, .exr radiance; truth goes to .json beside it.",
        ),
    ] = Path("frame.png"),
    time_s: Annotated[
        float, typer.Option("--time", "-t", help="Mid-exposure, seconds from the start.")
    ] = 0.0,
    from_truth: Annotated[
        Path | None,
        typer.Option("--from-truth", help="Draw the frame of a truth record again, byte for byte."),
    ] = None,
    poses: Annotated[
        Path | None,
        typer.Option(
            "--poses",
            help="CSV with q_w,q_x,q_y,q_z,t_x_m,t_y_m,t_z_m (target in camera): draw the scenario with each.",
        ),
    ] = None,
    rgb: Annotated[bool, typer.Option("--rgb", help="Colour image instead of the scenario's bands.")] = False,
    quality: Annotated[str | None, typer.Option(help="draft, default or high.")] = None,
    environment: World = None,
    labels: Labels = None,
    seed: Seed = None,
    gpu: Device = None,
    timings: Annotated[
        bool, typer.Option("--timings", help="Draw it five times more and print the time of each pass.")
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the truth record (with --timings: and stage_ms).")
    ] = False,
) -> None:
    """Draw one frame and its truth, or one for each pose of a list."""
    if (scenario is None) == (from_truth is None):
        raise UserError("render needs either a SCENARIO or --from-truth FILE; see flyaround render --help")
    begun: dict[Bands, EarthMaps] = {}
    if from_truth is not None:
        if environment is not None:
            raise UserError("--from-truth draws the record's environment; leave out --environment")
        if poses is not None:
            raise UserError("--poses needs a SCENARIO for camera and light; leave out --from-truth")
        record = read_truth(from_truth)
        scene, target = record.scene, load_target(record.scene.target.name)
        request = LabelRequest(layers=record.layers, flow=record.flow)
    else:
        bands: Bands | None = "rgb" if rgb else None
        flown = load_scenario(scenario or "")
        if environment is not None:
            flown = msgspec.structs.replace(flown, environment=environment_section(environment))
        if flown.environment_model.earth:
            # two at a time: an empty cache is filled while the target is built and flown
            in_bands = bands or flown.output.bands
            begun[in_bands] = begin_earth_maps(in_bands, flown.environment_model, flown.epoch_utc)
        plan = plan_flight(flown, times=(time_s,), seed=seed, bands=bands, quality=_quality(quality))
        scene, target, request = plan.scene(0), plan.target, LabelRequest()
    if labels is not None:
        request = LabelRequest(layers=parse_labels(labels), flow=request.flow)
    if poses is not None:
        if timings:
            raise UserError("--timings is about one picture; leave out --poses")
        _render_poses(scene, target, request, poses, output, gpu, begun, as_json=as_json)
        return
    frame = render_scene(scene, target, labels=request, device_index=gpu, begun=begun)
    truth_path = save_picture(frame, output)
    stage_ms = time_passes(scene, target, device_index=gpu) if timings else {}
    if as_json:
        text = truth_path.read_text()
        typer.echo(json.dumps({**json.loads(text), "stage_ms": stage_ms}) if timings else text)
    else:
        Console().print(
            f"{output} and {truth_path} ({frame.stage_ms['render'] + frame.stage_ms['sensor']:.0f} ms)"
        )
        if timings:
            Console().print(_times_table(stage_ms))


def _times_table(stage_ms: dict[str, float]) -> Table:
    """Each stage's time; passes are indented under the stage they belong to."""
    table = Table("stage", "ms", title="median of five, each pass waited for")
    table.columns[1].justify = "right"
    for stage in (name for name in stage_ms if "." not in name):
        table.add_row(stage, f"{stage_ms[stage]:.2f}")
        for name, ms in stage_ms.items():
            if name.startswith(f"{stage}."):
                table.add_row(f"  {name.removeprefix(stage + '.')}", f"{ms:.2f}")
    return table


def _render_poses(
    scene: SceneState,
    target: Target,
    request: LabelRequest,
    poses: Path,
    output: Path,
    gpu: int | None,
    begun: dict[Bands, EarthMaps],
    *,
    as_json: bool,
) -> None:
    """One picture for each row: OUT-000000.png and so on."""
    rows = read_poses(poses)
    written = []
    with progress_bar("render", quiet=as_json) as progress:
        for k, frame in enumerate(
            render_poses(scene, target, rows, labels=request, device_index=gpu, begun=begun)
        ):
            path = output.with_name(f"{output.stem}-{k:06d}{output.suffix}")
            truth_path = save_picture(frame, path)
            written.append({"image": str(path), "truth": str(truth_path)})
            progress(k + 1, len(rows))
    if as_json:
        typer.echo(json.dumps({"frames": written}))
    else:
        Console().print(f"{len(written)} images and their truth: {written[0]['image']} and on")


def capture(
    scenario: Annotated[str, typer.Argument(help="Built-in scenario or recipe, or a TOML file.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the data set: new or empty.")],
    n: Annotated[
        int | None,
        typer.Option("-n", min=1, help="Frames: evenly in time, or samples of a recipe (default 20)."),
    ] = None,
    every_s: Annotated[
        float | None, typer.Option("--every", help="Seconds between frames, instead of -n.")
    ] = None,
    formats: Annotated[
        str, typer.Option("--format", help=f"Exports beside the native layout: {', '.join(FORMATS)}.")
    ] = "native",
    rgb: Annotated[
        bool, typer.Option("--rgb", help="Colour images instead of the scenario's bands.")
    ] = False,
    quality: Annotated[str | None, typer.Option(help="draft, default or high.")] = None,
    environment: World = None,
    camera: Annotated[
        str | None, typer.Option("--camera", help="Built-in camera or file, instead of the scenario's own.")
    ] = None,
    labels: Labels = None,
    seed: Seed = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on where an interrupted capture stopped.")
    ] = False,
    workers: Annotated[int, typer.Option(min=1, max=64, help="Processes that draw; same bytes.")] = 1,
    gpu: Device = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print a summary as JSON.")] = False,
) -> None:
    """Take labelled images along a flight; every frame's labels are checked as it is written."""
    if n is not None and every_s is not None:
        raise UserError("capture takes -n or --every, not both; leave one out")
    names = parse_formats(formats)
    bands: Bands | None = "rgb" if rgb else None
    plan = choose_plan(
        scenario,
        n=n or 20,
        every_s=every_s,
        seed=seed,
        bands=bands,
        quality=_quality(quality),
        camera=camera,
        environment=environment,
    )
    wanted = ",".join(plan.labels) if labels is None else labels
    with progress_bar("capture", quiet=as_json) as progress:
        summary = capture_plan(
            plan,
            output,
            formats=names,
            labels=parse_labels(wanted),
            resume=resume,
            workers=workers,
            device_index=gpu,
            progress=progress,
        )
    if as_json:
        typer.echo(
            json.dumps(
                {
                    "folder": str(summary.folder),
                    "written": summary.n_written,
                    "kept": summary.n_kept,
                    "feasible": summary.n_feasible,
                    "quarantined": [{"frame": k, "reason": r} for k, r in summary.quarantined],
                }
            )
        )
    else:
        Console().print(
            f"{summary.n_written} frames written to {summary.folder} ({summary.n_kept} were there, "
            f"{summary.n_feasible} of the new ones feasible, {len(summary.quarantined)} quarantined)"
        )
    if summary.quarantined:
        raise typer.Exit(1)


def check(
    folder: Annotated[Path, typer.Argument(help="A data set written by capture.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
) -> None:
    """Re-verify every label of a data set from its files; exit 1 if one is wrong."""
    with progress_bar("check", quiet=as_json) as progress:
        report = check_dataset(folder, progress)
    if as_json:
        faults = [{"frame": f.frame, "what": f.what} for f in report.faults]
        typer.echo(json.dumps({"frames": report.n_frames, "labels": report.n_labels, "faults": faults}))
    else:
        console = Console()
        for fault in report.faults:
            where = "card" if fault.frame is None else f"frame {fault.frame}"
            console.print(f"[red]{where}[/red]: {fault.what}", highlight=False)
        console.print(f"{report.n_frames} frames, {report.n_labels} labels, {len(report.faults)} faults")
    if report.faults:
        raise typer.Exit(1)


def _quality(name: str | None) -> Quality | None:
    match name:
        case None | "draft" | "default" | "high":
            return name
        case _:
            raise UserError(f"unknown quality '{name}' in --quality; choose from draft, default, high")
