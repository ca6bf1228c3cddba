"""Strict reading of a camera file's table of keys: each key must be read, or ignored by name."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

from flyaround.simulator.camera.lens.formats.document import plain_name
from flyaround.simulator.camera.lens.formats.yaml_text import NUMBER
from flyaround.simulator.errors import UserError, near_names

if TYPE_CHECKING:
    from collections.abc import Iterable

Matrix = tuple[float, float, float, float]
"""fx, fy, cx, cy [px]."""
_MATRIX_KEYS = {"rows", "cols", "dt", "data", "type_id", "sizes"}  # keys of a matrix in OpenCV's FileStorage
_NUMBER = re.compile(NUMBER)
_SWITCH = {"true": True, "1": True, "1.0": True, "false": False, "0": False, "0.0": False}
_SKEW_TOLERANCE = 1e-9  # largest skew over fx that counts as rounding


class Keys:
    """Reader of one table; every key must be read or ignored before `done` is called.

    Names are compared without case, ``_``, ``-`` and blanks, because programs write camera_matrix, Camera_Matrix and
    cameraMatrix.

    Parameters
    ----------
    table : dict
        The table.
    source : str
        Name of the file in messages.
    form : str
        Name of the format in messages, for example "ROS calibration".
    path : str
        Key of the table within the file, with its dot.

    Raises
    ------
    UserError
        If it is not a table, or two of its keys say the same.
    """

    def __init__(self, table: Any, source: str, form: str, path: str = "") -> None:  # noqa: ANN401 - any value
        self.where, self.form, self.path = source, form, path
        if not isinstance(table, dict):
            raise UserError(
                f"{source}: key {path.rstrip('.')} is {_abbreviate(table)}, a table of keys is needed"
            )
        self._names: dict[str, str] = {}
        for name in table:
            key = plain_name(name)
            if key in self._names:
                raise UserError(
                    f"{source} has the keys {self._names[key]} and {name}, which say the same; delete one"
                )
            self._names[key] = name
        self._table = table
        self._unread = dict.fromkeys(self._names)
        self._requested: list[str] = []

    def find(self, *names: str) -> str:
        """Return the spelling, out of several, that the table uses; empty if it has none.

        Raises
        ------
        UserError
            If it has two of them.
        """
        self._requested.append(names[0])
        matches = [plain for plain in dict.fromkeys(map(plain_name, names)) if plain in self._names]
        if len(matches) > 1:
            first, second = (self._names[plain] for plain in matches[:2])
            raise UserError(f"{self.where} has the keys {first} and {second}, which say the same; delete one")
        if not matches:
            return ""
        self._unread.pop(matches[0], None)
        return self._names[matches[0]]

    def get(self, *names: str) -> Any:  # noqa: ANN401 - any value
        """Return the value under any of several spellings, or None."""
        name = self.find(*names)
        return self._table[name] if name else None

    def number(self, *names: str, default: float | None = None) -> float:
        """Return a number.

        Raises
        ------
        UserError
            If it is missing and has no default, or is not a number.
        """
        value = self.get(*names)
        if value is None and default is not None:
            return default
        if isinstance(value, bool) or not isinstance(value, int | float):
            if value is None:
                raise self.error(f"lacks the key {names[0]}; add it")
            raise UserError(f"{self._location(*names)} is {_abbreviate(value)}, a number is needed")
        return float(value)

    def count(self, *names: str) -> int:
        """Return a whole number. Raises as `number` does."""
        value = self.number(*names)
        if value != int(value):
            raise UserError(f"{self._location(*names)} is {value:g}, a whole number of pixels is needed")
        return int(value)

    def flag(self, *names: str) -> bool:
        """Return a switch, False if it is missing: true, false, 1 or 0, also as text.

        Raises
        ------
        UserError
            If it is anything else.
        """
        value = self.get(*names)
        if value is None:
            return False
        switch = _SWITCH.get(str(value).strip().lower())
        if switch is None:
            raise UserError(f"{self._location(*names)} is {_abbreviate(value)}, true or false is needed")
        return switch

    def numbers(self, *names: str) -> list[float] | None:
        """Return a flat list of numbers from nested lists, OpenCV's matrix or text; None if it is missing.

        Raises
        ------
        UserError
            If it holds anything but numbers, or their count differs from rows times columns.
        """
        value = self.get(*names)
        if value is None and self.find(*names):
            raise UserError(
                f"{self._location(*names)} is empty, numbers are needed; add them or delete the key"
            )
        return None if value is None else flat_numbers(value, self._location(*names))

    def matrix(self, *names: str) -> Matrix | None:
        """Return fx, fy, cx, cy of a 3 x 3 camera matrix, or of a table of them; None if it is missing.

        Raises
        ------
        UserError
            If it is not a camera matrix, or has a skew.
        """
        name = self.find(*names)
        if name and isinstance(self._table[name], dict) and "fx" in self._table[name]:
            inner = self.inner(name)
            fx, fy, cx, cy = (inner.number(key) for key in ("fx", "fy", "cx", "cy"))
            inner.done()
            return fx, fy, cx, cy
        values = self.numbers(*names)
        return None if values is None else camera_matrix(values, self._location(*names))

    def inner(self, name: str) -> Keys:
        """Return the keys of a table within this one, which must exist."""
        return Keys(self.get(name), self.where, self.form, f"{self.path}{self.find(name) or name}.")

    def ignore(self, *names: str, prefixes: str = "") -> None:
        """Ignore keys that do not affect the lens: several in one text, or all that begin with one of ``prefixes``."""
        starts = tuple(map(plain_name, prefixes.split()))
        ignored = {plain_name(word) for name in names for word in name.split()}
        self._unread = {
            key: None
            for key in self._unread
            if key not in ignored and not (starts and key.startswith(starts))
        }

    def allow(self, name: str, *values: Any, advice: str = "", aliases: Iterable[str] = ()) -> None:  # noqa: ANN401
        """Ignore a key that does not affect the lens if it has one of these values.

        Raises
        ------
        UserError
            If it has another value; ``advice`` says what to do.
        """
        value = self.get(name, *aliases)
        if value is not None and value not in values:
            raise UserError(
                f"{self._location(name, *aliases)} is {_abbreviate(value)}, which is not supported"
                f"{advice and '; '}{advice}"
            )

    def done(self) -> None:
        """Raise if a key was neither read nor ignored.

        Raises
        ------
        UserError
            If there is one; the message names it.
        """
        unread = [self._names[plain] for plain in self._unread]
        if unread:
            suggestions = near_names(unread[0], self._requested)
            hint = f"did you mean {suggestions[0]}? " if suggestions else ""
            others = f" (nor {', '.join(unread[1:4])})" if unread[1:] else ""
            raise UserError(
                f"{self.where}: key {self.path}{unread[0]} is not known in a file of {self.form}{others}, so it could "
                f"change the lens unseen: {hint}delete it"
            )

    def error(self, text: str) -> UserError:
        """Return an error whose message starts with the file and the table."""
        table = f" key {self.path.rstrip('.')}" if self.path else ""
        return UserError(f"{self.where}{':' if table else ''}{table} {text}")

    def _location(self, *names: str) -> str:
        return f"{self.where}: key {self.path}{self.find(*names) or names[0]}"


def flat_numbers(value: Any, source: str) -> list[float]:  # noqa: ANN401 - a value of YAML is anything
    """Return the numbers of nested lists, OpenCV's matrix or text of numbers.

    Raises
    ------
    UserError
        If there is anything but finite numbers.
    """
    if isinstance(value, dict):
        unexpected = [key for key in value if key not in _MATRIX_KEYS]
        if unexpected or "data" not in value:
            raise UserError(
                f"{source} is a table with the keys {', '.join(map(str, value))[:80]}, a list of numbers is needed"
            )
        data = flat_numbers(value["data"], source)
        rows, columns = value.get("rows"), value.get("cols")
        if (
            isinstance(rows, int)
            and isinstance(columns, int)
            and rows * columns != len(data)
            and _one_channel(value)
        ):
            raise UserError(f"{source} has {len(data)} numbers, its rows and cols say {rows} x {columns}")
        return data
    if isinstance(value, list):
        return [number for inner in value for number in flat_numbers(inner, source)]
    if isinstance(value, int | float) and not isinstance(value, bool):
        return [float(value)]
    words = re.split(r"[\s,]+", value.strip()) if isinstance(value, str) else [""]
    if not all(_NUMBER.fullmatch(word) for word in words):
        raise UserError(f"{source} holds {_abbreviate(value)}, numbers are needed")
    numbers = [float(word) for word in words]
    if not all(map(math.isfinite, numbers)):
        raise UserError(f"{source} holds {_abbreviate(value)}, finite numbers are needed")
    return numbers


def camera_matrix(elements: list[float], source: str) -> Matrix:
    """Return fx, fy, cx, cy of a 3 x 3 matrix in rows.

    Raises
    ------
    UserError
        If it is not a camera matrix, or has a skew.
    """
    if len(elements) != 9:
        raise UserError(f"{source} has {len(elements)} numbers, a 3 x 3 matrix is needed")
    if not any(elements[:8]):
        raise UserError(f"{source} is 0: the camera is not calibrated; calibrate it")
    if abs(elements[8] - 1) > _SKEW_TOLERANCE or any(
        abs(v) > 1e-12 for v in (elements[3], elements[6], elements[7])
    ):
        raise UserError(
            f"{source} is not a camera matrix in row order: its last row must be 0 0 1, and the one before 0 fy cy"
        )
    if abs(elements[1]) > _SKEW_TOLERANCE * abs(elements[0]):
        raise UserError(
            f"{source} has a skew of {elements[1]:g} px, which is not supported; calibrate with the skew fixed at 0"
        )
    return elements[0], elements[4], elements[2], elements[5]


def _one_channel(matrix: dict[str, Any]) -> bool:
    return len(str(matrix.get("dt", "d"))) == 1


def _abbreviate(value: Any) -> str:  # noqa: ANN401 - any value
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
