"""The rendering page: rows that need no picture, and the page's shape."""

from dataclasses import replace

from tools.validation.rendering import report as rendering
from tools.validation.rows import Row


def test_a_goal_that_is_not_asked_of_a_preset_shows_and_does_not_fail_the_command(monkeypatch, tmp_path):
    page = tmp_path / "page.md"
    beside = Row(what="c", against="d", unit="1", goal=2.0, measured=3.0, asked=False)

    def command(rows):
        monkeypatch.setattr(rendering, "PARTS", (("Part", lambda _: rows, ""),))
        return rendering.main(["-o", str(page)], say=str)

    assert command([beside]) == 0
    assert "| c | d | 2 | 3 | above it, not asked here |" in page.read_text()
    assert command([beside, replace(beside, asked=True)]) == 1
