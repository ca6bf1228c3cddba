"""Frames that draw attention to a panel, a field or a line lie in their panel, below dialogs, menus and hover texts."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from flyaround.gui import style
from flyaround.gui.panels.tour import STEPS
from tests.harness.pointer import Pointer


@pytest.fixture
def screen() -> Iterator[Pointer]:
    made = Pointer("tango-flyaround")
    made.console.do("time.pause")
    made.console.do("steer.toggle")
    yield made
    made.close()


def refuse_a_number(screen: Pointer) -> None:
    screen.console.open_panel("sensor", shown=True)
    for _ in range(9):
        screen.turn()
    screen.type(screen.sight("##bits"), "99")


def break_a_line(screen: Pointer) -> None:
    draft = screen.console.draft
    draft.edit("tango-flyaround")
    draft.text, draft.changed = "!" + draft.text, True
    screen.console.do("scenario.check")
    assert draft.problem_line is not None
    screen.console.open_panel("editor", shown=True)
    for _ in range(9):
        screen.turn()


def open_a_panel(screen: Pointer) -> None:
    screen.console.open_panel("sensor", shown=True)
    screen.turn()


def start_the_tour(screen: Pointer) -> None:
    screen.console.open_panel("tour", shown=True)
    screen.console.help.tour_step = next(k for k, s in enumerate(STEPS) if s.place == "chaser")
    for _ in range(9):
        screen.turn()


CASES: dict[str, tuple[Callable[[Pointer], None], style.Rgba, str]] = {
    "an opened panel": (open_a_panel, style.ACCENT, "sensor"),
    "a step of the tour": (start_the_tour, style.ACCENT, ""),
    "a refused number": (refuse_a_number, style.BAD, ""),
    "a wrong line": (break_a_line, style.BAD, ""),
}


@pytest.mark.parametrize("case", CASES)
def test_a_dialog_lies_above_every_frame(screen: Pointer, case: str) -> None:
    show, colour, panel = CASES[case]
    show(screen)
    screen.console.do("window.quit")
    for _ in range(3):
        screen.turn()
    if case == "an opened panel":
        # the dialog was the last that a command opened
        show(screen)
        screen.turn()
    framed = screen.framed(colour, screen.rect(panel) if panel else None)
    if case == "a step of the tour":
        # the dialog has titles of the same colour
        framed = {name: framed[name] for name in framed if "chaser" in name}
    assert framed
    names = [part._owner_name for part in screen.window.plain.get_draw_data().cmd_lists]
    dialog = next(k for k, name in enumerate(names) if name.startswith("Quit?"))
    assert all(names.index(name) < dialog for name in framed)
