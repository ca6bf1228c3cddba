"""overlay: copies of a data set's images with their labels drawn."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flyaround.cli.terminal import progress_bar, say
from flyaround.simulator.dataset.overlays import MARKS, parse_marks, write_overlays


def overlay(
    folder: Annotated[Path, typer.Argument(help="Data set written by capture or convert.")],
    output: Annotated[
        Path,
        typer.Option("--output", "-o", help="New or empty folder for the pictures, outside the data set."),
    ],
    draw: Annotated[
        str,
        typer.Option(
            "--draw", help=f"Any of {', '.join(MARKS)}, separated by commas. Axes: x red, y green, z blue."
        ),
    ] = "axes",
    n: Annotated[
        int | None, typer.Option("-n", min=1, help="Frames, spread evenly over the set (default: all).")
    ] = None,
) -> None:
    """Draw labels over copies of a data set's images: the craft's axes, edges, keypoints, box, mask."""
    marks = parse_marks(draw)
    with progress_bar("overlay") as progress:
        count = write_overlays(folder, output, marks, n, progress)
    say(f"{count} pictures with {', '.join(marks)} in {output}")
