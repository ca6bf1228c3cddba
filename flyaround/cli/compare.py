"""compare: simulated images next to a folder of reference images."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer
from rich.table import Table

from flyaround.cli.run_options import with_run_options
from flyaround.cli.terminal import progress_bar, say, terminal
from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.methods import make_estimator
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.runs.document import write_run
from flyaround.runs.estimation import CompareRun
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


@with_run_options
def compare(
    run: CompareRun,
    as_json: Annotated[bool, typer.Option("--json", help="Print comparison.json.")] = False,
) -> None:
    """Compare reference images with simulated ones of similar views: histograms, edges, with and without atmosphere."""
    if run.sensor is not None:
        sensor_preset(run.sensor)  # report an unknown name before the work
    model = load_target(run.target)
    reference, output = Path(run.reference), Path(run.output)
    references = read_references(
        reference, load_camera(run.camera), run.n, None if run.labels is None else Path(run.labels)
    )
    write_run(empty_folder(output), run)
    with Renderer(device_index=run.gpu) as renderer, progress_bar("compare", quiet=as_json) as progress:
        pairs = compare_pictures(
            renderer, references, model, partial(_estimated, model), sensor=run.sensor, progress=progress
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
    """Return the estimator's pose, marked as uncertain if the estimator declined it."""
    camera = CameraIntrinsics.from_dict(msgspec.to_builtins(reference.camera))
    result = make_estimator(board_model(target), camera).estimate(reference.image, None)
    q, t = result.q_camera_from_target_wxyz, result.t_camera_from_target_m
    return (
        None
        if q is None or t is None
        else PoseEstimate(Pose.from_arrays("camera", "target", q, t), result.accepted)
    )
