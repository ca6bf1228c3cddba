"""Commands of the chaser: thrust and turns as long as a key is held, and what flies when none is."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gui.command_table import Command

if TYPE_CHECKING:
    from gui.console import Console


def _last(_console: Console, _begins: bool) -> None:  # noqa: FBT001 - the form of a held command
    """The session reads what is held itself, at every step."""


def _stop(console: Console) -> None:
    console.session.stop()


def _track(console: Console) -> None:
    console.session.toggle_tracking()


def _centre(console: Console) -> None:
    console.session.centre()


def _toggle(console: Console) -> None:
    console.session.toggle_steering()


def _reset(console: Console) -> None:
    console.session.reset_chaser()


_HELD = (
    ("forward", "w", "W", "thrust forward, along the boresight"),
    ("back", "s", "S", "thrust back"),
    ("left", "a", "A", "thrust left"),
    ("right", "d", "D", "thrust right"),
    ("up", "r", "R", "thrust up in the picture"),
    ("down", "f", "F", "thrust down in the picture"),
    ("pitch-up", "i up_arrow", "I / Up", "pitch up"),
    ("pitch-down", "k down_arrow", "K / Down", "pitch down"),
    ("yaw-left", "j left_arrow", "J / Left", "yaw left"),
    ("yaw-right", "l right_arrow", "L / Right", "yaw right"),
    ("roll-left", "u", "U", "roll left"),
    ("roll-right", "o", "O", "roll right"),
    ("coarse", "left_shift right_shift", "Shift", "five times as strong, while held"),
    ("fine", "left_ctrl right_ctrl", "Ctrl", "a fifth as strong, while held"),
)

COMMANDS = (
    *(
        Command(
            f"steer.{name}",
            name.replace("-", " ").capitalize(),
            text,
            _last,
            tuple(keys.split()),
            shown,
            held=True,
        )
        for name, keys, shown, text in _HELD
    ),
    Command("steer.stop", "Stop", "brake to rest beside the target (LVLH)", _stop, ("x",), "X"),
    Command(
        "steer.track",
        "Track",
        "the attitude follows the target; turn keys move its place in the picture",
        _track,
        ("t",),
        "T",
        state=lambda console: console.session.tracking,
    ),
    Command("steer.centre", "Centre", "bring the target to the middle and track it", _centre, ("c",), "C"),
    Command(
        "steer.toggle",
        "Steer by hand",
        "scenario's guidance / steering by hand",
        _toggle,
        ("g",),
        "G",
        state=lambda console: console.session.mode == "steer",
    ),
    Command("steer.reset", "Reset", "back onto the scenario's trajectory", _reset, ("home",), "Home"),
)
