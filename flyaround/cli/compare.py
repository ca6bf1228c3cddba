"""compare: our pictures beside a folder of reference pictures."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer
from rich.table import Table

from flyaround.cli.terminal import progress_bar, say, terminal
from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.methods import make_estimator
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.compare.comparison import compare_pictures
from flyaround.simulator.compare.image_statistics import FIGURES
from flyaround.simulator.compare.page import write_comparison
from flyaround.simulator.compare.references import read_references
from flyaround.simulator.compare.similar_view import PoseEstimate
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.runtime.files import empty_folder
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.frames.pose import Pose

if TYPE_CHECKING:
    from flyaround.simulator.compare.references import Reference
    from flyaround.simulator.targets.model import Target


def compare(
    reference: Annotated[
        Path, typer.Option("--reference", help="Folder of pictures to compare with; they stay there.")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the page: new or empty.")] = Path(
        "comparison"
    ),
    n: Annotated[int, typer.Option("-n", min=1, help="Pictures at most, evenly over the folder.")] = 16,
    target: Annotated[str, typer.Option(help="The craft in them.")] = "tango",
    camera: Annotated[
        str, typer.Option(help="Camera that took them, scaled to each picture: name or file.")
    ] = "speed",
    labels: Annotated[
        Path | None,
        typer.Option(help="Poses of the pictures in SPEED's form (train.json); else they are estimated."),
    ] = None,
    sensor: Annotated[
        str | None,
        typer.Option(help="Sensor preset of ours (default: as noisy as each picture)."),
    ] = None,
    gpu: Annotated[int | None, typer.Option("--gpu", help="EGL device to draw on.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print comparison.json.")] = False,
) -> None:
    """Set pictures of others beside ours of the like views: histograms, Sobel, edges with and without atmosphere."""
    if sensor is not None:
        sensor_preset(sensor)  # a wrong name is said before the work
    model = load_target(target)
    references = read_references(reference, load_camera(camera), n, labels)
    empty_folder(output)
    with Renderer(device_index=gpu) as renderer, progress_bar("compare", quiet=as_json) as progress:
        pairs = compare_pictures(
            renderer, references, model, partial(_estimated, model), sensor=sensor, progress=progress
        )
    document = write_comparison(output, pairs, f"{len(pairs)} pictures of {reference.resolve().name}")
    if as_json:
        typer.echo(json.dumps(document))
        return
    table = Table(
        "median", *(f"{name}: {side}" for name in document["summary"] for side in ("reference", "ours"))
    )
    for key, label in FIGURES.items():
        medians = document["summary"].values()
        table.add_row(label, *(f"{m[side][key]:.4g}" for m in medians for side in ("reference", "ours")))
    terminal().print(table)
    say(f"page: {output / 'index.html'}")


def _estimated(target: Target, reference: Reference) -> PoseEstimate | None:
    """The estimator's pose; one that it declines is not sure."""
    camera = CameraIntrinsics.from_dict(msgspec.to_builtins(reference.camera))
    result = make_estimator(board_model(target), camera).estimate(reference.image, None)
    q, t = result.q_camera_from_target_wxyz, result.t_camera_from_target_m
    return (
        None if q is None or t is None else PoseEstimate(Pose.of("camera", "target", q, t), result.accepted)
    )
