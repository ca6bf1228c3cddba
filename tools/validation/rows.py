"""Rows of an accuracy page: quantity, reference, goal and measurement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from pathlib import Path

    from flyaround.simulator.runtime.arrays import FloatArray


@dataclass(frozen=True, kw_only=True)
class Row:
    """One line of the table.

    Attributes
    ----------
    what : str
        Quantity that is compared.
    against : str
        Reference.
    unit : str
        Unit of goal and measurement.
    goal : float
        Largest difference allowed.
    measured : float
        Largest difference measured.
    asked : bool, optional
        False for a figure without its own goal, reported next to that of another row.
    """

    what: str
    against: str
    unit: str
    goal: float
    measured: float
    asked: bool = True

    @property
    def met(self) -> bool:
        """True if the goal is reached."""
        return self.measured <= self.goal

    @property
    def passed(self) -> bool:
        """True if the goal is reached, or not required here."""
        return self.met or not self.asked

    @property
    def verdict(self) -> str:
        """Last cell of the table's row."""
        if self.met:
            return "met"
        return "**missed**" if self.asked else "above it, not asked here"


def table_lines(rows: list[Row]) -> list[str]:
    """Return the lines of a Markdown table of rows."""
    lines = ["| quantity | against | goal | measured | |", "|---|---|---|---|---|"]
    for row in rows:
        unit = "" if row.unit == "1" else f" {row.unit}"
        lines.append(
            f"| {row.what} | {row.against} | {row.goal:g}{unit} | {row.measured:.2g}{unit} | {row.verdict} |"
        )
    return lines


def arcsec(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the angles between (..., 3) directions [arcsec], accurate for small angles."""
    sine = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.asarray(np.degrees(np.arctan2(sine, np.sum(a * b, axis=-1))) * 3600)


def read_table(path: Path) -> FloatArray:
    """Return the numbers of a reference output.

    Raises
    ------
    UserError
        If the file is missing.
    """
    require_reference(path)
    return np.genfromtxt(path, delimiter=",", skip_header=1)


def require_reference(path: Path) -> None:
    """Raise if a reference output is missing.

    Raises
    ------
    UserError
        If the file is missing.
    """
    if not path.is_file():
        raise UserError(
            f"there is no reference output {path}: run from the root of a checkout, or give --reference"
        )
