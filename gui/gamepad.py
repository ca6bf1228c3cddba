"""Commands of a gamepad's sticks and buttons, from states that the window reads.

Axes and buttons follow SDL's standard mapping, which glfw supports for some thousand gamepads.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui.texts import texts

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.gui.command_table import Value

    Stick = tuple[float, float, float]
    Do = tuple[str, *tuple[Value, ...]]
    Pad = tuple[str, tuple[float, ...], tuple[bool, ...]]

DEAD = 0.12
"""Half width of the dead zone, as a share of a stick's travel."""
GRAIN = 0.05
"""Step of the shares, so that jitter does not fill the log."""
LEFT_X, LEFT_Y, RIGHT_X, RIGHT_Y, LEFT_TRIGGER, RIGHT_TRIGGER = range(6)
BUTTONS: tuple[tuple[str, ...], ...] = tuple(tuple(line.split()) for line in texts("gamepad").values())
"""Command of each button, with its arguments; empty for a bumper."""
LEFT_BUMPER, RIGHT_BUMPER = 4, 5
STILL = (0.0, 0.0, 0.0)  # sticks at rest


class Gamepad:
    """Converter of a gamepad's states to commands, each once when it changes.

    Left stick: right and left, down and up. Triggers: forward (right) and back. Right stick: yaw, and pitch as on a
    control column: pulling back raises the nose. Bumpers: roll.
    """

    def __init__(self) -> None:
        self._last: tuple[bool, ...] | None = None
        self._thrust = self._turn = STILL

    def commands(self, pad: Pad | None) -> list[Do]:
        """Return the commands for the changes since the last call.

        Parameters
        ----------
        pad : Pad or None
            Name; six axes from -1 to 1, down and right positive, triggers -1 when released; fifteen buttons. None
            without a gamepad.
        """
        if pad is None:
            was_connected = self._last is not None
            self._last, self._thrust, self._turn = None, STILL, STILL
            return [("steer.stick-lost",)] if was_connected else []
        _, axes, buttons = pad
        commands: list[Do] = []
        thrust, turn = sticks(axes, buttons)
        if thrust != self._thrust:
            commands.append(("steer.stick-thrust", *thrust))
        if turn != self._turn:
            commands.append(("steer.stick-turn", *turn))
        before = buttons if self._last is None else self._last
        for what, was, now in zip(BUTTONS, before, buttons, strict=False):
            if what and now and not was:
                commands.append((what[0], *what[1:]))
        self._last, self._thrust, self._turn = buttons, thrust, turn
        return commands


def sticks(axes: Sequence[float], buttons: Sequence[bool]) -> tuple[Stick, Stick]:
    """Return thrust right, down, forward, and rotation up, right, clockwise, as shares."""
    forward = (axes[RIGHT_TRIGGER] - axes[LEFT_TRIGGER]) / 2
    roll = float(buttons[RIGHT_BUMPER]) - float(buttons[LEFT_BUMPER])
    thrust = (share(axes[LEFT_X]), share(axes[LEFT_Y]), share(forward))
    return thrust, (share(axes[RIGHT_Y]), share(axes[RIGHT_X]), roll)


def share(axis: float) -> float:
    """Return an axis without its dead zone, in even steps from -1 to 1."""
    size = min(max((abs(axis) - DEAD) / (1 - DEAD), 0.0), 1.0)
    stepped = round(round(size / GRAIN) * GRAIN, 2)
    return stepped if axis > 0 or stepped == 0.0 else -stepped
