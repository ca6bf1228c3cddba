"""train: a network that estimates poses, learned from a data set."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec
import typer

from flyaround.cli.terminal import progress_bar, say
from flyaround.hil.train.residual_network import ARCHITECTURES
from flyaround.simulator.errors import UserError, missing_extra


def train(
    folder: Annotated[Path, typer.Argument(help="A data set written by capture.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="The network's file, NAME.onnx.")],
    minutes: Annotated[float, typer.Option(min=0.01, max=100_000, help="How long to train.")] = 6.0,
    steps: Annotated[
        int | None, typer.Option(min=1, help="Steps instead of minutes: the same on every machine of a kind.")
    ] = None,
    network: Annotated[str, typer.Option(help=f"Its size: {' or '.join(ARCHITECTURES)}.")] = "small",
    width: Annotated[int, typer.Option(min=32, max=1024, help="Width of its pictures [px].")] = 160,
    classes: Annotated[int, typer.Option(min=64, max=20_000, help="Attitudes that it tells apart.")] = 1024,
    seed: Annotated[int, typer.Option(min=0, help="Of its start and of the samples.")] = 0,
    device: Annotated[str, typer.Option(help="cpu, or cuda with an NVIDIA card.")] = "cpu",
    threads: Annotated[int, typer.Option(min=1, max=256, help="Of the processor.")] = 1,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
) -> None:
    """Train a network on a data set; judge it on every tenth frame, which it never saw.

    The file is ONNX and needs no PyTorch: flyaround evaluate --method net:FILE, flyaround hil board --method net:FILE.
    """
    if output.suffix != ".onnx":
        raise UserError(f"-o {output}: the file is ONNX; give a name that ends in .onnx")
    if network not in ARCHITECTURES:
        raise UserError(f"unknown network '{network}' in --network; choose from {', '.join(ARCHITECTURES)}")
    if output.is_dir() or not output.absolute().parent.is_dir():
        raise UserError(f"-o {output}: there is no folder for such a file; make it first")
    try:
        from flyaround.hil.train.fitting import Budget  # noqa: PLC0415 - PyTorch, which a mistake need not wait for
        from flyaround.hil.train.train import train_network  # noqa: PLC0415 - the same
    except ImportError as error:
        raise missing_extra("training", "train", error) from error

    with progress_bar("pictures", quiet=as_json) as reading:
        report = train_network(
            folder,
            output,
            architecture=network,
            width_px=width,
            classes=classes,
            budget=Budget(minutes=minutes, steps=steps),
            seed=seed,
            device=device,
            threads=threads,
            report=(lambda _done, _text: None)
            if as_json
            else (lambda done, text: say(f"{100 * done:3.0f} %: {text}", stderr=True)),
            progress=reading,
        )
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
