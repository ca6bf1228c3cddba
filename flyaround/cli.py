"""The command line: one application made of the command groups."""

from __future__ import annotations

import logging
from importlib.metadata import version
from typing import Annotated

import typer
from rich.console import Console
from rich.logging import RichHandler

from flyaround.commands import comparison, console, estimation, flights, hil, machine, pictures, targets

app = typer.Typer(
    name="flyaround",
    help="What a camera on a chaser sees of a spacecraft: pictures, truth, hardware in the loop.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
hil_app = typer.Typer(name="hil", help="Hardware in the loop: host, board, reports.", no_args_is_help=True)
targets_app = typer.Typer(
    name="targets",
    help="List the targets, add a mesh as one, export or draw them.",
    invoke_without_command=True,
)


def _show_version(value: bool) -> None:  # noqa: FBT001 - typer passes the flag's value
    if value:
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
    handler = RichHandler(console=Console(stderr=True), show_path=verbose > 1, rich_tracebacks=False)
    logging.basicConfig(level=level, format="%(name)s: %(message)s", handlers=[handler], force=True)


app.command()(console.sim)
app.command()(pictures.render)
app.command()(flights.fly)
app.command()(pictures.capture)
app.command()(pictures.check)
app.command()(estimation.estimate)
app.command()(estimation.evaluate)
app.command()(comparison.compare)
app.command()(machine.bench)
app.command()(machine.doctor)
app.command()(flights.scenarios)
app.command()(flights.cameras)
app.command()(machine.demo)
hil_app.command("host")(hil.host)
hil_app.command("board")(hil.board)
hil_app.command("bundle")(hil.bundle)
hil_app.command("report")(hil.report)
app.add_typer(hil_app)
targets_app.callback()(targets.overview)
targets_app.command("add")(targets.add)
targets_app.command("remove")(targets.remove)
app.add_typer(targets_app)
