"""Commands of scenarios: open another one, edit its text, fly the edited text."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from flyaround.gui.command_table import Argument, command, word
from flyaround.simulator.scenario.load import built_in_name

if TYPE_CHECKING:
    from flyaround.gui.console import Console


def _open(console: Console, scenario: str) -> None:
    console.opener.open(scenario)
    console.say(f"opening {scenario} ...", over=lambda: not console.opener.is_busy())


def _edit(console: Console, scenario: str | None = None) -> None:
    flown, draft = console.session.plan.scenario, console.draft
    console.open_panel("editor", shown=True)
    # a second time is the answer
    if draft.changed and draft.replacement is None:
        draft.replacement = scenario or ""
        return
    draft.replacement = None
    if named := scenario or console.source or built_in_name(flown):
        draft.edit(named)
    else:
        draft.begin(flown)


def _check(console: Console) -> None:
    console.say(f"{console.draft.check().name} is right")


def _save(console: Console, path: str) -> None:
    console.draft.save(Path(path))
    console.say(f"saved {path}; flyaround sim {path} flies it")


def _fly(console: Console) -> None:
    console.draft.flown = console.draft.check()
    console.opener.open(console.draft.flown)


def _target(console: Console, target: str) -> None:
    scenario = console.session.plan.scenario
    console.opener.open(msgspec.structs.replace(scenario, target=target))


WHICH = Argument("which", "whole", "1, the default, for the one left last", least=1, most=99, optional=True)

COMMANDS = (
    command("scenario.open", _open, word("scenario", "built-in name or TOML file")),
    command("scenario.open-stop", lambda console: console.opener.abandon()),
    command("scenario.edit", _edit, word("scenario", "built-in name or file", optional=True)),
    command("scenario.back", lambda console, which=1: console.go_back(which), WHICH),
    command("scenario.check", _check),
    command("scenario.save", _save, word("path", "file that ends in .toml")),
    command("scenario.fly", _fly),
    command("scenario.target", _target, word("target", "name in flyaround targets")),
)
