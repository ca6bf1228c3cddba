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
    """Escape a text for a cell of a table.

    Returns
    -------
    str
        Text, with an apostrophe before it if a spreadsheet would take it for a formula.
    """
    return f"'{text}" if text.startswith(FORMULA_BEGINNINGS) else text


def text_of_table(cell: str) -> str:
    """Return the original text of a cell that `table_text` made.

    Returns
    -------
    str
        Text without the apostrophe of `table_text`; a cell that it left as it was is returned unchanged.
    """
    return cell[1:] if cell[:1] == "'" and cell[1:].startswith(FORMULA_BEGINNINGS) else cell


def table_bytes(*lines: Iterable[object], rows: Iterable[Iterable[object]] = ()) -> bytes:
    """Write a CSV table of ``lines``, usually the names of the columns, and ``rows``.

    Returns
    -------
    bytes
        Table in UTF-8 without a byte-order mark, its lines ended by a line feed.
    """
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows((*lines, *rows))
    return text.getvalue().encode()
