"""List of the console's commands with keys, arguments and purpose: ``python -m tools.docs.console_commands``.

Writes ``docs/console_commands.txt``.
"""

from pathlib import Path

from flyaround.gui.app import command_table
from flyaround.gui.command_table import Command

LIST = Path(__file__).resolve().parents[2] / "docs" / "console_commands.txt"


def command_list() -> str:
    """Return the list, one group of commands after the other."""
    commands = sorted(command_table(), key=lambda command: command.name)
    lines = ["Commands of the console, as in scripts. [argument]: optional.", ""]
    group = ""
    for command in commands:
        if command.group != group:
            group = command.group
            lines += [f"{group}", "-" * len(group)]
        lines += [*_entry(command), ""]
    return "\n".join(lines)


def _entry(command: Command) -> list[str]:
    """Return the lines of one command: synopsis and keys, purpose, arguments."""
    keys = f"    ({command.shown})" if command.shown else ""
    arguments = [f"    {argument.description}" for argument in command.arguments]
    return [f"{command.form}{keys}", f"    {command.help}", *arguments]


if __name__ == "__main__":
    LIST.write_text(command_list(), encoding="utf-8")
