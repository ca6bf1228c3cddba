"""estimate, evaluate: the board's estimator on images from files, on this machine."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer
from rich.table import Column, Table

from flyaround.cli.terminal import progress_bar, say, terminal
from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics
from flyaround.hil.board.hybrid.debug.stage_pictures import write_stage_pictures
from flyaround.hil.board.hybrid.native.library import describe_library
from flyaround.hil.board.method_names import ALL_METHODS, HYBRID
from flyaround.hil.board.methods import PUBLISHED
from flyaround.hil.board.svd.settings import SOLVERS, STREAMS
from flyaround.hil.evaluate.added_estimators import any_estimator, check_any_method
from flyaround.hil.evaluate.dataset_evaluation import evaluate_dataset
from flyaround.hil.evaluate.estimate import checked_picture
from flyaround.hil.evaluate.evaluation_page import about_mean_predictor
from flyaround.hil.evaluate.greyscale import PLAIN, about_pictures
from flyaround.hil.evaluate.method_choice import MethodChoice, board_model
from flyaround.hil.evaluate.metrics import MethodMetrics
from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.dataset.card import read_card
from flyaround.simulator.dataset.formats.native import read_png
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import empty_folder
from flyaround.simulator.targets.library import load_target

Solver = Annotated[
    str | None,
    typer.Option(
        help=f"Pose solver of svd-2018 and svd-thesis: {', '.join(SOLVERS)} (default: the method's own)."
    ),
]
Streams = Annotated[
    str | None,
    typer.Option(
        help=f"Feature streams of svd-2018 and svd-thesis, with commas: {', '.join(STREAMS)} (default: wge,sh)."
    ),
]


def estimate(
    images: Annotated[
        list[Path],
        typer.Argument(help="PNG images, 8 or 16 bits; colour is taken in grey, and that is said."),
    ],
    target: Annotated[str, typer.Option(help="Target name.")] = "tango",
    camera: Annotated[str, typer.Option(help="CAMERA.json, or the name of a built-in camera.")] = "speed",
    method: Annotated[str, typer.Option(help=f"One of {', '.join(ALL_METHODS)}.")] = HYBRID,
    solver: Solver = None,
    streams: Streams = None,
    debug: Annotated[
        Path | None,
        typer.Option(help="New or empty folder for a picture of every stage, a folder for each image."),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print JSON: an object for one image, else a list.")
    ] = False,
) -> None:
    """Estimate the pose of a target in images."""
    check_method(method)
    intrinsics = load_camera(camera)
    try:
        names = split_names(streams)
        estimator = any_estimator(
            board_model(load_target(target)),
            CameraIntrinsics.from_dict(msgspec.to_builtins(intrinsics)),
            MethodChoice(method, solver, None if names is None else tuple(names)),
        )
    except BoardModelError as error:
        raise UserError(str(error)) from error
    rows: list[dict[str, Any]] = []
    if debug is not None:
        empty_folder(debug, option="--debug")
    for k, path in enumerate(images):
        taken = read_png(path)
        image = checked_picture(taken, intrinsics, str(path))
        trace: dict[str, Any] | None = None if debug is None else {"every_stage": True}
        result = estimator.estimate(image, trace)
        if debug is not None and trace is not None:
            place = debug if len(images) == 1 else debug / f"{k:03d}_{path.stem}"
            place.mkdir(exist_ok=True)
            write_stage_pictures(place, image, trace, result, estimator.model, estimator.camera)
        q, t = result.q_camera_from_target_wxyz, result.t_camera_from_target_m
        rows.append(
            {
                "image": str(path),
                "picture": about_pictures(taken),
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
        )
    if as_json:
        typer.echo(json.dumps(rows if len(rows) > 1 else rows[0], indent=1))
        return
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
        if row["picture"] != PLAIN:
            say(f"{row['image']}: {row['picture']}")


def evaluate(
    folder: Annotated[Path, typer.Argument(help="A data set written by capture.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder of the report: new or empty.")
    ] = Path("report"),
    methods: Annotated[
        list[str] | None,
        typer.Option(
            "--method", help=f"One of {', '.join(ALL_METHODS)} (default hybrid); repeat it to compare."
        ),
    ] = None,
    solver: Solver = None,
    streams: Streams = None,
    model: Annotated[
        Path | None,
        typer.Option(help="Board model file given to the estimator, instead of the target's own."),
    ] = None,
    workers: Annotated[int, typer.Option(min=1, help="Processes; with one, times are honest.")] = 1,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with what an interrupted run left.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print metrics.json.")] = False,
) -> None:
    """Estimate every frame of a data set and compare with its truth: metrics.json, frames.csv, index.html."""
    chosen = list(dict.fromkeys(methods or [HYBRID]))
    for method in chosen:
        check_method(method)
    names = split_names(streams)
    choices = tuple(
        MethodChoice(m, solver, tuple(names) if names is not None else None)
        if m in PUBLISHED
        else MethodChoice(m)
        for m in chosen
    )
    if len({c.label for c in choices}) < len(choices):
        raise UserError("two networks in --method have files of one name; rename one")
    if (solver or streams) and not any(m in PUBLISHED for m in chosen):
        raise UserError(
            f"--solver and --streams belong to {' and '.join(PUBLISHED)}; leave them out for {chosen[0]}"
        )
    try:
        given = None if model is None else BoardModel.read(model)
        read_card(folder)  # what is no data set leaves no report behind
        empty_folder(output, resume=resume)
        with progress_bar("evaluate", quiet=as_json) as progress:
            metrics = evaluate_dataset(
                folder, output, methods=choices, model=given, workers=workers, progress=progress
            )
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
    say(f"page: {output / 'index.html'}")


def split_names(streams: str | None) -> list[str] | None:
    """The names between the commas."""
    return None if streams is None else [s.strip() for s in streams.split(",") if s.strip()]


def check_method(method: str) -> None:
    """Refuse a method that there is not.

    Raises
    ------
    UserError
        With the methods there are; of a network, what is wrong with its file.
    """
    try:
        check_any_method(method)
    except BoardModelError as error:
        raise UserError(f"--method: {error}") from error
