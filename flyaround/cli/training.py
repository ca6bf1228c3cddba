"""train: a pose-estimation network, trained on a data set, or the keypoint network of a craft."""

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
from flyaround.simulator.targets.installed import head_file
from flyaround.simulator.targets.library import load_target

if TYPE_CHECKING:
    from collections.abc import Callable


@with_run_options
def train(
    run: TrainRun,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
) -> None:
    """Train a network on a data set, or with --craft the keypoint network that hybrid uses for a craft.

    On a data set: every tenth frame is held out to judge it. The file needs no PyTorch where it is used: flyaround
    evaluate --method net:FILE. Of a craft: views are drawn here, and hybrid finds the file by the craft's name; hil
    bundle takes it along. A run that was stopped goes on where it was.
    """
    if (run.folder is None) == (run.craft is None):
        raise UserError("train learns from a data set or for a craft; give a folder or --craft NAME")
    say_progress = (
        (lambda _done, _text: None)
        if as_json
        else (lambda done, text: say(f"{100 * done:3.0f} %: {text}", stderr=True))
    )
    if run.craft is not None:
        _train_craft(run, run.craft, say_progress, as_json=as_json)
    else:
        _train_on_set(run, str(run.folder), say_progress, as_json=as_json)


def _check_suffix(output: Path) -> None:
    if output.suffix != ".npz":
        raise UserError(f"-o {output}: a network is an .npz file; give a name that ends so")


def _train_craft(run: TrainRun, craft: str, report: Callable[[float, str], None], *, as_json: bool) -> None:
    load_target(craft)
    output = head_file(craft) if run.output is None else Path(run.output)
    _check_suffix(output)
    try:
        from flyaround.hil.train.fitting import Budget  # noqa: PLC0415 - PyTorch, which a mistake need not wait for
        from flyaround.hil.train.keypoints.head_training import train_head  # noqa: PLC0415 - the same
    except ImportError as error:
        raise missing_extra("training", "train", error) from error
    trained = train_head(
        craft,
        output,
        views=run.views,
        budget=Budget(minutes=run.minutes, steps=run.steps),
        seed=run.seed,
        workers=run.threads,
        report=report,
    )
    if as_json:
        typer.echo(msgspec.json.encode(trained).decode())
        return
    say(
        f"{output}: {trained.steps} steps on {trained.views} views; on views kept back keypoints are "
        f"{trained.median_px:.1f} of 128 px off in the median, {100 * trained.within_10_px:.0f} % within 10 px, "
        f"{100 * trained.present:.0f} % of craft noticed"
    )
    if trained.symmetries:
        say(
            f"{craft} looks nearly the same under {trained.symmetries} rotations: its keypoints are known up to these"
        )


def _train_on_set(
    run: TrainRun, folder: str, report_progress: Callable[[float, str], None], *, as_json: bool
) -> None:
    if run.output is None:
        raise UserError("train needs the network's file; name it with -o NAME.npz")
    output = Path(run.output)
    _check_suffix(output)
    if run.network not in ARCHITECTURES:
        raise UserError(
            f"unknown network '{run.network}' in --network; choose from {', '.join(ARCHITECTURES)}"
        )
    if output.is_dir() or not output.absolute().parent.is_dir():
        raise UserError(f"-o {output}: there is no folder for such a file; make it first")
    try:
        from flyaround.hil.train.fitting import Budget  # noqa: PLC0415 - PyTorch, which a mistake need not wait for
        from flyaround.hil.train.train import train_network  # noqa: PLC0415 - the same
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
    say(f"the mean predictor: {mean.mean_E_T_m:.3g} m and {mean.mean_E_R_deg:.3g} deg")
