"""Commands that are imported when they are called: help names them all, one run loads only what it needs."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import typer
from typer.core import TyperGroup
from typer.main import get_command, get_group

from flyaround.commands.terminal import with_literal_help

COMMANDS = {
    "sim": "console",
    "render": "pictures",
    "fly": "flights",
    "capture": "datasets",
    "check": "datasets",
    "estimate": "estimation",
    "evaluate": "estimation",
    "compare": "compare",
    "bench": "bench",
    "doctor": "doctor",
    "scenarios": "flights",
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
    return import_module(f"flyaround.commands.{name}")
