"""Named commands with keys, help and arguments: one table for keys, menus, buttons and scripts.

Nothing here knows the console; a command's function gets it as its first argument.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from flyaround.gui.texts import texts
from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.readouts import mission_seconds

Kind = Literal["number", "time", "whole", "word", "switch"]
Value = float | int | str | bool
SWITCH = {"on": True, "off": False}
NUMBERS: dict[str, tuple[Callable[[str], float], str]] = {
    "number": (float, "a number"),
    "time": (mission_seconds, "h:min:s, or seconds"),
    "whole": (int, "a whole number"),
}
"""Function that reads each kind of number, and its name in refusals."""
KEY_NAMES = texts("keys")
"""Keys whose names for people differ from those in Dear ImGui."""


@dataclass(frozen=True)
class Argument:
    """One argument of a command.

    Parameters
    ----------
    name : str
        Name in scripts and in the menu.
    kind : Kind
        ``number`` (finite), ``time`` (seconds since the start, or h:min:s), ``whole``, ``word`` (any text) or
        ``switch`` (on, off).
    help : str
        Meaning in a few words.
    choices : tuple of str, optional
        Allowed words; empty for any.
    least : float, optional
        Least value of a number.
    most : float, optional
        Largest value of a number.
    optional : bool, optional
        True if it may be omitted; only the last ones may.
    unit : str, optional
        Unit of a number, for people; ``times`` and ``share`` for dimensionless ones.
    """

    name: str
    kind: Kind
    help: str
    choices: tuple[str, ...] = ()
    least: float = -math.inf
    most: float = math.inf
    optional: bool = False
    unit: str = ""

    @property
    def description(self) -> str:
        """Description: name, unit and bounds, meaning, and allowed words."""
        bounds = f", {self.least:g} to {self.most:g}" if math.isfinite(self.most - self.least) else ""
        words = f" ({', '.join(self.choices)})" if self.choices else ""
        return f"{self.label}{bounds}: {self.help}{words}"

    @property
    def label(self) -> str:
        """Name and unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def read(self, text: str, command: str) -> Value:
        """Return the value of a word of the command with this name or title.

        Raises
        ------
        UserError
            If it is invalid.
        """
        if flaw := self.flaw(text, command):
            raise UserError(flaw)
        return self._value(text)[0]

    def flaw(self, text: str, command: str) -> str:
        """Return what is wrong with a text of the command with this name or title; empty if nothing is."""
        allowed = self._value(text)[1]
        where = self.label if self.label == command.lower() else f"{command}: {self.label}"
        return f"{where} is '{text}', allowed: {allowed}" if allowed else ""

    def _value(self, text: str) -> tuple[Value, str]:
        """Return the value of a text, and what is allowed instead if it is invalid."""
        if self.kind == "switch":
            return SWITCH.get(text, False), "" if text in SWITCH else "on, off"
        if self.kind == "word":
            wrong = self.choices and text not in self.choices
            return text, ", ".join(self.choices[:40]) if wrong else ""
        read, noun = NUMBERS[self.kind]
        try:
            value = read(text)
            if math.isfinite(value) and self.least <= value <= self.most:
                return value, ""
        # a whole number of hundreds of digits is no float
        except (ValueError, OverflowError):
            value = math.nan
        bounds = f" from {self.least:g} to {self.most:g}" if math.isfinite(self.most - self.least) else ""
        return value, f"{noun}{bounds}"


def number(name: str, text: str, least: float, most: float, unit: str, *, optional: bool = False) -> Argument:
    """Return an argument that is a number within bounds."""
    return Argument(name, "number", text, least=least, most=most, unit=unit, optional=optional)


def moment(name: str, text: str, *, optional: bool = False) -> Argument:
    """Return an argument that is a time since the scenario's start."""
    return Argument(name, "time", text, least=0.0, most=1e9, unit="h:min:s or s", optional=optional)


def word(name: str, text: str, choices: tuple[str, ...] = (), *, optional: bool = False) -> Argument:
    """Return an argument that is a text, or one of the allowed words."""
    return Argument(name, "word", text, choices, optional=optional)


STATE = Argument("state", "switch", "on or off; toggles if omitted", optional=True)
"""The argument of a switch."""


@dataclass(frozen=True)
class Command:
    """A command of the operator.

    Parameters
    ----------
    name : str
        ``group.what``, as in scripts.
    title : str
        Name for people, in menus.
    help : str
        Description in one line.
    run : callable
        Function of the console and the arguments. For a held command the argument is True at its start, False at its
        end.
    keys : tuple of str, optional
        Names in Dear ImGui, with ``ctrl+`` for a chord.
    arguments : tuple of Argument, optional
        Arguments in order.
    held : bool, optional
        True if it lasts as long as its key is held.
    state : callable, optional
        For a switch or a mode, a function that returns True if it is on, for the menu's tick and its lit button. A
        command whose only argument is `STATE` toggles if that is omitted.
    flies : bool, optional
        True if keys and gamepad run it only while hand control is armed.
    """

    name: str
    title: str
    help: str
    run: Callable[..., object]
    keys: tuple[str, ...] = ()
    arguments: tuple[Argument, ...] = ()
    held: bool = False
    state: Callable[[Any], bool] | None = None
    flies: bool = False

    @property
    def shown(self) -> str:
        """The keys for people."""
        names = []
        for key in self.keys:
            plain = key.removeprefix("ctrl+").removesuffix("_arrow")
            name = KEY_NAMES.get(plain, plain.removeprefix("left_").removeprefix("right_").capitalize())
            names.append(f"Ctrl+{name}" if key.startswith("ctrl+") else name)
        return " / ".join(dict.fromkeys(names))

    @property
    def group(self) -> str:
        """The first part of its name."""
        return self.name.partition(".")[0]

    @property
    def at_once(self) -> bool:
        """True if it needs no argument."""
        return all(a.optional for a in self.arguments)

    @property
    def form(self) -> str:
        """Synopsis: its name, followed by its arguments."""
        arguments = (f"[{a.name}]" if a.optional else a.name.upper() for a in self.arguments)
        return " ".join([self.name, *arguments])

    def hover_text(self, *supplied: Value) -> str:
        """Return the hover text of its control: purpose, key and arguments.

        Parameters
        ----------
        supplied : Value
            Arguments that the control supplies; the others are listed with their units.

        Returns
        -------
        str
            Lines: purpose with the key in brackets, one line for each open argument that is no switch, and last the
            script's line if arguments are supplied, otherwise the command's form.
        """
        help_, keys = self.help[:1].upper() + self.help[1:], f" ({self.shown})" if self.shown else ""
        open_ = [a.description for a in self.arguments[len(supplied) :] if a.kind != "switch"]
        short = [float(f"{v:.6g}") if isinstance(v, float) else v for v in supplied]
        return "\n".join([f"{help_}{keys}", *open_, line_of(self.name, short) if supplied else self.form])

    def read(self, words: Sequence[str], by: str = "") -> tuple[Value, ...]:
        """Return the arguments of a script's line.

        Parameters
        ----------
        words : sequence of str
            Texts of the arguments.
        by : str, optional
            Name of the command in messages, by default that of scripts.

        Returns
        -------
        tuple of Value
            Values in the order of the command's declaration; shorter than that if optional ones at the end are omitted.

        Raises
        ------
        UserError
            If there are too many or too few, or one is invalid.
        """
        by = by or self.name
        if missing := [a.label for a in self.arguments[len(words) :] if not a.optional]:
            raise UserError(f"{by} needs {', '.join(missing)}")
        if len(words) > len(self.arguments):
            raise UserError(f"{by} takes {len(self.arguments) or 'no'} values, and {len(words)} were given")
        return tuple(a.read(w, by) for a, w in zip(self.arguments, words, strict=False))

    def call(self, console: object, values: tuple[Value, ...]) -> tuple[Value, ...]:
        """Run the command with the console and its arguments.

        Returns
        -------
        tuple of Value
            The arguments, with the new state of a switch that was given none.
        """
        if self.arguments == (STATE,) and not values and self.state is not None:
            values = (not self.state(console),)
        self.run(console, *values)
        return values

    def checked(self, values: Sequence[Value]) -> tuple[Value, ...]:
        """Return the arguments of a button or a test, checked like a script's.

        Returns
        -------
        tuple of Value
            The values as a script would give them, as of `read`, which also raises.
        """
        return self.read([word_of(v) for v in values], self.title)


def command(
    name: str,
    run: Callable[..., object],
    *keys_and_arguments: str | Argument,
    state: Callable[[Any], bool] | None = None,
    flies: bool = False,
    title: str = "",
    text: str = "",
) -> Command:
    """Return a command with its title and help from the texts, unless given."""
    title, text = (title, text) if title else texts("commands")[name]
    keys = tuple(k for k in keys_and_arguments if isinstance(k, str))
    arguments = tuple(a for a in keys_and_arguments if isinstance(a, Argument))
    return Command(name, title, text, run, keys, arguments, state=state, flies=flies)


def switch(
    name: str,
    run: Callable[..., object],
    state: Callable[[Any], bool],
    *keys: str,
    **options: Any,  # noqa: ANN401 - of `command`
) -> Command:
    """Return a command that switches something on and off; ``state`` is True while it is on."""
    return command(name, run, *keys, STATE, state=state, **options)


def setting(
    name: str,
    holder: Callable[[Any], object],
    field: str,
    *keys: str,
    **options: Any,  # noqa: ANN401 - of `command`
) -> Command:
    """Return a command that switches a field of the object that ``holder`` returns from the console."""
    return switch(
        name,
        lambda console, on: setattr(holder(console), field, on),
        lambda console: bool(getattr(holder(console), field)),
        *keys,
        **options,
    )


class CommandTable:
    """All commands by name.

    Raises
    ------
    ValueError
        If two have the same name or key.
    """

    def __init__(self, commands: Iterable[Command]) -> None:
        self._by_name: dict[str, Command] = {}
        self._by_key: dict[str, Command] = {}
        for command in commands:
            if command.name in self._by_name:
                raise ValueError(f"two commands are called {command.name}")
            self._by_name[command.name] = command
            for key in command.keys:
                other = self._by_key.setdefault(key, command)
                if other is not command:
                    raise ValueError(f"key {key} is of {other.name} and of {command.name}")

    def __getitem__(self, name: str) -> Command:
        command = self._by_name.get(name)
        if command is None:
            raise UserError(f"there is no command '{name[:80]}'; F1 in the console lists them")
        return command

    def __contains__(self, name: str) -> bool:
        return name in self._by_name

    def __iter__(self) -> Iterator[Command]:
        return iter(self._by_name.values())

    def held(self, keys_down: Iterable[str]) -> frozenset[str]:
        """Return the names of held commands whose keys are down."""
        return frozenset(c.name for k in keys_down if (c := self._by_key.get(k)) is not None and c.held)

    def pressed(self, keys_hit: Iterable[str], *, ctrl: bool) -> list[Command]:
        """Return the single commands of keys that went down; with Ctrl, chords come first."""
        hit = []
        for key in keys_hit:
            command = (self._by_key.get(f"ctrl+{key}") if ctrl else None) or self._by_key.get(key)
            if command is not None and not command.held and command not in hit:
                hit.append(command)
        return hit

    def keys(self) -> frozenset[str]:
        """Return the keys of all commands, without chords."""
        return frozenset(k.removeprefix("ctrl+") for k in self._by_key)


def word_of(value: Value) -> str:
    """Return a value as a script writes it, with all digits, so that it is read back unchanged."""
    if isinstance(value, bool):
        return "on" if value else "off"
    return repr(value) if isinstance(value, float) else str(value)


def line_of(name: str, values: Sequence[Value]) -> str:
    """Return a command with its arguments as a script writes it."""
    return " ".join([name, *(shlex.quote(word_of(v)) for v in values)])
