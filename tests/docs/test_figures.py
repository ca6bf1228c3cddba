"""A figure has one value in the documents, and one place."""

from pathlib import Path

from tools.docs.figures import all_statements, repeated, statements


def test_no_statement_occurs_twice_with_other_figures() -> None:
    pairs = [(a, b) for a, b in repeated(all_statements()) if a.figures != b.figures]
    assert not pairs, "\n".join(f"{a.page}: {a.text}\n{b.page}: {b.text}" for a, b in pairs)


def test_a_contradiction_between_two_pages_is_found() -> None:
    one = statements(
        Path("a.md"), "The estimator takes 12 ms a frame on one core of the laptop in single precision."
    )
    two = statements(
        Path("b.md"), "On one core of the laptop the estimator takes 15 ms a frame in single precision."
    )
    ((a, b),) = repeated([*one, *two])
    assert (a.figures, b.figures) == ({("12", "ms")}, {("15", "ms")})


def test_every_measured_row_names_the_command_that_made_it() -> None:
    rows = [s for s in all_statements() if s.page.parts[0] == "validation" and s.text.startswith("|")]
    assert len(rows) > 100
    assert [f"{s.page}: {s.text}" for s in rows if not s.source] == []


def test_the_source_is_the_last_command_before_a_figure() -> None:
    text = "Made by `flyaround bench`: 12 ms.\n\n```\nmake bench\n```\n\n| row | 15 ms |\n"
    assert [s.source for s in statements(Path("a.md"), text)] == ["flyaround bench", "make bench"]


def test_code_and_other_subjects_are_left_alone() -> None:
    assert not statements(Path("a.md"), "```\nsleep for 12 ms\n```\n")
    one = statements(Path("a.md"), "The estimator takes 12 ms a frame on one core of the laptop.")
    two = statements(Path("b.md"), "A packet waits 15 ms in the line's buffer before the host reads it.")
    assert not list(repeated([*one, *two]))
