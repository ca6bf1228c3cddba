"""Untrusted text in CSV tables, escaped so that spreadsheets do not interpret it as a formula."""

from __future__ import annotations

# first characters of a formula, and the mark of a plain text
FORMULA_BEGINNINGS = ("=", "+", "-", "@", "'", "\t", "\r")


def table_text(text: str) -> str:
    """Return a text, with an apostrophe before it if a spreadsheet would take it for a formula."""
    return f"'{text}" if text.startswith(FORMULA_BEGINNINGS) else text


def text_of_table(cell: str) -> str:
    """Return the original text of a cell that `table_text` made."""
    return cell[1:] if cell[:1] == "'" and cell[1:].startswith(FORMULA_BEGINNINGS) else cell
