"""Every command but those that open panels, which `flyaround.gui.layout` adds."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flyaround.gui.command_table import Command

MODULES = "scenario time timeline steering guidance docking display camera views estimator hil capture people"
COMMANDS: tuple[Command, ...] = tuple(
    command
    for name in MODULES.split()
    for command in import_module(f"flyaround.gui.commands.{name}").COMMANDS
)
