"""train: a pose-estimation network, trained on a data set."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec
import typer

from flyaround.cli.run_options import with_run_options
from flyaround.cli.terminal import progress_bar, say
from flyaround.hil.train.residual_network import ARCHITECTURES
from flyaround.runs.document import write_run
from flyaround.runs.estimation import TrainRun
from flyaround.simulator.errors import UserError, missing_extra


@with_run_options
def train(
    run: TrainRun,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
) -> None:
    """Train a network on a data set, and evaluate it on every tenth frame, which is held out.

    The file is ONNX and needs no PyTorch: flyaround evaluate --method net:FILE, flyaround hil board --method net:FILE.
    """
    output = Path(run.output)
    if output.suffix != ".onnx":
        raise UserError(f"-o {output}: the file is ONNX; give a name that ends in .onnx")
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
            Path(run.folder),
            output,
            architecture=run.network,
            width_px=run.width,
            classes=run.classes,
            budget=Budget(minutes=run.minutes, steps=run.steps),
            seed=run.seed,
            device=run.device,
            threads=run.threads,
            report=(lambda _done, _text: None)
            if as_json
            else (lambda done, text: say(f"{100 * done:3.0f} %: {text}", stderr=True)),
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
