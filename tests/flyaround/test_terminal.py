"""What is printed is what was written: square brackets, paths in one piece, no mark-up of Rich's."""

from __future__ import annotations

import ast
import re
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.main import get_command, get_group
from typer.testing import CliRunner

from flyaround.cli import COMMANDS, GROUPS, app
from flyaround.commands import doctor
from flyaround.commands.terminal import say

FLYAROUND = Path(doctor.__file__).parents[1]


def _as_written(name: str) -> Any:
    """A command as its module has it, before the command line makes its help page."""
    if name in GROUPS:
        return get_group(import_module(f"flyaround.commands.{GROUPS[name]}").app)
    one = typer.Typer(add_completion=False)
    one.command(name)(getattr(import_module(f"flyaround.commands.{COMMANDS[name]}"), name))
    return get_command(one)


def _pages(path: tuple[str, ...], command: Any) -> list[tuple[tuple[str, ...], Any]]:
    inner = getattr(command, "commands", {})
    return [(path, command), *(page for n, c in inner.items() for page in _pages((*path, n), c))]


def _plain(text: str) -> str:
    return " ".join(re.sub("[│╭╮╰╯─]", " ", text).split())


@pytest.mark.parametrize("name", [*COMMANDS, *GROUPS])
def test_every_help_page_says_what_was_written(name: str) -> None:
    for path, command in _pages((name,), _as_written(name)):
        result = CliRunner().invoke(app, [*path, "--help"], env={"COLUMNS": "400"})
        page = _plain(result.output)
        assert result.exit_code == 0
        for text in (command.help, *(getattr(p, "help", None) for p in command.params)):
            assert _plain(text or "") in page


def test_units_are_seen_in_the_help_of_a_mesh() -> None:
    page = CliRunner().invoke(app, ["targets", "add", "--help"], env={"COLUMNS": "80"}).output
    assert "[kg]" in page
    assert "[kg/m3]" in page


def test_doctor_says_which_extra_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor.importlib.util, "find_spec", lambda _name: None)
    monkeypatch.setattr(doctor, "examine", lambda: tuple(doctor._optional()))
    page = CliRunner().invoke(app, ["doctor"], env={"COLUMNS": "80"}).output
    assert "- window (glfw): pip install 'flyaround[gui]'\n" in page


def test_a_sentence_is_printed_to_the_letter(capsys: pytest.CaptureFixture[str]) -> None:
    text = f"wrote /a folder [bold]/{'long/' * 40}[kg]:smile: 'flyaround[gui]'"
    say(text)
    assert capsys.readouterr().out == text + "\n"


def test_no_other_way_to_the_terminal_reads_mark_up() -> None:
    """Rich's own consoles interpret brackets; everything goes by `flyaround.commands.terminal`."""
    for path in FLYAROUND.rglob("*.py"):
        if path.name == "terminal.py":
            continue
        imported = [
            node.module
            for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.ImportFrom) and node.module in {"rich", "rich.console"}
        ]
        assert not imported, path
