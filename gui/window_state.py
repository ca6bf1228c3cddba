"""What commands request of the window, and what it tells them: its panels, help and tour."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path


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
    clipboard : str, optional
        Text for the clipboard.
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
    clipboard: str = ""
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
    behind : set of str, optional
        Panels whose window is behind another in its dock or collapsed.
    rects : dict of str to tuple of float, optional
        Left, top, width and height of panels and bars.
    tour_step : int, optional
        Number of the tour's steps that are done or skipped.
    """

    descriptions: dict[str, tuple[str, str]] = field(default_factory=dict)
    panel: str = ""
    hovered: str = ""
    behind: set[str] = field(default_factory=set)
    rects: dict[str, tuple[float, float, float, float]] = field(default_factory=dict)
    tour_step: int = 0
