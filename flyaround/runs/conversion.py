"""Options of ``flyaround convert``."""

from __future__ import annotations

from typing import Annotated

import typer

from flyaround.runs.document import NOT_RECORDED, Run
from flyaround.runs.fields import File
from flyaround.simulator.dataset.formats.registry import NATIVE, readable, writable


class ConvertRun(Run, frozen=True, kw_only=True, tag="flyaround.run.convert"):
    """Options of ``flyaround convert``: write a data set in another format."""

    source: Annotated[
        File, typer.Argument(help="Data set: its folder or, for other formats, its list of labels.")
    ]
    output: Annotated[File, typer.Option("--output", "-o", help="New or empty output folder."), NOT_RECORDED]
    form: Annotated[
        str,
        typer.Option(
            "--format",
            help=f"Any of {', '.join(writable())}, separated by commas; each is written into a folder of its name.",
        ),
    ] = NATIVE
    source_format: Annotated[
        str | None,
        typer.Option(
            "--from", help=f"Format of the source (default: detected): native, {', '.join(readable())}."
        ),
    ] = None
    target: Annotated[
        str | None, typer.Option(help="Target in pictures of other data sets (for SPEED and SPEED+: tango).")
    ] = None
    camera: Annotated[
        str | None,
        typer.Option(help="Camera of pictures of other data sets, built-in or a file, instead of their own."),
    ] = None
    split: Annotated[
        str | None, typer.Option(help="Shares of training, validation and test frames, such as 8:1:1.")
    ] = None
