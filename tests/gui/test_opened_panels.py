"""A panel that a command opens is in front, its tab in sight, and is framed for a moment."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from flyaround.gui.style import ACCENT
from tests.harness.pointer import Pointer


@pytest.fixture(params=((1280, 800), (800, 600)), ids=lambda s: f"{s[0]}x{s[1]}")
def at(request: pytest.FixtureRequest) -> Iterator[Pointer]:
    made = Pointer(size=request.param)
    # more panels than a strip of tabs has room for
    for panel in made.layout.panels:
        if panel.place in {"left", "right-low"}:
            made.console.do(f"panel.{panel.name}", True)
            made.turn()
    yield made
    made.close()


def tab(at: Pointer, title: str, name: str) -> tuple[float, float, float]:
    """Left and right edge of a panel's tab, and width of its strip of tabs [px]."""
    inner = at.window.plain.internal
    native = inner.find_window_by_name(f"{title}###{name}")
    bar = native.dock_node.tab_bar
    found = inner.tab_bar_find_tab_by_id(bar, native.tab_id)
    left = found.offset - bar.scrolling_anim
    return left, left + found.width, bar.scrolling_rect_max_x - bar.scrolling_rect_min_x


@pytest.mark.parametrize("name", ["editor", "estimator", "docking", "sensor"])
def test_a_command_brings_a_tab_into_sight(at: Pointer, name: str) -> None:
    title = next(p.title for p in at.layout.panels if p.name == name)
    at.console.do(f"panel.{name}", True)
    for _ in range(12):
        at.turn()
    left, right, width = tab(at, title, name)
    assert name not in at.console.help.behind
    assert left >= 0.0
    assert right <= width + 1.0


def test_it_is_framed_for_a_moment(at: Pointer) -> None:
    drawn: list[float] = []
    at.console.do("panel.sensor", True)
    for _ in range(13):
        at.turn()
        drawn += at.framed(ACCENT, at.rect("sensor")).values()
    assert 2 <= len(drawn) < 13
    assert drawn == sorted(drawn, reverse=True)


@pytest.mark.parametrize("hide", ["window.panels", "window.enlarge"])
def test_what_hides_it_gives_way(at: Pointer, hide: str) -> None:
    at.console.do(hide)
    at.turn()
    at.console.do("panel.sensor", True)
    for _ in range(12):
        at.turn()
    assert at.console.options.panel
    assert not at.console.window.enlarged
    assert "sensor" not in at.console.help.behind
