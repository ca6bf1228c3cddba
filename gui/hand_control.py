"""The demand of the pilot's hands: which keys are held, and where sticks and mouse are."""

from __future__ import annotations

import math

from flyaround.simulator.piloting.control_laws import COARSE_GAIN, FINE_GAIN, STILL, SWITCHES
from flyaround.simulator.piloting.orders import PilotCommand

MODIFIERS = {"coarse": COARSE_GAIN, "fine": FINE_GAIN}
STEERING = frozenset(f"steer.{switch}" for switch in SWITCHES)
"""Names of the commands whose keys push or turn."""


class HandControl:
    """Combines keys, sticks and mouse to the command that is held.

    Attributes
    ----------
    armed : bool
        True while keys fly the chaser. Commands, buttons, scripts, sticks and the key of abort always do.
    thrust, turn : tuple of float
        Of the stick or the mouse, each axis from -1 to 1.
    """

    def __init__(self) -> None:
        self.armed = False
        self._held: set[str] = set()
        self._spent: set[str] = set()
        self.centre_sticks()

    def hold(self, name: str, *, held: bool) -> None:
        """Begin or end a switch, or a modifier of the gain."""
        (self._held.add if held else self._held.discard)(name)
        self._spent &= self._held

    def let_go(self) -> None:
        """Ignore sticks, and keys that are held, until they are used again."""
        self._spent = self._held & set(SWITCHES)
        self.centre_sticks()

    def centre_sticks(self) -> None:
        """Ignore sticks until they are moved."""
        self.thrust = self.turn = STILL

    def command(self) -> PilotCommand:
        """Return what is demanded now."""
        acting = self._held - self._spent
        return PilotCommand(
            thrust=self.thrust,
            turn=self.turn,
            switches=frozenset(acting - set(MODIFIERS)),
            gain=math.prod(MODIFIERS[name] for name in sorted(acting & set(MODIFIERS))),
        )
