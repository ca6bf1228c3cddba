"""Commands of scenarios: open another one, edit its text, fly the edited text."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from flyaround.gui.command_table import command, word

if TYPE_CHECKING:
    from flyaround.gui.console import Console


def _open(console: Console, scenario: str) -> None:
    console.opener.open(scenario)
    console.say(f"opening {scenario} ...")


def _edit(console: Console, scenario: str | None = None) -> None:
    console.draft.edit(console.session.plan.scenario.name if scenario is None else scenario)
    console.open_panel("editor", shown=True)


def _check(console: Console) -> None:
    scenario = console.draft.check()
    console.say(f"{scenario.name} is right")


def _save(console: Console, path: str) -> None:
    console.draft.save(Path(path))
    console.say(f"saved {path}; flyaround sim {path} flies it")


def _fly(console: Console) -> None:
    console.opener.open(console.draft.check())


def _target(console: Console, target: str) -> None:
    scenario = console.session.plan.scenario
    console.opener.open(msgspec.structs.replace(scenario, target=target))


COMMANDS = (
    command("scenario.open", _open, arguments=(word("scenario", "built-in name or TOML file"),)),
    command(
        "scenario.edit", _edit, arguments=(word("scenario", "built-in name or TOML file", optional=True),)
    ),
    command("scenario.check", _check),
    command("scenario.save", _save, arguments=(word("path", "file that ends in .toml"),)),
    command("scenario.fly", _fly),
    command(
        "scenario.target",
        _target,
        arguments=(word("target", "name of the craft, as flyaround targets lists it"),),
    ),
)
