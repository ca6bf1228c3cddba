"""render: one picture and its truth.

The Earth's maps are prefetched before the packages that draw are imported: the first start does both at once.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from rich.table import Table

from flyaround.cli.options import Device, Labels, Seed, World, quality_preset
from flyaround.cli.scenario_argument import load_flown
from flyaround.cli.terminal import progress_bar, say, terminal
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.request import LabelRequest, parse_labels
from flyaround.simulator.labels.truth import read_truth
from flyaround.simulator.render.earth.map_textures import EarthMaps, prefetch_earth_maps, prefetch_maps_of
from flyaround.simulator.scenario.poses import PosePlan, read_poses
from flyaround.simulator.scene.environments import environment_section
from flyaround.simulator.scene.illumination.bands import Bands
from flyaround.simulator.scene.state import SceneState
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.targets.model import Target


def render(
    scenario: Annotated[str | None, typer.Argument(help="Built-in name or TOML file.")] = None,
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            help=".png image, .npy raw numbers, .exr radiance; truth goes to .json beside it. "
            "Earlier ones of that name are replaced. With --poses also a folder, which is made if need be.",
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
    prefetched: dict[Bands, EarthMaps] = {}
    if from_truth is not None:
        if environment is not None:
            raise UserError("--from-truth draws the record's environment; leave out --environment")
        if poses is not None:
            raise UserError("--poses needs a SCENARIO for camera and light; leave out --from-truth")
        record = read_truth(from_truth)
        prefetched = prefetch_maps_of(record.scene)
        scene, target = record.scene, load_target(record.scene.target.name)
        request = LabelRequest(layers=record.layers, flow=record.flow)
    else:
        bands: Bands | None = "rgb" if rgb else None
        flown = load_flown(scenario or "", "render")
        if environment is not None:
            flown = msgspec.structs.replace(flown, environment=environment_section(environment))
        if flown.environment.layers().earth:
            # two at a time: an empty cache is filled while the target is built and flown
            in_bands = bands or flown.output.bands
            prefetched[in_bands] = prefetch_earth_maps(in_bands, flown.environment.layers(), flown.epoch_utc)
        from flyaround.simulator.scenario.plan import plan_flight  # noqa: PLC0415 - slow to import: maps are read before

        plan = plan_flight(flown, times=(time_s,), seed=seed, bands=bands, quality=quality_preset(quality))
        scene, target, request = plan.scene(0), plan.target, LabelRequest()
    if labels is not None:
        request = LabelRequest(layers=parse_labels(labels), flow=request.flow)
    if poses is not None:
        if timings:
            raise UserError("--timings is about one picture; leave out --poses")
        _render_poses(scene, target, request, poses, output, gpu, prefetched, as_json=as_json)
        return
    from flyaround.simulator.dataset.single_frames import (  # noqa: PLC0415 - slow to import: maps are read before
        check_picture_path,
        render_scene,
        save_picture,
        time_passes,
    )

    check_picture_path(output)
    frame = render_scene(scene, target, labels=request, device_index=gpu, prefetched=prefetched)
    truth_path = save_picture(frame, output)
    stage_ms = time_passes(scene, target, device_index=gpu) if timings else {}
    if as_json:
        text = truth_path.read_text()
        typer.echo(json.dumps({**json.loads(text), "stage_ms": stage_ms}) if timings else text)
    else:
        say(f"{output} and {truth_path} ({frame.stage_ms['render'] + frame.stage_ms['sensor']:.0f} ms)")
        if timings:
            terminal().print(_times_table(stage_ms))


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
    prefetched: dict[Bands, EarthMaps],
    *,
    as_json: bool,
) -> None:
    """One picture for each row: OUT-000000.png and so on."""
    from flyaround.simulator.dataset.single_frames import NumberedPictures  # noqa: PLC0415 - slow to import: maps are read before
    from flyaround.simulator.loop import open_frames, run_frames, whole_frame  # noqa: PLC0415 - the same

    plan = PosePlan(scene, target, read_poses(poses))
    sink = NumberedPictures(output, plan.n_frames)
    with (
        progress_bar("render", quiet=as_json) as progress,
        open_frames(whole_frame, device_index=gpu, prefetched=prefetched, target=target) as producer,
    ):
        for k, _ in enumerate(run_frames(plan, producer, [sink], labels=request)):
            progress(k + 1, plan.n_frames)
    if as_json:
        written = [{"image": str(image), "truth": str(truth)} for image, truth in sink.written]
        typer.echo(json.dumps({"frames": written}))
    else:
        say(f"{plan.n_frames} images and their truth: {sink.written[0][0]} and on")
