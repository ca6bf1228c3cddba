"""The operator's log in the form of a script: one command per line, preceded by real time in seconds.

``12.350 time.rate 10.0`` repeats a button press; ``hold steer.forward`` and ``release steer.forward`` are a key press
and release. Time is counted in whole milliseconds, so that a replayed log flies the same flight.
"""

from __future__ import annotations

import errno
import math
import os
import shlex
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from flyaround.gui.command_table import line_of
from flyaround.hil.board.method_names import name_in_file
from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from io import FileIO
    from pathlib import Path

    from flyaround.gui.command_table import CommandTable, Value

Verb = Literal["do", "hold", "release"]
LARGEST_BYTES = 4_000_000
LARGEST_S = 1e7
NAME_A_METHOD = {"estimator.method", "hil.board"}
"""Commands whose argument is an estimator, which older scripts may name differently."""
KEPT_LINES = 100_000
"""Largest number of lines in a log, more than a day of flying; the first ones are dropped."""


@dataclass(frozen=True)
class Line:
    """A command of a script with its time.

    Parameters
    ----------
    t_ms : int
        Real time.
    verb : Verb
        ``do``, or for a held command ``hold`` and ``release``.
    name : str
        Name of the command.
    arguments : tuple of Value, optional
        Its arguments.
    """

    t_ms: int
    verb: Verb
    name: str
    arguments: tuple[Value, ...] = ()

    def __str__(self) -> str:
        words = line_of(self.name, self.arguments)
        return f"{self.t_ms / 1000:.3f} {words if self.verb == 'do' else f'{self.verb} {words}'}"


@dataclass(frozen=True)
class Script:
    """Lines in the order of their times."""

    lines: tuple[Line, ...]

    @staticmethod
    def read(path: Path, table: CommandTable) -> Script:
        """Read a script from a file.

        Returns
        -------
        Script
            Lines of the file, each checked against ``table``; undecodable bytes are replaced.

        Raises
        ------
        UserError
            If it cannot be read, is too large, or a line is invalid.
        """
        try:
            with path.open("rb") as file:
                data = file.read(LARGEST_BYTES + 1)
        except OSError as error:
            raise UserError(f"cannot read the script {path}: {error.strerror}") from error
        if len(data) > LARGEST_BYTES:
            raise UserError(f"the script {path} is larger than {LARGEST_BYTES // 1_000_000} MB")
        return Script.parse(data.decode("utf-8-sig", errors="replace"), table, str(path))

    @staticmethod
    def parse(text: str, table: CommandTable, where: str = "script") -> Script:
        """Parse a script's text, ignoring empty lines and those that begin with ``#``.

        Returns
        -------
        Script
            Lines in the order of the text, each checked against ``table``; empty if the text has none.

        Raises
        ------
        UserError
            If a line cannot be read or its time is before that of the line above.
        """
        lines: list[Line] = []
        for number, raw in enumerate(text.splitlines(), 1):
            if not raw.strip() or raw.lstrip().startswith("#"):
                continue
            try:
                line = _line(raw, table, where)
                if lines and line.t_ms < lines[-1].t_ms:
                    raise UserError(f"{line.t_ms / 1000:.3f} s comes after {lines[-1].t_ms / 1000:.3f} s")
            except UserError as error:
                raise UserError(f"{where}, line {number}: {error}") from error
            lines.append(line)
        return Script(tuple(lines))


def _line(raw: str, table: CommandTable, where: str) -> Line:
    try:
        words = shlex.split(raw)
    except ValueError as error:
        raise UserError(f"quotes do not match ({error})") from error
    try:
        t_s = float(words[0])
    except ValueError:
        t_s = math.nan
    if not (0 <= t_s <= LARGEST_S) or len(words) < 2:
        raise UserError("a line is: SECONDS COMMAND [ARGUMENTS], for example: 2.5 time.rate 10")
    t_ms = round(t_s * 1000)
    if words[1] in {"hold", "release"}:
        if len(words) != 3 or not table[words[2]].held:
            raise UserError(f"'{words[1]}' needs one held command, for example: {words[1]} steer.forward")
        return Line(t_ms, "hold" if words[1] == "hold" else "release", words[2])
    command = table[words[1]]
    if command.held:
        raise UserError(f"{command.name} lasts: write 'hold {command.name}' and 'release {command.name}'")
    values = words[2:]
    if command.name in NAME_A_METHOD:
        values = [name_in_file(word, where) for word in values]
    return Line(t_ms, "do", command.name, command.read(values))


class CommandLog:
    """The operator's commands, line by line, optionally written to a file at once."""

    def __init__(self) -> None:
        self.lines: list[Line] = []
        self._file: FileIO | None = None

    def write_to(self, path: Path, header: Sequence[str] = ()) -> None:
        """Write each line to a file from now on, unbuffered, so that a crash loses none.

        Raises
        ------
        UserError
            If the file exists or cannot be written.
        """
        if path.is_file():
            raise UserError(f"the log {path} exists already; name another file with --log")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            # unbuffered: nothing can be lost
            self._file = path.open("wb", buffering=0)
            self._put(self.text(header))
        except OSError as error:
            raise UserError(
                f"cannot write the log {path}: {error.strerror}; name another file with --log"
            ) from error

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def add(self, line: Line) -> None:
        """Add a line, dropping the first ones of a very long log.

        Raises
        ------
        OSError
            If the file cannot be written; the log continues without it.
        """
        self.lines.append(line)
        self._put(f"{line}\n")
        if len(self.lines) > KEPT_LINES:
            del self.lines[: KEPT_LINES // 10]

    def _put(self, text: str) -> None:
        data = text.encode()
        try:
            if data and self._file is not None and self._file.write(data) != len(data):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError:
            self.close()
            raise

    def text(self, header: Sequence[str] = ()) -> str:
        """Return the log as a script."""
        return "".join(f"{row}\n" for row in (*(f"# {h}" for h in header), *self.lines))


class Player:
    """Player of a script: its lines when they are due.

    Parameters
    ----------
    script : Script
        Script to play, from real time 0 on.
    """

    def __init__(self, script: Script) -> None:
        self._lines = list(script.lines)
        self.held: set[str] = set()

    def next_ms(self) -> int | None:
        """Return the real time of the next line."""
        return self._lines[0].t_ms if self._lines else None

    def due(self, t_ms: int) -> list[Line]:
        """Return the commands that are due, and update `held`."""
        due: list[Line] = []
        while self._lines and self._lines[0].t_ms <= t_ms:
            line = self._lines.pop(0)
            if line.verb == "hold":
                self.held.add(line.name)
            elif line.verb == "release":
                self.held.discard(line.name)
            else:
                due.append(line)
        return due
