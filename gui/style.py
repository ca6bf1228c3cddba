"""Colours and spacing of the console: dark, quiet, one accent."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from typing import Any

Rgba = tuple[float, float, float, float]

INK: Rgba = (0.86, 0.89, 0.92, 1.0)
QUIET: Rgba = (0.53, 0.58, 0.64, 1.0)
ACCENT: Rgba = (0.33, 0.72, 0.98, 1.0)
GOOD: Rgba = (0.38, 0.85, 0.55, 1.0)
WARN: Rgba = (0.98, 0.72, 0.26, 1.0)
BAD: Rgba = (0.96, 0.39, 0.37, 1.0)
GROUND: Rgba = (0.055, 0.066, 0.082, 1.0)
RAISED: Rgba = (0.105, 0.125, 0.152, 1.0)
EDGE: Rgba = (0.17, 0.20, 0.24, 1.0)
AXIS_COLORS: tuple[Rgba, Rgba, Rgba] = (
    (0.98, 0.36, 0.36, 1.0),
    (0.42, 0.88, 0.44, 1.0),
    (0.42, 0.62, 1.0, 1.0),
)


def apply_style(imgui: Any, scale: float) -> None:  # noqa: ANN401 - the binding has no types
    """Set Dear ImGui's style.

    Parameters
    ----------
    imgui : the module. scale : of the monitor.
    """
    style = imgui.get_style()
    imgui.style_colors_dark()
    style.window_rounding = 0.0
    style.child_rounding = style.popup_rounding = 5.0
    style.frame_rounding = style.grab_rounding = 3.0
    style.window_border_size = 0.0
    style.frame_border_size = 0.0
    style.window_padding = imgui.ImVec2(12, 10)
    style.frame_padding = imgui.ImVec2(8, 4)
    style.item_spacing = imgui.ImVec2(8, 5)
    style.item_inner_spacing = imgui.ImVec2(6, 4)
    style.scrollbar_size = 10.0
    style.scale_all_sizes(scale)
    col = imgui.Col_
    accent = ACCENT[:3]
    for which, color in (
        (col.text, INK),
        (col.text_disabled, QUIET),
        (col.window_bg, GROUND),
        (col.child_bg, GROUND),
        (col.popup_bg, (*GROUND[:3], 0.97)),
        (col.border, EDGE),
        (col.frame_bg, RAISED),
        (col.frame_bg_hovered, EDGE),
        (col.frame_bg_active, EDGE),
        (col.button, RAISED),
        (col.button_hovered, EDGE),
        (col.button_active, (*accent, 0.45)),
        (col.header, RAISED),
        (col.header_hovered, EDGE),
        (col.header_active, EDGE),
        (col.check_mark, ACCENT),
        (col.slider_grab, (*accent, 0.8)),
        (col.slider_grab_active, ACCENT),
        (col.tab, RAISED),
        (col.tab_hovered, EDGE),
        (col.tab_selected, (*accent, 0.35)),
        (col.tab_dimmed, GROUND),
        (col.tab_dimmed_selected, RAISED),
        (col.tab_selected_overline, ACCENT),
        (col.tab_dimmed_selected_overline, EDGE),
        (col.title_bg, GROUND),
        (col.title_bg_active, RAISED),
        (col.menu_bar_bg, RAISED),
        (col.docking_preview, (*accent, 0.5)),
        (col.docking_empty_bg, GROUND),
        (col.resize_grip, EDGE),
        (col.separator_hovered, (*accent, 0.6)),
        (col.separator_active, ACCENT),
        (col.separator, EDGE),
        (col.scrollbar_bg, (0.0, 0.0, 0.0, 0.0)),
        (col.scrollbar_grab, EDGE),
    ):
        style.set_color_(which, imgui.ImVec4(*color))
