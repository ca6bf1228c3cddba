"""convert: data sets of others into ours, ours into other formats."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flyaround.cli.terminal import progress_bar, say
from flyaround.simulator.dataset.conversion import convert as convert_dataset
from flyaround.simulator.dataset.conversion import open_source
from flyaround.simulator.dataset.formats.registry import NATIVE, readable, writable
from flyaround.simulator.dataset.split import parse_split


def convert(
    source: Annotated[
        Path, typer.Argument(help="A data set: its folder, or of others the list of labels within.")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder to write: new or empty.")],
    form: Annotated[
        str,
        typer.Option(
            "--format", help=f"Of {', '.join(writable())}; several with commas, each in a folder of its name."
        ),
    ] = NATIVE,
    source_format: Annotated[
        str | None,
        typer.Option(
            "--from", help=f"Format of the source, found out unless given: native, {', '.join(readable())}."
        ),
    ] = None,
    target: Annotated[
        str | None, typer.Option("--target", help="The craft in pictures of others (of SPEED's kin: tango).")
    ] = None,
    camera: Annotated[
        str | None,
        typer.Option(
            "--camera", help="Camera of pictures of others, built-in or a file, instead of their own."
        ),
    ] = None,
    split: Annotated[
        str | None,
        typer.Option("--split", help="Shares of training, validation and test frames, such as 8:1:1."),
    ] = None,
) -> None:
    """Write a data set in another format; pictures and poses of others get masks, keypoints and boxes by the model."""
    shares = None if split is None else parse_split(split)
    opened = open_source(source, source_format, target=target, camera=camera)
    with progress_bar("convert") as progress:
        count = convert_dataset(
            opened,
            output,
            form,
            split=shares,
            progress=progress,
            tell=lambda sentence: say(sentence, stderr=True),
        )
    card = opened.card
    say(
        f"{count} frames of {card.scenario_name} ({opened.form}, {card.target.name}) written to {output} as {form}"
    )
