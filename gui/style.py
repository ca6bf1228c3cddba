"""Colours and spacing of the console: dark, quiet, one accent."""

from __future__ import annotations

from typing import Any

from flyaround.gui.texts import texts

Rgba = tuple[float, float, float, float]

INK: Rgba = (0.86, 0.89, 0.92, 1.0)
QUIET: Rgba = (0.53, 0.58, 0.64, 1.0)
GROUND: Rgba = (0.055, 0.066, 0.082, 1.0)
RAISED: Rgba = (0.105, 0.125, 0.152, 1.0)
EDGE: Rgba = (0.17, 0.20, 0.24, 1.0)
OUTLINE: Rgba = (0.26, 0.30, 0.35, 1.0)
"""Edge of fields, boxes and buttons, told apart from the background also where they are empty."""
PLATE: Rgba = (*GROUND[:3], 0.85)
"""Background of figures over a picture: dim text must be legible over sunlit clouds."""
HALO: Rgba = (0.0, 0.0, 0.0, 0.8)
"""Outline of text over a picture, for legibility on black and on sunlit clouds."""

# Colours that people with any of the usual colour deficiencies tell apart: Okabe & Ito (2008), Color Universal Design
SKY_BLUE: Rgba = (0.337, 0.706, 0.914, 1.0)
GREEN: Rgba = (0.0, 0.62, 0.451, 1.0)
ORANGE: Rgba = (0.902, 0.624, 0.0, 1.0)
YELLOW: Rgba = (0.941, 0.894, 0.259, 1.0)
VERMILLION: Rgba = (0.835, 0.369, 0.0, 1.0)
PURPLE: Rgba = (0.8, 0.475, 0.655, 1.0)
BLUE: Rgba = (0.0, 0.447, 0.698, 1.0)
"""Too dark for text and thin lines on the console's background; for areas."""

BODY: Rgba = (0.62, 0.64, 0.66, 1.0)
"""The body among the parts of a craft."""
SHADOW: Rgba = (0.62, 0.62, 0.7, 1.0)
"""The part of an orbit in the shadow of a body."""
PRIMARY: Rgba = (0.0, 0.40, 0.63, 1.0)
"""Fill of a primary action's button: `BLUE`, darkened for text."""
BRIGHT = 0.2
"""Luminance of a fill above which dark text has more contrast."""
GUARDED: Rgba = (0.42, 0.14, 0.06, 1.0)
"""Fill of the abort button while its guard is closed."""

ACCENT = SKY_BLUE
GOOD, WARN, BAD = GREEN, YELLOW, VERMILLION
WITHIN, NEAR, OUTSIDE = SKY_BLUE, YELLOW, VERMILLION  # colours by distance from a limit
LIMIT_COLORS: dict[str, Rgba] = {"within": WITHIN, "near": NEAR, "outside": OUTSIDE}
LIMIT_MARKS: dict[str, str] = {"within": "", "near": " over", "outside": " out"}
"""The same without colour."""
ESTIMATE: Rgba = (0.95, 0.6, 0.8, 1.0)
"""Colour of an estimator's output, beside the truth in `ACCENT`: `PURPLE`, lightened."""
AXIS_COLORS: tuple[Rgba, Rgba, Rgba] = (VERMILLION, GREEN, SKY_BLUE)
"""Colours of the axes x, y, z."""


def luminance(rgba: Rgba) -> float:
    """Return the relative luminance of an sRGB colour, ignoring its alpha (WCAG 2.1)."""
    r, g, b = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in rgba[:3])
    return 0.2126 * r + 0.7152 * g + 0.0722 * b


def over(front: Rgba, back: Rgba) -> Rgba:
    """Blend a colour over an opaque one."""
    a = front[3]
    r, g, b = (a * f + (1 - a) * k for f, k in zip(front[:3], back[:3], strict=True))
    return (r, g, b, 1.0)


def letters_on(fill: Rgba) -> Rgba:
    """Return the text colour on a fill: dark on a bright one."""
    return GROUND if luminance(over(fill, GROUND)) > BRIGHT else INK


LIT = over((*ACCENT[:3], 0.45), GROUND)
"""Fill of a button whose command is on; opaque, for buttons over pictures."""


def apply_style(imgui: Any, scale: float) -> None:  # noqa: ANN401 - the binding has no types
    """Set Dear ImGui's style.

    Parameters
    ----------
    imgui : object
        Module ``imgui_bundle.imgui``.
    scale : float
        Scale of the monitor.
    """
    style = imgui.get_style()
    imgui.style_colors_dark()
    for name, size in texts("style").items():
        setattr(style, name, imgui.ImVec2(*size) if isinstance(size, list) else size)
    style.window_menu_button_position = imgui.Dir.none
    style.scale_all_sizes(scale)
    for key, names in texts("colours").items():
        colour, _, share = key.partition(" ")
        r, g, b, alpha = globals()[colour]
        for name in names.split():
            style.set_color_(getattr(imgui.Col_, name), imgui.ImVec4(r, g, b, float(share or alpha)))
