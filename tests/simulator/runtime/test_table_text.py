"""No cell of a table is a formula, and each text comes back as it was."""

import pytest

from flyaround.simulator.runtime.table_text import table_text, text_of_table


@pytest.mark.parametrize(
    "text", ["=1+1", "+1", "-1", "@SUM(A1)", "'quoted", "''", "'", "\t=1", "\r=1", "=", "=cmd|' /C calc'!A0"]
)
def test_a_text_that_a_spreadsheet_would_take_for_a_formula_has_an_apostrophe(text):
    assert table_text(text) == f"'{text}"
    assert text_of_table(table_text(text)) == text


@pytest.mark.parametrize("text", ["", "a=1", "no pose", " =1", "0.5"])
def test_other_text_stays(text):
    assert table_text(text) == text == text_of_table(text)
