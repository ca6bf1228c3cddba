"""demo: every step from flight to report in one command."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from flyaround.cli.terminal import progress_bar, say
from flyaround.hil.demo.demo import run_demo


def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the page.")] = Path("out/demo"),
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace an earlier demo in that folder.")
    ] = False,
) -> None:
    """Fly, capture and check 20 images, send 30 frames to a board process, and write a report page."""
    page = run_demo(
        output,
        board_command=(sys.executable, "-P", "-m", "flyaround", "hil", "board"),
        overwrite=overwrite,
        say=partial(say, stderr=True),
        progress_bar=progress_bar,
    )
    say(f"open {page}")
