"""A scenario's text while it is edited: what is wrong with it, and where it is kept."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from flyaround.gui.flight.text_lines import line_of
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.scenario.load import list_scenarios, load_scenario, parse_scenario
from flyaround.simulator.scenario.scenario import Scenario
from flyaround.simulator.scenario.show import show_scenario


@dataclass
class ScenarioDraft:
    """The text, and what it is of.

    Parameters
    ----------
    name : of the scenario that it began as. folder : of files that it names.
    problem : what is wrong with it, one sentence; nothing where it is right.
    """

    text: str = ""
    name: str = ""
    folder: Path = Path()
    problem: str = ""
    changed: bool = False

    def edit(self, name_or_path: str) -> None:
        """Begin from a built-in scenario or a file.

        Raises
        ------
        UserError
            If there is none; the text stays.
        """
        if name_or_path in list_scenarios():
            text, folder = show_scenario(name_or_path), Path()
        else:
            load_scenario(name_or_path)  # says what is wrong with the name
            path = Path(name_or_path)
            text, folder = path.read_text("utf-8-sig"), path.parent
        self.text, self.folder, self.problem, self.changed = text, folder, "", False
        self.name = Path(name_or_path).stem

    def check(self) -> Scenario:
        """The scenario that the text is.

        Raises
        ------
        UserError
            If it has a mistake; `problem` says the same.
        """
        try:
            content = self.text.encode()
            scenario = parse_scenario(content, "this scenario", self.name or "edited", self.folder)
        except UserError as error:
            line = line_of(str(error), self.text)
            self.problem = f"{'' if line is None else f'line {line}: '}{error}"
            raise UserError(self.problem) from error
        self.problem = ""
        return scenario

    def save(self, path: Path) -> None:
        """Write the text, if it is right.

        Raises
        ------
        UserError
            If it has a mistake, or its place is not there.
        """
        self.check()
        if path.suffix != ".toml":
            raise UserError(f"a scenario's file ends in .toml, and {path} does not")
        if not path.parent.is_dir():
            raise UserError(f"folder {path.parent} does not exist; make it, or name another place")
        write_atomic(path, self.text.encode())
        self.name, self.folder, self.changed = path.stem, path.parent, False
