"""Frames that draw attention to a panel, a field or a line lie in their panel, below dialogs, menus and hover texts."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from flyaround.gui import style
from flyaround.gui.panels.tour import STEPS, TourStep
from tests.harness.legibility import VERTEX, array_of
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
    screen.console.help.tour_step = next(k for k, s in enumerate(STEPS) if s.place == "camera")
    for _ in range(9):
        screen.turn()


CASES: dict[str, tuple[Callable[[Pointer], None], style.Rgba, str]] = {
    "an opened panel": (open_a_panel, style.ACCENT, "sensor"),
    "a step of the tour": (start_the_tour, style.ACCENT, "camera"),
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
    assert framed
    names = [part._owner_name for part in screen.window.plain.get_draw_data().cmd_lists]
    dialog = next(k for k, name in enumerate(names) if name.startswith("Quit?"))
    assert all(names.index(name) < dialog for name in framed)


@pytest.mark.parametrize("step", STEPS, ids=lambda s: s.place)
def test_the_tour_frames_what_a_step_is_about(screen: Pointer, step: object) -> None:
    screen.console.open_panel("tour", shown=True)
    screen.console.help.tour_step = STEPS.index(step)
    for _ in range(12):
        screen.turn()
    assert screen.framed(style.ACCENT, screen.rect(STEPS[STEPS.index(step)].place))


@pytest.mark.parametrize("step", STEPS, ids=lambda s: s.place)
def test_the_tour_writes_over_no_control(screen: Pointer, step: TourStep) -> None:
    screen.console.open_panel("tour", shown=True)

    def inside(k: int) -> int:
        screen.console.help.tour_step = k
        for _ in range(12):
            screen.turn()
        x, y, width, height = screen.rect(step.place)
        colour, count = int(screen.layout._w.color(style.ACCENT)), 0
        for part in screen.window.plain.get_draw_data().cmd_lists:
            drawn = array_of(part.vtx_buffer, VERTEX)
            at = drawn["at"][drawn["colour"] == colour] - (x + 6.0, y + 6.0)
            count += int(np.sum(np.all((at > 0.0) & (at < (width - 12.0, height - 12.0)), axis=1)))
        return count

    assert inside(STEPS.index(step)) == inside(len(STEPS))
