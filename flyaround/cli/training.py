"""train: a pose-estimation network on a data set, or the keypoint network of a target."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer

from flyaround.cli.run_options import with_run_options
from flyaround.cli.terminal import progress_bar, say
from flyaround.hil.board.net.residual_network import ARCHITECTURES
from flyaround.runs.document import write_run
from flyaround.runs.estimation import TrainRun
from flyaround.simulator.errors import UserError, missing_extra
from flyaround.simulator.targets.installed import network_file
from flyaround.simulator.targets.library import load_target

if TYPE_CHECKING:
    from collections.abc import Callable


@with_run_options
def train(
    run: TrainRun,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
) -> None:
    """Train a network on a data set, or with --craft the keypoint network that hybrid uses for a craft.

    On a data set, every tenth frame is held out for evaluation. The file needs no PyTorch where it is used: flyaround
    evaluate --method net:FILE. For a craft, views are rendered here, the confidence is calibrated on further frames,
    hybrid finds the file by the craft's name, and hil bundle includes it. An interrupted run is resumed.
    """
    if (run.folder is None) == (run.craft is None):
        raise UserError("train needs a data set or a craft: give a folder or --craft NAME")
    say_progress = (
        (lambda _done, _text: None)
        if as_json
        else (lambda done, text: say(f"{100 * done:3.0f} %: {text}", stderr=True))
    )
    if run.craft is not None:
        _train_craft(run, run.craft, say_progress, as_json=as_json)
    else:
        _train_on_set(run, str(run.folder), say_progress, as_json=as_json)


POOR_PX = 12.0
"""Median error of the keypoints [px of 128] above which `hybrid` may find fewer poses with the network than without: on
a box with two panels 16.2 px did harm and 10.9 px helped. On a craft with a near-symmetry, whose keypoints have two
likely places each, 21.3 px helped."""


def _check_suffix(output: Path) -> None:
    if output.suffix != ".npz":
        raise UserError(f"-o {output}: a network is an .npz file: give a name that ends in .npz")


def _train_craft(run: TrainRun, craft: str, report: Callable[[float, str], None], *, as_json: bool) -> None:
    load_target(craft)
    output = network_file(craft) if run.output is None else Path(run.output)
    _check_suffix(output)
    try:
        from flyaround.hil.train.fitting import Budget  # noqa: PLC0415 - slow to import: mistakes are reported first
        from flyaround.hil.train.keypoints.head_training import train_head  # noqa: PLC0415 - slow to import
    except ImportError as error:
        raise missing_extra("training", "train", error) from error
    trained = train_head(
        craft,
        output,
        views=run.views,
        budget=Budget(minutes=run.minutes, steps=run.steps),
        seed=run.seed,
        workers=run.threads,
        calibration_frames=run.calibrate,
        report=report,
    )
    write_run(output, run)
    if as_json:
        typer.echo(msgspec.json.encode(trained).decode())
        return
    say(
        f"{output}: {trained.steps} steps on {trained.views} views; on held-out views the median keypoint error is "
        f"{trained.median_px:.1f} of 128 px, {100 * trained.within_10_px:.0f} % are within 10 px, "
        f"{100 * trained.present:.0f} % of craft detected"
    )
    if trained.frames:
        say(
            f"calibrated on {trained.frames} other frames: {trained.right} are right within 5 deg and 5 % of the "
            f"range, {trained.accepted} are accepted, {trained.wrong} of these wrong"
        )
    if trained.median_px > POOR_PX:
        say(
            f"with more than {POOR_PX:g} px, hybrid may find fewer poses than without it, unless {craft} looks alike "
            f"from two sides: compare by flyaround evaluate, train it longer (--minutes), or delete {output}"
        )
    if trained.symmetries:
        say(
            f"{craft} looks nearly the same under {trained.symmetries} rotations, which keypoints cannot distinguish"
        )


def _train_on_set(
    run: TrainRun, folder: str, report_progress: Callable[[float, str], None], *, as_json: bool
) -> None:
    if run.output is None:
        raise UserError("train needs an output file: name it with -o NAME.npz")
    output = Path(run.output)
    _check_suffix(output)
    if run.network not in ARCHITECTURES:
        raise UserError(
            f"unknown network '{run.network}' in --network: choose from {', '.join(ARCHITECTURES)}"
        )
    if output.is_dir() or not output.absolute().parent.is_dir():
        raise UserError(f"-o {output}: its folder does not exist: create it first")
    try:
        from flyaround.hil.train.fitting import Budget  # noqa: PLC0415 - slow to import: mistakes are reported first
        from flyaround.hil.train.train import train_network  # noqa: PLC0415 - slow to import
    except ImportError as error:
        raise missing_extra("training", "train", error) from error

    with progress_bar("pictures", quiet=as_json) as reading:
        report = train_network(
            Path(folder),
            output,
            architecture=run.network,
            width_px=run.width,
            classes=run.classes,
            budget=Budget(minutes=run.minutes, steps=run.steps),
            seed=run.seed,
            device=run.device,
            threads=run.threads,
            report=report_progress,
            progress=reading,
        )
    write_run(output, run)
    if as_json:
        typer.echo(msgspec.json.encode(report).decode())
        return
    mean = report.mean_predictor
    say(
        f"{output}: {report.n_held_out} held-out frames, mean errors {report.mean_E_T_m:.3g} m and "
        f"{report.mean_E_R_deg:.3g} deg (median {report.median_E_T_m:.3g} m, {report.median_E_R_deg:.3g} deg), "
        f"{100 * report.accepted:.0f} % accepted"
    )
    say(f"mean predictor: {mean.mean_E_T_m:.3g} m and {mean.mean_E_R_deg:.3g} deg")
