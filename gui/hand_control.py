"""The demand of the pilot's hands: which keys are held, and where sticks and mouse are."""

from __future__ import annotations

from flyaround.simulator.piloting.control_laws import COARSE_GAIN, FINE_GAIN, STILL, SWITCHES, Switch
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
        self._closed: set[Switch] = set()
        self._spent: set[Switch] = set()
        self._modifiers: set[str] = set()
        self.centre_sticks()

    def switch(self, switch: Switch, *, closed: bool) -> None:
        """Close or open a switch."""
        (self._closed.add if closed else self._closed.discard)(switch)
        self._spent &= self._closed

    def modify(self, modifier: str, *, on: bool) -> None:
        """Begin or end a modifier of the gain."""
        (self._modifiers.add if on else self._modifiers.discard)(modifier)

    def let_go(self) -> None:
        """Ignore sticks, and keys that are held, until they are used again."""
        self._spent = set(self._closed)
        self.centre_sticks()

    def centre_sticks(self) -> None:
        """Ignore sticks until they are moved."""
        self.thrust = self.turn = STILL

    def command(self) -> PilotCommand:
        """Return what is demanded now."""
        gain = 1.0
        for name, factor in MODIFIERS.items():
            gain *= factor if name in self._modifiers else 1.0
        return PilotCommand(
            thrust=self.thrust, turn=self.turn, switches=frozenset(self._closed - self._spent), gain=gain
        )
