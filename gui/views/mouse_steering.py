"""Steering by the mouse over the camera's picture: drag to rotate or thrust, wheel for pulses."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui.console import UNARMED
from flyaround.gui.gamepad import STILL, share
from flyaround.gui.widgets import Widgets

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.gui.surface import Surface
    from flyaround.gui.views.letterbox import Letterbox

REACH = 0.25
"""Drag, as a share of the picture's height, for full rotation or thrust."""


class MouseSteering:
    """A stick made of the picture while a button is held on it.

    Parameters
    ----------
    window : Surface
        Surface with the mouse.
    """

    def __init__(self, window: Surface) -> None:
        self._w = Widgets(window)
        self._thrust = self._turn = STILL

    def take(self, box: Letterbox, console: Console) -> None:
        """Lay an invisible button over the picture, and apply the mouse's actions."""
        imgui, w = self._w.imgui, self._w
        imgui.set_cursor_screen_pos(w.vec(box.x, box.y))
        flags = imgui.ButtonFlags_
        imgui.invisible_button(
            "steer by mouse",
            w.vec(max(box.width, 1.0), max(box.height, 1.0)),
            flags.mouse_button_left | flags.mouse_button_right | flags.mouse_button_middle,
        )
        armed, hovered, active = console.hand.armed, imgui.is_item_hovered(), imgui.is_item_active()
        wheel = imgui.get_io().mouse_wheel if hovered else 0.0
        if not armed and (wheel or active):
            console.say(UNARMED)
        if armed and wheel:
            console.do("steer.pulse", "forward" if wheel > 0 else "back")
        if armed and hovered and imgui.is_mouse_clicked(imgui.MouseButton_.middle):
            console.do("steer.centre")
        thrust, turn = STILL, STILL
        if armed and active:
            for button in (imgui.MouseButton_.left, imgui.MouseButton_.right):
                if not imgui.is_mouse_down(button):
                    continue
                way = imgui.get_mouse_drag_delta(button, 0.0)
                x, y = (share(float(d) / (REACH * box.height)) for d in (way.x, way.y))
                if button == imgui.MouseButton_.left:
                    turn = (-y if y else 0.0, x, 0.0)
                else:
                    thrust = (x, y, 0.0)
        if turn != self._turn:
            console.do("steer.stick-turn", *turn)
        if thrust != self._thrust:
            console.do("steer.stick-thrust", *thrust)
        self._thrust, self._turn = thrust, turn
