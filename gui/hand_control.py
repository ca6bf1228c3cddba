"""Manual control of the chaser by keys, sticks and mouse."""

from __future__ import annotations

import math

from flyaround.simulator.piloting.control_laws import COARSE_GAIN, FINE_GAIN, NO_DEMAND, SWITCHES
from flyaround.simulator.piloting.orders import PilotCommand

MODIFIERS = {"coarse": COARSE_GAIN, "fine": FINE_GAIN}


class HandControl:
    """Manual control: combines the states of keys, sticks and mouse into a command to the chaser.

    Attributes
    ----------
    armed : bool
        True while keys, mouse and gamepad act on the chaser. Commands, buttons, scripts and the abort key always do.
    flown : bool
        True once a command of the hand has moved the chaser.
    thrust, turn : tuple of float
        Translation and rotation demanded by stick or mouse, each axis from -1 to 1.
    """

    def __init__(self) -> None:
        self.armed = self.flown = False
        self._held: set[str] = set()
        self._spent: set[str] = set()
        self.centre_sticks()

    def hold(self, name: str, *, held: bool) -> None:
        """Press or release a thrust or rotation switch, or a modifier of the gain."""
        (self._held.add if held else self._held.discard)(name)
        self._spent &= self._held

    def let_go(self) -> None:
        """Ignore sticks and held keys until they are used again."""
        self._spent = self._held & set(SWITCHES)
        self.centre_sticks()

    def centre_sticks(self) -> None:
        """Ignore sticks until they are moved."""
        self.thrust = self.turn = NO_DEMAND

    def command(self) -> PilotCommand:
        """Return the command that the present state of all inputs gives."""
        acting = self._held - self._spent
        return PilotCommand(
            thrust=self.thrust,
            turn=self.turn,
            switches=frozenset(acting - set(MODIFIERS)),
            gain=math.prod(MODIFIERS[name] for name in sorted(acting & set(MODIFIERS))),
        )
