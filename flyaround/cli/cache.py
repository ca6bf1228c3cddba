"""cache: list or remove the data kept on this machine between runs."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Annotated

import typer
from rich.table import Column, Table

from flyaround.cli.terminal import say, terminal
from flyaround.simulator.runtime.cache import cache_folder
from flyaround.simulator.runtime.cache_contents import (
    SIZE_VARIABLE,
    cache_kinds,
    clear_cache,
    max_cache_bytes,
)

MB = 1e6  # bytes per megabyte, the decimal unit that disk tools print


def cache(
    *,
    clear: Annotated[
        bool, typer.Option("--clear", help="Remove everything; it is created again when needed.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """List the data cached between runs (decoded maps, baked light, targets), or remove it."""
    freed_bytes = clear_cache() if clear else 0
    kinds, limit_bytes = cache_kinds(), max_cache_bytes()
    total = sum(kind.size_bytes for kind in kinds)
    if as_json:
        typer.echo(
            json.dumps(
                {
                    "folder": str(cache_folder()),
                    "size_bytes": total,
                    "most_bytes": limit_bytes,
                    "removed_bytes": freed_bytes,
                    "kinds": [asdict(kind) for kind in kinds],
                }
            )
        )
        return
    if clear:
        say(f"removed {freed_bytes / MB:.0f} MB from {cache_folder()}")
        return
    table = Table("kind", Column("files", justify="right"), Column("MB", justify="right"))
    for kind in kinds:
        table.add_row(kind.name, str(kind.files), f"{kind.size_bytes / MB:.1f}")
    terminal().print(table)
    say(f"{cache_folder()}: {total / MB:.0f} MB, kept under {limit_bytes / MB:.0f} MB ({SIZE_VARIABLE})")
