"""The command line: one application, each of whose commands is imported when it is called."""

from __future__ import annotations

import logging
from typing import Annotated

import typer
from rich.logging import RichHandler

from flyaround.commands.lazy import LazyCommands
from flyaround.commands.terminal import terminal

app = typer.Typer(
    name="flyaround",
    cls=LazyCommands,
    help="What a camera on a chaser sees of a spacecraft: pictures, truth, hardware in the loop.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(value: bool) -> None:  # noqa: FBT001 - typer passes the flag's value
    if value:
        from importlib.metadata import version  # noqa: PLC0415 - slow to import, needed here alone

        typer.echo(version("flyaround"))
        raise typer.Exit


@app.callback()
def options(
    verbose: Annotated[
        int, typer.Option("--verbose", "-v", count=True, help="More log lines; twice for debugging.")
    ] = 0,
    *,
    _version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Options of every command."""
    level = (logging.WARNING, logging.INFO, logging.DEBUG)[min(verbose, 2)]
    handler = RichHandler(console=terminal(stderr=True), show_path=verbose > 1, rich_tracebacks=False)
    logging.basicConfig(level=level, format="%(name)s: %(message)s", handlers=[handler], force=True)
