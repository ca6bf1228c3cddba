"""A double click in a number field selects the number, also in a slow window: typing replaces it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.harness.pointer import Pointer


@pytest.fixture
def screen() -> Iterator[Pointer]:
    made = Pointer("tango-vbar-approach", panels=False)
    yield made
    made.close()


def replace_number(screen: Pointer, field: str, text: str, *, at: float) -> str:
    """Double click in a field, a share ``at`` of its width from its middle, and type; return what it then has."""
    imgui, io = screen.window.plain, screen.window.plain.get_io()
    shown: dict[str, str] = {}
    spans: dict[str, tuple[float, float, float]] = {}
    real = imgui.input_text

    def input_text(label: str, text: str, *rest: object) -> object:
        given = real(label, text, *rest)
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        shown[label], spans[label] = given[1], (low.x, high.x, (low.y + high.y) / 2)
        return given

    screen.window.imgui.input_text = input_text
    for _ in range(4):
        screen.turn()
    left, right, y = spans[field]
    screen.move(((left + right) / 2 + at * (right - left), y))
    for down in (True, False, True, False):
        io.add_mouse_button_event(0, down)
        screen.turn()
    io.add_input_characters_utf8(text)
    screen.turn()
    screen.turn()
    return shown[field]


FIELDS = (
    ("steering", "##t0"),
    ("steering", "##v01"),
    ("steering", "##point1"),
    ("sensor", "##gaussian_variance"),
    ("capture", "##frames"),
    ("board-link", "##seconds"),
)


@pytest.mark.parametrize("at", [-0.4, 0.4], ids=["on it", "right of it"])
@pytest.mark.parametrize(("panel", "field"), FIELDS)
def test_typing_after_a_double_click_replaces_the_number(
    screen: Pointer, panel: str, field: str, at: float
) -> None:
    screen.console.do("time.pause")
    screen.console.do("burn.plan", 500.0, -0.02, 0.01, 0.0)
    screen.console.open_panel(panel, shown=True)
    assert replace_number(screen, field, "71", at=at) == "71"
