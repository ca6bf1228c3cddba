"""plugins: entry points of other packages, and errors when importing them."""

from __future__ import annotations

import json
from typing import Annotated

import typer
from rich.table import Column, Table

from flyaround.cli.terminal import say, terminal
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.plugins import GROUPS, Plugin
from flyaround.simulator.runtime.plugins import plugins as plugins_of


def plugins(as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False) -> None:
    """List the sensors, formats, recipes, estimators, targets and bodies of installed packages (docs/plugins.md)."""
    plugins_by_kind = [plugin for kind in GROUPS for plugin in plugins_of(kind).values()]
    rows = [(plugin, _load_problem(plugin)) for plugin in plugins_by_kind]
    if as_json:
        fields = ("kind", "name", "package", "version")
        typer.echo(json.dumps([{**{f: getattr(p, f) for f in fields}, "problem": why} for p, why in rows]))
        return
    if not rows:
        say(f"no installed package has entry points of {', '.join(GROUPS.values())}")
        return
    table = Table("kind", "name", "package", Column("state", overflow="fold"))
    for plugin, why in rows:
        table.add_row(plugin.kind, plugin.name, f"{plugin.package} {plugin.version}", why or "ready")
    terminal().print(table)


def _load_problem(plugin: Plugin) -> str:
    """Return the reason why a plug-in cannot be used; empty if it can."""
    try:
        plugin.load()
    except UserError as error:
        return str(error)
    return ""
