"""The command line: one application, each of whose commands is imported when it is called."""

from __future__ import annotations

import logging
from importlib import import_module
from typing import Annotated, Any

import typer
from rich.logging import RichHandler
from typer.core import TyperGroup
from typer.main import get_command, get_group

from flyaround.cli.terminal import terminal, with_literal_help

COMMANDS = {
    "sim": "console",
    "render": "pictures",
    "fly": "flights",
    "capture": "datasets",
    "check": "datasets",
    "convert": "conversion",
    "overlay": "overlay",
    "estimate": "estimation",
    "evaluate": "estimation",
    "train": "training",
    "compare": "compare",
    "bench": "bench",
    "doctor": "doctor",
    "plugins": "plugins",
    "scenarios": "flights",
    "recipes": "recipes",
    "backgrounds": "recipes",
    "cameras": "flights",
    "demo": "demo",
}
"""Where each command lives, in the order of the help page."""
GROUPS = {"hil": "hil", "targets": "targets"}
"""Modules whose ``app`` is a group of commands."""


class LazyCommands(TyperGroup):
    """The commands of the two tables above."""

    def __init__(self, **options: Any) -> None:  # noqa: ANN401 - click's own
        super().__init__(**options)
        with_literal_help(self)

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ANN401, ARG002 - click's own signature
        """Names, in the order of the help page."""
        return [*COMMANDS, *GROUPS]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ANN401 - click's own signature
        """One command, its module imported now; ``None`` where there is no such name."""
        if cmd_name in GROUPS:
            if cmd_name not in self.commands:
                self.add_command(with_literal_help(get_group(_module(GROUPS[cmd_name]).app)), cmd_name)
        elif cmd_name in COMMANDS and cmd_name not in self.commands:
            one = typer.Typer(add_completion=False)
            one.command(cmd_name)(getattr(_module(COMMANDS[cmd_name]), cmd_name))
            self.add_command(with_literal_help(get_command(one)), cmd_name)
        elif cmd_name not in self.commands:
            # the parent class proposes the nearest of the names that it knows
            for name in self.list_commands(ctx):
                self.get_command(ctx, name)
        return self.commands.get(cmd_name)


def _module(name: str) -> Any:  # noqa: ANN401 - a module has the attributes that it has
    return import_module(f"flyaround.cli.{name}")


app = typer.Typer(
    name="flyaround",
    cls=LazyCommands,
    help="What a camera on a chaser sees of a spacecraft: pictures, truth, hardware in the loop.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(value: bool) -> None:
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
