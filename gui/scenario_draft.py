"""The text of a scenario during editing, its first error, and its files."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import msgspec

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.runtime.toml_text import to_toml
from flyaround.simulator.scenario.flight import fly
from flyaround.simulator.scenario.load import list_scenarios, load_scenario, parse_scenario
from flyaround.simulator.scenario.scenario import Scenario
from flyaround.simulator.scenario.show import show_scenario
from flyaround.simulator.targets.library import load_target

_HEADER = re.compile(r"^\s*\[+\s*([\w.]+)\s*\]+")
_AT_LINE = re.compile(r"\bat line (\d{1,9})\b")
_UNKNOWN = re.compile(r"unknown key (\w+) (?:in section \[([\w.]+)[\]\[]|at the top level)")
_LACKS = re.compile(r"section \[([\w.]+)[^\]]*\] lacks")
_KEY = re.compile(r"\b(?:key|unknown(?! key)) ([\w.]+)")
_DOTTED = re.compile(r"\b([a-z]\w*(?:\.\w+)+)\b")
CHECKED_S = 1.0
"""Time that a check flies. The whole flight can take seconds, and the window waits for a check."""


@dataclass
class ScenarioDraft:
    """The text and its origin.

    Parameters
    ----------
    text : str, optional
        The edited text.
    name : str, optional
        Name of the original scenario.
    file : Path, optional
        Its file; None for a built-in scenario and one that is in no file.
    problem : str, optional
        What is wrong with it, in one sentence; empty if nothing is.
    problem_line : int or None, optional
        Line of that, from 1; None if it is not known.
    right_text : str, optional
        The text that was last found right.
    changed : bool, optional
        True if the text differs from the original.
    flown : Scenario, optional
        The scenario of the text that was last opened to fly.
    replacement : str, optional
        Scenario to edit once the operator agrees to discard this changed text, empty for the one that flies; None
        unless that question is open.
    """

    text: str = ""
    name: str = ""
    file: Path | None = None
    problem: str = ""
    problem_line: int | None = None
    right_text: str = ""
    changed: bool = False
    flown: Scenario | None = None
    replacement: str | None = None

    def edit(self, name_or_path: str) -> None:
        """Start from a built-in scenario or a file.

        Raises
        ------
        UserError
            If there is none; the text is kept.
        """
        if name_or_path in list_scenarios():
            text, file = show_scenario(name_or_path), None
        else:
            load_scenario(name_or_path)  # report a wrong name
            file = Path(name_or_path)
            text = file.read_text("utf-8-sig")
        self.text, self.file, self.changed = text, file, False
        self.problem, self.problem_line = "", None
        self.name = Path(name_or_path).stem

    def begin(self, scenario: Scenario) -> None:
        """Begin from a scenario that is in no file."""
        self.text, self.name, self.file = to_toml(msgspec.to_builtins(scenario)), scenario.name, None
        self.problem, self.problem_line, self.changed = "", None, False

    def check(self) -> Scenario:
        """Return the scenario of the text, after its first second was flown.

        Raises
        ------
        UserError
            If it has a mistake, which is also `problem`.
        """
        try:
            content, folder = self.text.encode(), Path() if self.file is None else self.file.parent
            scenario = parse_scenario(content, "this scenario", self.name or "edited", folder)
            fly(scenario, load_target(scenario.target), min(scenario.duration_s, CHECKED_S))
        except (UserError, ValueError, OSError) as error:
            self.problem_line = line = line_of(str(error), self.text)
            self.problem = f"{'' if line is None else f'line {line}: '}{error}"
            raise UserError(self.problem) from error
        self.problem, self.problem_line, self.right_text = "", None, self.text
        return scenario

    def save(self, path: Path) -> None:
        """Write the text, if it is valid.

        Raises
        ------
        UserError
            If it has a mistake, the folder does not exist, or the file exists and is not the edited one.
        """
        self.check()
        if path.suffix != ".toml":
            raise UserError(f"a scenario's file ends in .toml, and {path} does not")
        if not path.parent.is_dir():
            raise UserError(f"folder {path.parent} does not exist; make it, or name another place")
        if path.exists() and path != self.file:
            raise UserError(f"{path} exists already; name another file")
        write_atomic(path, self.text.encode())
        self.name, self.file, self.changed, self.replacement = path.stem, path, False, None


def line_of(message: str, text: str) -> int | None:
    """Return the line of a text to which the loader's message refers, from 1; None if unknown."""
    if match := _AT_LINE.search(message):
        return int(match[1])
    if match := _UNKNOWN.search(message):
        return _line_of_key(text, f"{match[2]}.{match[1]}" if match[2] else match[1])
    if match := _LACKS.search(message):
        return _line_of_section(text, match[1])
    for pattern in (_KEY, _DOTTED):
        for match in pattern.finditer(message):
            if (line := _line_of_key(text, match[1])) is not None:
                return line
    return None


def _line_of_key(text: str, path: str) -> int | None:
    """Return the line of a key such as ``sensor.exposure_s``, or of its section if the key is absent."""
    section, _, key = path.rpartition(".")
    here = ""
    assignment = re.compile(rf"^\s*{re.escape(key)}\s*(?:=|\.)")
    for number, line in enumerate(text.splitlines(), 1):
        if header := _HEADER.match(line):
            here = header[1]
            if here == path:
                return number
        elif here == section and assignment.match(line):
            return number
    return _line_of_section(text, section) if section else None


def _line_of_section(text: str, section: str) -> int | None:
    headers = ((number, _HEADER.match(line)) for number, line in enumerate(text.splitlines(), 1))
    return next((number for number, header in headers if header and header[1] == section), None)
