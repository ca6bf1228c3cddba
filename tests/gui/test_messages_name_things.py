"""Every sentence that a wrong value brings names what is wrong as the panels name it, with its unit."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import product

import pytest

from flyaround.gui.command_table import Argument, Command
from flyaround.gui.console import Console
from flyaround.gui.picture.sensor_terms import terms_of
from flyaround.gui.picture.view_settings import Options
from flyaround.gui.texts import texts
from tests.harness.flown_console import console_flying

INTERNAL = re.compile(r"\b[a-z0-9]+_[a-z0-9_]+\b|\b[a-z-]+\.[a-z]{3,}(?:-[a-z]+)*\b")
"""Identifiers of the code, and names of commands, but no files."""
CHOICES = re.compile("allowed: [a-z, _]*clock_drift")  # kinds of faults, of which a script names one
FILES = re.compile(r"\S*/\S*|\.\w+\b|'[^']*'")
WRONG = {
    "number": ("abc", "", "nan", "1e99", "-1e99"),
    "time": ("abc", "", "nan", "1e99", "-1", "1:99"),
    "whole": ("abc", "", "2.5", "99999999", "-1"),
    "word": ("", "no-such"),
    "switch": ("perhaps", ""),
}
BEGIN_PROGRAMS = frozenset({"capture", "hil", "film", "file", "scenario"})
"""Groups whose texts may be files or programs, which are given no words that could be right."""


@pytest.fixture
def console(tmp_path: object, monkeypatch: pytest.MonkeyPatch) -> Iterator[Console]:
    monkeypatch.chdir(str(tmp_path))
    made = console_flying("tango-eclipse-lamp")
    yield made
    made.close()


def right(argument: Argument) -> str:
    """A value that is allowed."""
    if argument.kind in {"word", "switch"}:
        return argument.choices[0] if argument.choices else "on"
    return f"{max(argument.least, 0.0):.0f}"


def attempts(command: Command) -> Iterator[tuple[str, ...]]:
    """Values of which one is wrong, too few and too many."""
    for k, argument in enumerate(command.arguments):
        for wrong in WRONG[argument.kind]:
            if not argument.flaw(wrong, "") and command.group in BEGIN_PROGRAMS:
                continue
            yield (*map(right, command.arguments[:k]), wrong, *map(right, command.arguments[k + 1 :]))
    if not command.at_once:
        yield ()
    yield ("x",) * (len(command.arguments) + 1)


def flawed(sentences: list[str]) -> list[str]:
    """Sentences with internal names."""
    return [s for s in sentences if INTERNAL.search(FILES.sub("", CHOICES.sub("", s)))]


def test_no_command_answers_a_wrong_value_with_an_internal_name(console: Console) -> None:
    sentences = []
    for command in console.table:
        if command.held or command.name in {"window.close", "window.quit", "sensor.set", "light.set"}:
            continue
        tried = attempts(command)
        sentences += [console.attempt(command.name, *values, asks=False) for values in tried]
    sentences += [m.text for m in console.messages]
    assert len(set(sentences)) > 300
    assert flawed(sentences) == []


@pytest.mark.parametrize("scenario", ["geo-inspection", "tango-eclipse-pass"])
def test_a_sensors_value_is_named_with_its_unit(scenario: str) -> None:
    console = console_flying(scenario)
    for term in terms_of(console.session.scene().sensor):
        for wrong in ("abc", "", "nan", "-1e30"):
            sentence = console.attempt("sensor.set", term.name, wrong)
            assert sentence.startswith(f"{term.text} is "), sentence
            assert flawed([sentence]) == []
    console.close()


def test_a_lights_value_is_named_with_its_unit(console: Console) -> None:
    console.do("light.add", "box")
    for (k, kind), wrong in product(enumerate(console.options.settings.lights or ()), ("abc", "", "nan")):
        for name in kind.light.__struct_fields__:
            sentence = console.attempt("light.set", k, name, wrong)
            if (name, wrong) != ("direction", "nan"):
                assert sentence.startswith(f"{texts('lights')[name][0]} is "), sentence
            assert flawed([sentence]) == []


@pytest.mark.parametrize(
    ("name", "values", "sentence"),
    [
        ("time.rate", (), "Rate needs rate"),
        ("time.rate", ("3",), "rate is '3', allowed: 0.1, 0.2"),
        ("burn.plan", (1.0, 0.0), "Plan a burn needs along [m/s], cross [m/s]"),
        ("burn.plan", ("abc", 0.0, 0.0, 0.0), "Plan a burn: time [h:min:s or s] is 'abc', "),
        ("time.pause", ("now",), "Pause takes no values, and 1 were given"),
    ],
)
def test_a_wrong_value_is_named_as_the_panel_names_it(
    console: Console, name: str, values: tuple[str, ...], sentence: str
) -> None:
    assert console.attempt(name, *values).startswith(sentence)


def test_an_undone_change_is_named_as_the_panel_names_it(console: Console) -> None:
    for name, values in (("sensor.set", ("bits", 10)), ("light.set", (0, "power_w", "55"))):
        console.do(name, *values)
        console.do("settings.undo")
    undone = [m.text for m in console.messages if m.text.startswith("undone")]
    assert undone[0].startswith("undone: Depth [bit] from 8 to 10")
    assert undone[1].startswith("undone: Power [W] of the lamp on the chaser from 40 to 55")
    assert console.options.settings == Options(console.options.settings).settings
