"""Text of others in CSV tables, which no spreadsheet is to take for a formula."""

from __future__ import annotations

# what a spreadsheet begins a formula with, and the mark that says that a text is none
FORMULA_BEGINNINGS = ("=", "+", "-", "@", "'", "\t", "\r")


def table_text(text: str) -> str:
    """Return a text with an apostrophe before it where a spreadsheet would take it for a formula."""
    return f"'{text}" if text.startswith(FORMULA_BEGINNINGS) else text


def text_of_table(cell: str) -> str:
    """Return the text of a cell that `table_text` made."""
    return cell[1:] if cell[:1] == "'" and cell[1:].startswith(FORMULA_BEGINNINGS) else cell
