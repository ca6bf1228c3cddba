"""Accuracy of the world: ``python -m tools.validation.dynamics`` measures it and writes the table.

It reads the raw outputs of independent programs from ``tests/reference``, so it runs from a checkout only.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from flyaround.simulator.runtime.files import write_atomic
from tools.validation.dynamics.independent import independent
from tools.validation.dynamics.physics import physics
from tools.validation.rows import Row, table_lines

if TYPE_CHECKING:
    from collections.abc import Callable

REFERENCE = Path("tests/reference")
PAGE = Path("docs/validation/dynamics.md")


def measure(reference: Path) -> list[Row]:
    """Return all rows of the table.

    Raises
    ------
    UserError
        If the reference outputs are missing.
    """
    return [*independent(reference), *physics()]


def page(rows: list[Row]) -> str:
    """Return the page with the table."""
    lines = [
        "# Accuracy of the world",
        "",
        "Made by `python -m tools.validation.dynamics` from the raw outputs of independent programs in",
        "`tests/reference` (their generators lie beside them) and from what physics conserves.",
        "",
        *table_lines(rows),
        "",
        "Basilisk was handed our EGM96 coefficients, Earth orientation and geometric Sun and Moon by message and",
        "integrated with its own force models: the comparison proves the equations and the integration, not the",
        "ephemeris; that is what the rows against Skyfield do. Drag and sunlight are tested against their formulas",
        "only. Skyfield's row leaves polar motion (up to 0.6 arcsec) out on both sides; astropy was handed our table",
        "of UT1 and pole and turns through the same SOFA routines.",
    ]
    return "\n".join(lines) + "\n"


def main(arguments: list[str] | None = None, say: Callable[[str], None] = print) -> int:
    """Measure, print and write the page; return 0 if every goal is met."""
    parser = argparse.ArgumentParser(description="Measure the accuracy of the world.")
    parser.add_argument("--reference", type=Path, default=REFERENCE, help="folder of the reference outputs")
    parser.add_argument("-o", "--output", type=Path, default=PAGE, help="page to write")
    options = parser.parse_args(arguments)
    rows = measure(options.reference)
    text = page(rows)
    write_atomic(options.output, text.encode())
    say(text)
    return 0 if all(row.passed for row in rows) else 1
