"""estimate, evaluate: the board's estimator on images from files, on this machine."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer
from rich.table import Column, Table

from flyaround.cli.run_options import with_run_options
from flyaround.cli.terminal import progress_bar, say, terminal
from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics, Estimator
from flyaround.hil.board.hybrid.debug.stage_pictures import write_stage_pictures
from flyaround.hil.board.hybrid.native.library import describe_library
from flyaround.hil.board.hybrid.propose.keypoints.network import network_for
from flyaround.hil.board.method_names import HYBRID, HYBRID_TRACK
from flyaround.hil.board.methods import PUBLISHED
from flyaround.hil.evaluate.added_estimators import any_estimator, check_any_method
from flyaround.hil.evaluate.dataset_evaluation import evaluate_dataset
from flyaround.hil.evaluate.estimate import checked_picture
from flyaround.hil.evaluate.evaluation_page import about_mean_predictor
from flyaround.hil.evaluate.greyscale import PLAIN_NOTE, describe_pictures
from flyaround.hil.evaluate.method_choice import MethodChoice, board_model
from flyaround.hil.evaluate.metrics import MethodMetrics
from flyaround.runs.document import write_run
from flyaround.runs.estimation import EstimateRun, EvaluateRun, Published
from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.dataset.card import read_card
from flyaround.simulator.dataset.formats.native import read_png
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.truth import read_truth
from flyaround.simulator.runtime.files import empty_folder
from flyaround.simulator.targets.library import load_target


@with_run_options
def estimate(
    run: EstimateRun,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print JSON: an object for one image, else a list.")
    ] = False,
) -> None:
    """Estimate the pose of a target in images."""
    check_method(run.method)
    intrinsics = load_camera(run.camera)
    model = board_model(load_target(run.target))
    try:
        network = _network_craft(run.method, model)
        estimator = any_estimator(
            model,
            CameraIntrinsics.from_dict(msgspec.to_builtins(intrinsics)),
            _method_choice(run.method, run.published),
        )
    except BoardModelError as error:
        raise UserError(str(error)) from error
    debug = None if run.debug is None else Path(run.debug)
    if debug is not None:
        write_run(empty_folder(debug, option="--debug"), run)
    rows = []
    for k, image in enumerate(run.images):
        folder = debug if debug is None or len(run.images) == 1 else debug / f"{k:03d}_{Path(image).stem}"
        rows.append({**_estimated(estimator, Path(image), intrinsics, folder), "network": network})
    if as_json:
        typer.echo(json.dumps(rows if len(rows) > 1 else rows[0], indent=1))
    else:
        say(f"Target {run.target}, camera {run.camera}.")
        _print_estimates(rows)
        _print_network(run.method, model, network)
    for image in run.images:
        _warn_of_other_target(Path(image), run.target)


def _warn_of_other_target(image: Path, target: str) -> None:
    """Print that the truth record beside an image names another target than the one that was sought."""
    path = image.with_suffix(".json")
    if not path.exists():
        return
    try:
        shown = read_truth(path).scene.target.name
    # the file beside an image need not be a truth record
    except UserError:
        return
    if shown.removesuffix("-mockup") != target.removesuffix("-mockup"):
        say(
            f"{image} shows {shown} by the truth record beside it, and {target} was sought in it: "
            f"give --target {shown}",
            stderr=True,
        )


def _network_craft(method: str, model: BoardModel) -> str | None:
    """Return the craft whose keypoint network a method uses, None if it uses none.

    Raises
    ------
    BoardModelError
        If the model carries a network that cannot be used.
    """
    network = network_for(model) if method in (HYBRID, HYBRID_TRACK) else None
    return None if network is None else network.head.craft


def _print_network(method: str, model: BoardModel, network: str | None) -> None:
    """Print that a target has no keypoint network, if the method would use one."""
    if network is None and method in (HYBRID, HYBRID_TRACK):
        say(
            f"{model.name} has no keypoint network, so that few poses are accepted before the Earth and by lamps: "
            f"train one with flyaround train --craft {model.name}"
        )


def _method_choice(method: str, published: Published) -> MethodChoice:
    """Return a method, with solver and streams if it is a published one."""
    streams = split_names(published.streams)
    return MethodChoice(method, published.solver, None if streams is None else tuple(streams))


def _estimated(estimator: Estimator, path: Path, intrinsics: Camera, folder: Path | None) -> dict[str, Any]:
    """Estimate an image and return the JSON document; write a picture of every stage if a folder is given."""
    raw = read_png(path)
    image = checked_picture(raw, intrinsics, str(path))
    trace: dict[str, Any] | None = None if folder is None else {"every_stage": True}
    result = estimator.estimate(image, trace)
    if folder is not None and trace is not None:
        folder.mkdir(exist_ok=True)
        write_stage_pictures(folder, image, trace, result, estimator.model, estimator.camera)
    q, t = result.q_camera_from_target_wxyz, result.t_camera_from_target_m
    return {
        "image": str(path),
        "picture": describe_pictures(raw, intrinsics.pixel_encoding),
        "accepted": bool(result.accepted),
        "reason": result.reason,
        "q_camera_from_target_wxyz": None if q is None else [float(x) for x in q],
        "t_camera_from_target_m": None if t is None else [float(x) for x in t],
        "confidence": float(result.confidence),
        "method": result.method,
        "kernels": describe_library(),
        "stages_ms": {k: float(v) for k, v in result.stages_ms.items()},
        "counts": {k: int(v) for k, v in result.counts.items()},
        "covariance": None if result.covariance is None else result.covariance.tolist(),
        "alternatives": [
            {
                "q_camera_from_target_wxyz": a.q_camera_from_target_wxyz.tolist(),
                "t_camera_from_target_m": a.t_camera_from_target_m.tolist(),
                "score": float(a.score),
            }
            for a in result.alternatives
        ],
    }


def _print_estimates(rows: list[dict[str, Any]]) -> None:
    table = Table(Column("image", overflow="fold"), "outcome", "q wxyz", "t [m]", "confidence", "ms")
    for row in rows:
        q, t = row["q_camera_from_target_wxyz"], row["t_camera_from_target_m"]
        table.add_row(
            row["image"],
            "accepted" if row["accepted"] else f"declined: {row['reason']}",
            "" if q is None else " ".join(f"{x:+.4f}" for x in q),
            "" if t is None else " ".join(f"{x:+.3f}" for x in t),
            f"{row['confidence']:.2f}",
            f"{sum(row['stages_ms'].values()):.0f}",
        )
    terminal().print(table)
    for row in rows:
        if row["picture"] != PLAIN_NOTE:
            say(f"{row['image']}: {row['picture']}")


@with_run_options
def evaluate(
    run: EvaluateRun,
    as_json: Annotated[bool, typer.Option("--json", help="Print metrics.json.")] = False,
) -> None:
    """Evaluate an estimator on every frame of a data set: metrics.json, frames.csv, index.html."""
    folder, output = Path(run.folder), Path(run.output)
    choices = _choices(run)
    try:
        user_model = None if run.model is None else BoardModel.read(run.model)
        card = read_card(folder)  # fail before a report is written
        write_run(empty_folder(output, resume=run.resume), run)
        with progress_bar("evaluate", quiet=as_json) as progress:
            metrics = evaluate_dataset(
                folder, output, methods=choices, model=user_model, workers=run.workers, progress=progress
            )
        model = board_model(load_target(card.target.name)) if user_model is None else user_model
        networks = [_network_craft(choice.method, model) for choice in choices]
    except BoardModelError as error:
        raise UserError(str(error)) from error
    if as_json:
        typer.echo((output / "metrics.json").read_text())
        return
    table = Table("figure", *metrics.by_method)
    for name in MethodMetrics.__struct_fields__:
        values = [getattr(m, name) for m in metrics.by_method.values()]
        if any(isinstance(v, (int, float)) for v in values):
            table.add_row(name, *("" if v is None else f"{v:.4g}" for v in values))
    terminal().print(table)
    say(f"pictures: {metrics.pictures}")
    say(about_mean_predictor(metrics.mean_predictor))
    for choice, network in zip(choices, networks, strict=True):
        _print_network(choice.method, model, network)
    say(f"page: {output / 'index.html'}")


def _choices(run: EvaluateRun) -> tuple[MethodChoice, ...]:
    """Return the methods to compare.

    Raises
    ------
    UserError
        If there is no such method, two have the same label, or options of published methods are used with others.
    """
    methods = list(dict.fromkeys(run.methods or (HYBRID,)))
    for method in methods:
        check_method(method)
    choices = tuple(_method_choice(m, run.published if m in PUBLISHED else Published()) for m in methods)
    if len({c.label for c in choices}) < len(choices):
        raise UserError("two networks in --method have the same file name: rename one")
    if any(msgspec.structs.astuple(run.published)) and not any(m in PUBLISHED for m in methods):
        raise UserError(
            f"--solver and --streams belong to {' and '.join(PUBLISHED)}: leave them out for {methods[0]}"
        )
    return choices


def split_names(streams: str | None) -> list[str] | None:
    """Return the names between commas."""
    return None if streams is None else [s.strip() for s in streams.split(",") if s.strip()]


def check_method(method: str) -> None:
    """Raise unless there is a method of that name.

    Raises
    ------
    UserError
        If there is none; the message lists the methods, or states the problem with a network's file.
    """
    try:
        check_any_method(method)
    except BoardModelError as error:
        raise UserError(f"--method: {error}") from error
