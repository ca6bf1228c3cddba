"""State of the operator: manual control, requests to the window, help and tour."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

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
    abort_by_ms : int
        Real time until which a second click on ABORT aborts; 0 while its guard is closed.
    thrust, turn : tuple of float
        Translation and rotation demanded by stick or mouse, each axis from -1 to 1.
    """

    def __init__(self) -> None:
        self.armed = self.flown = False
        self.abort_by_ms = 0
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


@dataclass
class WindowRequests:
    """Requests that commands make of the window; the main loop carries them out and clears them.

    Parameters
    ----------
    close : bool, optional
        True to close the window.
    full_screen : bool, optional
        True to enter or leave full screen.
    preset : str, optional
        Layout to apply.
    layout : str, optional
        Last layout chosen.
    enlarged : str, optional
        Panel that fills the window, or empty.
    screenshot : Path, optional
        File for a picture of the window.
    front : str, optional
        Panel to raise.
    font_scale : float, optional
        Font size relative to the default [1].
    """

    close: bool = False
    full_screen: bool = False
    preset: str = ""
    layout: str = ""
    enlarged: str = ""
    screenshot: Path | None = None
    front: str = ""
    font_scale: float = 1.0


@dataclass
class Help:
    """State of the panels' help and of the tour.

    Parameters
    ----------
    descriptions : dict of str to tuple of str, optional
        Title and description of each panel.
    panel : str, optional
        Panel that the help describes.
    hovered : str, optional
        The panel under the mouse.
    clicked : str, optional
        The panel that was clicked or opened last.
    behind : set of str, optional
        Panels whose window is behind another in its dock or collapsed.
    tour_step : int, optional
        Number of the tour's steps that are done or skipped.
    framed : str, optional
        Command whose control the tour frames.
    """

    descriptions: dict[str, tuple[str, str]] = field(default_factory=dict)
    panel: str = ""
    hovered: str = ""
    clicked: str = ""
    behind: set[str] = field(default_factory=set)
    tour_step: int = 0
    framed: str = ""
