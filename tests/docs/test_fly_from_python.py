"""The code block of docs/flight.md flies as it is written."""

from pathlib import Path

from tests.harness.tutorial import blocks


def test_the_block_of_the_page_flies(capsys):
    page = Path(__file__).parents[2] / "docs" / "flight.md"
    ((_, _, code),) = [block for block in blocks(page) if block[0] == "python"]
    exec(compile(code, str(page), "exec"), {})  # noqa: S102 - our own page
    assert capsys.readouterr().out.endswith("m/s, steer\n")
