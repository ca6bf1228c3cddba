"""What is printed is what was written: square brackets, paths in one piece, no mark-up of Rich's."""

import ast
import re
import unicodedata
from importlib import import_module
from pathlib import Path

import pytest
import typer
from rich.table import Table
from rich.text import Text
from typer.main import get_command, get_group
from typer.testing import CliRunner

from flyaround.__main__ import run
from flyaround.cli import doctor
from flyaround.cli.app import COMMANDS, HIL_COMMANDS, app
from flyaround.cli.terminal import say, terminal

FLYAROUND = Path(doctor.__file__).parents[1]


def _as_written(home, name):
    """A command as its module has it, before the command line makes its help page."""
    module, _, attribute = home.partition(":")
    thing = getattr(import_module(f"flyaround.cli.{module}"), attribute)
    if isinstance(thing, typer.Typer):
        return get_group(thing)
    one = typer.Typer(add_completion=False)
    one.command(name)(thing)
    return get_command(one)


def _pages(path, command):
    inner = getattr(command, "commands", {})
    return [(path, command), *(page for n, c in inner.items() for page in _pages((*path, n), c))]


def _plain(text):
    return " ".join(re.sub("[│╭╮╰╯─]", " ", text).split())


@pytest.mark.parametrize("path", [*((name,) for name in COMMANDS), *(("hil", name) for name in HIL_COMMANDS)])
def test_every_help_page_says_what_was_written(path):
    home = (HIL_COMMANDS if path[0] == "hil" else COMMANDS)[path[-1]]
    for words, command in _pages(path, _as_written(home, path[-1])):
        result = CliRunner().invoke(app, [*words, "--help"], env={"COLUMNS": "400"})
        page = _plain(result.output)
        assert result.exit_code == 0
        for text in (command.help, *(getattr(p, "help", None) for p in command.params)):
            assert _plain(text or "") in page


def test_units_are_seen_in_the_help_of_a_mesh():
    page = CliRunner().invoke(app, ["targets", "add", "--help"], env={"COLUMNS": "80"}).output
    assert "[kg]" in page
    assert "[kg/m3]" in page


def test_doctor_says_which_extra_to_install(monkeypatch):
    monkeypatch.setattr(doctor.importlib.util, "find_spec", lambda _name: None)
    monkeypatch.setattr(doctor, "examine", lambda: tuple(doctor._optional()))
    page = CliRunner().invoke(app, ["doctor"], env={"COLUMNS": "80"}).output
    assert "- window (glfw): pip install 'flyaround[gui]'\n" in page


def test_a_sentence_is_printed_to_the_letter(capsys):
    text = f"wrote /a folder [bold]/{'long/' * 40}[kg]:smile: 'flyaround[gui]'"
    say(text)
    assert capsys.readouterr().out == text + "\n"


def test_no_other_way_to_the_terminal_reads_mark_up():
    """Rich's own consoles interpret brackets; everything goes by `flyaround.cli.terminal`."""
    for path in FLYAROUND.rglob("*.py"):
        if path.name == "terminal.py":
            continue
        imported = [
            node.module
            for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.ImportFrom) and node.module in {"rich", "rich.console"}
        ]
        assert not imported, path


NASTY = {
    "colour": "\x1b[31mred",
    "title": "\x1b]0;owned\x07",
    "clear": "\x1b[2J\x1b[H",
    "csi of one byte": "\x9b2J",
    "carriage return": "good\rbad",
    "backspace": "abc\x08\x08\x08xyz",
    "delete": "a\x7fb",
    "null-like": "a\x01b",
    "right to left": "gnp.\u202eexe",
    "isolate": "\u2067a\u2069",
    "line separator": "a\u2028b",
    "undecodable": "a\udcffb",
    "line end": "a\nflyaround: all is well",
}


@pytest.mark.parametrize("name", NASTY.values(), ids=NASTY)
def test_names_reach_the_terminal_as_text(name, capsys, tmp_path):
    (tmp_path / "train.csv").write_text(
        f'filename,Tx,Ty,Tz,Qx,Qy,Qz,Qw\n"{name}.png",0,0,5,0,0,0,1\n', "utf-8", "surrogateescape"
    )
    assert run(["convert", str(tmp_path), "-o", str(tmp_path / "out"), "--from", "spark"]) == 2
    assert run(["convert", f"{tmp_path}/{name}", "-o", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err
    assert len(told.splitlines()) == 2
    assert all(line.startswith("flyaround: ") for line in told.splitlines())
    obeyed = {c for c in told if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp")}
    assert obeyed <= {"\n"}


def test_tables_show_control_characters_and_keep_their_own_colours():
    table = Table("name")
    table.add_row("a\x1b[2Jb")
    console = terminal()
    with console.capture() as captured:
        console.print(table, Text("red", "red"))
    assert "a\\x1b" in captured.get()
    assert "\x1b" not in captured.get()
    coloured = type(console)(force_terminal=True, color_system="standard")
    with coloured.capture() as captured:
        coloured.print(Text("red", "red"))
    assert "\x1b[31mred" in captured.get()
