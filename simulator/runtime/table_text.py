"""CSV tables, and untrusted text in them, escaped so that spreadsheets do not interpret it as a formula."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

# first characters of a formula, and the mark of a plain text
FORMULA_BEGINNINGS = ("=", "+", "-", "@", "'", "\t", "\r")


def table_text(text: str) -> str:
    """Return a text, with an apostrophe before it if a spreadsheet would take it for a formula."""
    return f"'{text}" if text.startswith(FORMULA_BEGINNINGS) else text


def text_of_table(cell: str) -> str:
    """Return the original text of a cell that `table_text` made."""
    return cell[1:] if cell[:1] == "'" and cell[1:].startswith(FORMULA_BEGINNINGS) else cell


def table_bytes(*lines: Iterable[object], rows: Iterable[Iterable[object]] = ()) -> bytes:
    """Return a CSV table in UTF-8: ``lines``, usually the names of the columns, and ``rows``."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows((*lines, *rows))
    return text.getvalue().encode()
