"""Texts that are cut in a line are read whole by hovering, and in the log, which wraps."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from flyaround.gui.status_line import message_texts
from tests.harness.legibility import VERTEX, array_of
from tests.harness.pointer import Pointer

LONG = (
    "not saved: cannot write /home/operator/flights/2026-11-30/rendezvous-with-a-very-long-name/"
    + "one-more-folder-whose-name-has-no-spaces-at-all/" * 4
    + "tango.png: No space left on device; free some, or choose another folder in Capture"
)


@pytest.fixture(params=[(1280, 800), (800, 600)], ids=lambda s: f"{s[0]}x{s[1]}")
def screen(request: pytest.FixtureRequest) -> Iterator[Pointer]:
    made = Pointer("tango-flyaround", request.param, panels=False, opened=("capture",))
    yield made
    made.close()


def hover(screen: Pointer, beginning: str) -> list[str]:
    """Rest the pointer on the last text with this beginning; return the texts that this adds."""
    place = [n.middle for n in screen.window.noted if n.what == "text" and n.label.startswith(beginning)][-1]
    before = screen.texts()
    for _ in range(8):
        screen.move(place)
    return [text for text in screen.texts() if text not in before]


@pytest.mark.parametrize("level", ["note", "caution"])
@pytest.mark.parametrize("typing", [False, True])
def test_a_long_message_is_read_by_hovering(screen: Pointer, level: str, *, typing: bool) -> None:
    if typing:
        screen.click(screen.place("##frames"))
    screen.console.say(LONG, level)
    screen.turn()
    assert LONG not in screen.texts()
    assert any(LONG in text for text in hover(screen, "not saved"))


def test_a_long_reason_of_a_refused_number_is_read_by_hovering(screen: Pointer) -> None:
    screen.click(screen.place("##frames"))
    for _ in range(12):
        # as a panel's field does in each frame
        screen.window.flaw = LONG
        place = [
            n.middle for n in screen.window.noted if n.what == "text" and n.label.startswith("not saved")
        ]
        screen.move(place[0] if place else (0.0, 0.0))
    assert any(LONG in text for text in screen.texts())


def test_a_message_of_two_lines_stands_in_one() -> None:
    screen = Pointer(panels=False)
    screen.console.say("the first half\nand the second")
    assert message_texts(screen.console)[0][0] == "the first half and the second"
    screen.close()


def test_the_log_wraps_messages_at_its_edge(screen: Pointer) -> None:
    screen.console.open_panel("log", shown=True)
    screen.console.say(LONG, "caution")
    for _ in range(4):
        screen.turn()
    x, _, wide, _ = screen.rect("log")
    parts = {p._owner_name: p for p in screen.window.plain.get_draw_data().cmd_lists}
    drawn = array_of(next(p for name, p in parts.items() if "###log" in name).vtx_buffer, VERTEX)["at"]
    assert np.all((x <= drawn[:, 0]) & (drawn[:, 0] <= x + wide))
    assert f"caution: {LONG}" in screen.texts()


@pytest.mark.parametrize("width", [160.0, 300.0])
def test_a_panels_cut_text_is_read_by_hovering(screen: Pointer, width: float) -> None:
    window = screen.window
    told: list[str] = []
    for name in ("capture", "sensor", "plots", "board-link"):
        panel = next(p for p in screen.layout.panels if p.name == name)
        screen.console.jobs.hil.board_name = "a board with a rather long name of its own"
        for _ in range(2):
            window.noted.clear()
            with window.panel(name, width, 900.0):
                panel.draw(screen.console)
        cut = [n for n in window.noted if n.what == "text" and n.label.endswith("...")]
        for text in cut:
            for _ in range(8):
                window.plain.get_io().add_mouse_pos_event(*text.middle)
                window.noted.clear()
                with window.panel(name, width, 900.0):
                    panel.draw(screen.console)
            tips = window.noted
            if not any(n.label.startswith(text.label[:-3]) and n.label != text.label for n in tips):
                told.append(f"{name}: {text.label}")
    assert told == []


AUTOPILOT = (
    "the autopilot flies to H1, 20 m before the port, but the keep-out sphere of 12 m stops the chaser: "
    "the port turns 163° away from its corridor of 15°"
)


def test_a_caution_and_the_message_after_it_have_a_line_each(screen: Pointer) -> None:
    screen.console.say("the view is filmed into out/console/film.mp4")
    screen.console.say(AUTOPILOT, "caution")
    screen.turn()
    low, high = screen.rect("status")[1::2]
    assert AUTOPILOT.partition(":")[0] in " ".join(screen.texts())
    screen.console.say("the estimator is ready")
    screen.turn()
    places = {n.label: n.middle for n in screen.window.noted}
    (_, first), (x, second) = (
        next(at for label, at in places.items() if label.startswith(start))
        for start in ("the autopilot flies", "the estimator is")
    )
    assert low < first < second < low + high
    screen.click((x, second))
    assert screen.console.shown["log"]


def test_a_caution_alone_is_whole_in_two_lines() -> None:
    screen = Pointer("tango-flyaround", (1280, 800), panels=False)
    before = screen.rect("transport")
    screen.console.say(f"{AUTOPILOT}; {AUTOPILOT[:60]}", "caution")
    screen.turn()
    said = [t for t in screen.texts() if t in f"{AUTOPILOT}; {AUTOPILOT[:60]} (F9: seen)" and len(t) > 20]
    assert " ".join(said) == f"{AUTOPILOT}; {AUTOPILOT[:60]} (F9: seen)"
    assert screen.rect("transport") == before
    screen.close()
