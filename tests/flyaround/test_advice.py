"""Commands that messages advise exist, with the options that the messages name."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import typer

import flyaround.cli
import flyaround.gui
import flyaround.hil
import flyaround.simulator
from flyaround.cli.app import app
from flyaround.gui.window import no_display

PACKAGES = (flyaround.cli, flyaround.gui, flyaround.hil, flyaround.simulator)
_COMMAND = re.compile(r"flyaround ((?:hil|targets) [a-z-]+|[a-z]+)([^`;:,()|]*)")


def texts():
    """Yield the strings of the code; values in an f-string are X."""
    for package in PACKAGES:
        for path in Path(next(iter(package.__path__))).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.Constant) and isinstance(node.value, str):
                    yield node.value
                elif isinstance(node, ast.JoinedStr):
                    yield "".join(v.value if isinstance(v, ast.Constant) else "X" for v in node.values)


def options_of(path):
    command = typer.main.get_command(app)
    for name in path.split():
        command = command.commands[name].make_context(name, [], resilient_parsing=True).command
    return {o for p in command.params for o in [*p.opts, *p.secondary_opts]} | {"--help"}


ADVISED = sorted(
    {
        (command, option)
        for text in (*texts(), no_display("flyaround hil display"))
        for command, rest in _COMMAND.findall(text)
        for option in re.findall(r"(?<= )--[a-z][a-z-]+", rest)
    }
)


def test_commands_are_found_in_messages():
    assert ("sim", "--off-screen") in ADVISED
    assert len(ADVISED) > 5


@pytest.mark.parametrize(("command", "option"), ADVISED)
def test_advised_option_exists(command, option):
    assert option in options_of(command)


def test_without_a_display_hil_display_advises_no_option_of_the_console():
    pytest.importorskip("imgui_bundle")
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    command = [sys.executable, "-m", "flyaround", "hil", "display", "--patterns"]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert result.returncode == 2
    message = " ".join(result.stderr.split())
    assert "flyaround hil display" in message
    assert "--off-screen" not in message
