"""Fields of panels: Enter does what the button beside it does, and a search that finds nothing says so."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from flyaround.gui.console import Console
from flyaround.gui.panels.key_list import KeyList
from flyaround.gui.panels.scenarios import ScenarioChooser
from flyaround.gui.widgets import Panel
from tests.harness.flown_console import console_flying


@pytest.fixture(scope="module")
def console() -> Iterator[Console]:
    console = console_flying("tango-space-10m")
    yield console
    console.close()


def type_into(panel: Panel, field: str, text: str, window: Any, console: Console) -> set[str]:
    """Click a field, type a text and Enter; return the texts that were on the panel before Enter."""
    io, enter = window.plain.get_io(), window.plain.Key.enter

    def turn() -> None:
        window.noted.clear()
        with window.panel("pressed", 420.0, 780.0):
            panel.draw(console)

    window.press(field, lambda: panel.draw(console))
    io.add_input_characters_utf8(text)
    for _ in range(3):
        turn()
    texts = {n.label for n in window.noted if n.what == "text"}
    for down in (True, False):
        io.add_key_event(enter, down)
        turn()
    return texts


def test_enter_opens_the_file_whose_path_was_typed(window: Any, console: Console) -> None:
    type_into(ScenarioChooser(window), "##find", "/nowhere/mine.toml", window, console)
    opened = [line.arguments for line in console.log.lines if line.name == "scenario.open"]
    assert opened == [("/nowhere/mine.toml",)]


def test_enter_after_words_opens_nothing(window: Any, console: Console) -> None:
    before = len(console.log.lines)
    type_into(ScenarioChooser(window), "##find", "tango", window, console)
    assert len(console.log.lines) == before


@pytest.mark.parametrize(("words", "empty"), [("lampion", True), ("light", False)])
def test_a_search_that_finds_no_command_says_so(
    window: Any, console: Console, words: str, *, empty: bool
) -> None:
    texts = type_into(KeyList(window), "##find", words, window, console)
    assert (f"no command has '{words}'" in texts) is empty


def search(window: Any, console: Console, words: str) -> KeyList:
    """Type words into the list of commands, without Enter."""
    panel = KeyList(window)
    window.press("##find", lambda: panel.draw(console))
    window.plain.get_io().add_input_characters_utf8(words)
    for _ in range(3):
        window.noted.clear()
        with window.panel("pressed", 420.0, 780.0):
            panel.draw(console)
    return panel


def test_commands_with_a_word_that_begins_as_typed_come_first(window: Any, console: Console) -> None:
    search(window, console, "light")
    height = {n.label: n.middle[1] for n in window.noted if n.what == "text"}
    assert height["Add light"] < height["open or close: Kept flights"]


def test_the_list_of_commands_closes_when_one_is_clicked(window: Any, console: Console) -> None:
    console.open_panel("keys", shown=True)
    panel = search(window, console, "night lights")
    before = len(console.log.lines)
    window.press("Night lights", lambda: panel.draw(console))
    assert [line.name for line in console.log.lines[before:]] == ["world.night-lights"]
    assert not console.shown["keys"]


@pytest.mark.parametrize(
    ("typed", "done"),
    [
        ("time.rate 10", "time.rate 10"),
        ("time.rat 10", "time.rate 10"),
        ("next eclipse", "time.next-eclipse"),
        ("", ""),
    ],
)
def test_enter_does_the_typed_command_or_the_first_match(
    window: Any, console: Console, typed: str, done: str
) -> None:
    before = len(console.log.lines)
    type_into(KeyList(window), "##find", typed, window, console)
    lines = [str(line).split(maxsplit=1)[1] for line in console.log.lines[before:]]
    assert lines == [done] * bool(done)
