"""Radiometry of rendered images: ``python -m tools.validation.rendering`` measures it and writes the table.

Each module of ``PARTS`` yields rows by its function ``rows(renderer)``.
"""

from __future__ import annotations

import argparse
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from flyaround.simulator.dataset.card import describe_machine
from flyaround.simulator.errors import UserError
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.runtime.files import write_atomic
from tools.validation.rendering import (
    air as rendering_air,
)
from tools.validation.rendering import (
    colours as rendering_colours,
)
from tools.validation.rendering import (
    craft as rendering_craft,
)
from tools.validation.rendering import (
    earth as rendering_earth,
)
from tools.validation.rendering import (
    sky as rendering_sky,
)
from tools.validation.rendering import (
    surfaces as rendering_surfaces,
)
from tools.validation.rows import Row, table_lines

if TYPE_CHECKING:
    from collections.abc import Callable

PAGE = Path("docs/validation/rendering.md")
Part = tuple[str, "Callable[[Renderer], list[Row]]", str]
PARTS: tuple[Part, ...] = (
    ("Earth, air, Moon, Sun and stars", rendering_earth.rows, rendering_earth.NOTES),
    ("Scattering in the air", rendering_air.rows, rendering_air.NOTES),
    (
        "The Earth from above: day side by kind, city lights",
        rendering_surfaces.rows,
        rendering_surfaces.NOTES,
    ),
    ("Colour of limb and ground", rendering_colours.rows, rendering_colours.NOTES),
    ("Limb, star, penumbra, moonlight", rendering_sky.rows, rendering_sky.NOTES),
    ("The spacecraft", rendering_craft.rows, rendering_craft.NOTES),
)


def page(tables: list[tuple[str, list[Row], str]], driver: str) -> str:
    """Return the page with the tables."""
    lines = [
        "# Radiance of the picture",
        "",
        f"Made by `python -m tools.validation.rendering` with {driver}; goals are upper bounds.",
    ]
    for title, rows, notes in tables:
        lines += ["", f"## {title}", "", *table_lines(rows), "", notes.strip()]
    return "\n".join(lines) + "\n"


def main(arguments: list[str] | None = None, say: Callable[[str], None] = print) -> int:
    """Measure, print and write the page; return 0 if every requested goal is met."""
    parser = argparse.ArgumentParser(description="Measure the radiance of the picture.")
    parser.add_argument("-o", "--output", type=Path, default=PAGE, help="page to write")
    options = parser.parse_args(arguments)
    try:
        with Renderer() as renderer:
            tables = [(title, rows(renderer), notes) for title, rows, notes in PARTS]
            info = renderer.info
            cpu = describe_machine(info.vendor, info.renderer, info.version).cpu
            text = page(tables, f"{info.renderer} on {cpu}, {datetime.now(UTC):%Y-%m-%d}")
    except UserError as error:
        say(f"rendering: {error}")
        return 2
    write_atomic(options.output, text.encode())
    say(text)
    return 0 if all(row.passed for _, rows, _ in tables for row in rows) else 1
