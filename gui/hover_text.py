"""Hover texts of controls, figures and places in a picture, of readable width."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from flyaround.gui import style

CLICKED: set[int] = set()
"""Items that were clicked and that the pointer has not left; their texts would cover what the click has changed."""
WIDEST = 26.0
"""Width of a hover text, in text heights."""


def item_tip(imgui: Any, text: str, *, typing: bool = False) -> None:  # noqa: ANN401 - a foreign module
    """Show a text while the mouse rests on the last item, even a disabled one, and none is pressed or takes text.

    ``typing`` is True for an item far from all fields, whose text is shown while one of them takes text, too.
    It lies beside an open menu or a panel, whose next rows stay free; otherwise below the item, or above it in the
    lower part of the window.
    """
    flags = imgui.HoveredFlags_.stationary | imgui.HoveredFlags_.delay_normal
    flags |= imgui.HoveredFlags_.allow_when_disabled | imgui.HoveredFlags_.no_shared_delay
    busy = imgui.is_any_mouse_down() or (imgui.is_any_item_active() and not typing)
    item = imgui.get_item_id()
    if (clicked := imgui.is_item_clicked()) or not imgui.is_item_hovered():
        (CLICKED.add if clicked else CLICKED.discard)(item)
    if not text or busy or item in CLICKED or not imgui.is_item_hovered(flags):
        return
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    screen = imgui.get_main_viewport().size
    # the pivot keeps the text within both sides of the window
    across, down = low.x / screen.x, low.y / screen.y
    left, right = imgui.get_window_pos().x, imgui.get_window_pos().x + imgui.get_window_size().x
    wide, narrow = WIDEST * imgui.get_font_size(), right - left < 0.5 * screen.x
    if imgui.is_popup_open("", imgui.PopupFlags_.any_popup):
        imgui.set_next_window_pos(imgui.ImVec2(high.x + imgui.get_font_size(), low.y))
    elif narrow and right + wide < screen.x:
        imgui.set_next_window_pos(imgui.ImVec2(right + 4, low.y), pivot=imgui.ImVec2(0, down))
    elif narrow and left > wide:
        imgui.set_next_window_pos(imgui.ImVec2(left - 4, low.y), pivot=imgui.ImVec2(1, down))
    elif down > 0.6:
        imgui.set_next_window_pos(imgui.ImVec2(low.x, low.y - 4), pivot=imgui.ImVec2(across, 1))
    else:
        imgui.set_next_window_pos(imgui.ImVec2(low.x, high.y + 8), pivot=imgui.ImVec2(across, 0))
    _show(imgui, text)


def area_tip(imgui: Any, corner: Sequence[float], size: Sequence[float], text: str) -> None:  # noqa: ANN401
    """Show a text while the mouse rests in a rectangle of the current window without a pressed button."""
    x, y = corner
    over = imgui.is_mouse_hovering_rect(imgui.ImVec2(x, y), imgui.ImVec2(x + size[0], y + size[1]))
    if not (over and text) or imgui.is_any_mouse_down():
        return
    if imgui.is_window_hovered(imgui.HoveredFlags_.stationary):
        _show(imgui, text)


def _show(imgui: Any, text: str) -> None:  # noqa: ANN401
    if not imgui.begin_tooltip():
        return
    width = min(WIDEST * imgui.get_font_size(), 0.8 * imgui.get_main_viewport().size.x)
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*style.INK))
    imgui.push_text_wrap_pos(width)
    imgui.text_unformatted(text)
    imgui.pop_text_wrap_pos()
    imgui.pop_style_color()
    imgui.end_tooltip()
