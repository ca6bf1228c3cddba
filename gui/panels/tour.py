"""The tour: a few short cards, each beside what it speaks of. Shown at the first start, and by Help, Tour."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.widgets import Panel

if TYPE_CHECKING:
    from flyaround.gui.console import Console

CARDS = (
    (
        "camera",
        "The chaser's camera",
        "This is what the sensor sees, live. W A S D R F push, I K J L U O turn.",
    ),
    (
        "transport",
        "Time",
        "Space pauses, + and - change the rate. Ctrl+T opens the timeline: any place of the flight again.",
    ),
    (
        "chaser",
        "Who flies",
        "Guidance flies until the first key. G gives the chaser back to it, X brings it to rest.",
    ),
    (
        "lvlh-map",
        "The map",
        "Where the chaser was and where it drifts, in the target's frame. Wheel and drag move it.",
    ),
    (
        "picture",
        "Overlays",
        "Keypoints, box, axes, wireframe, exposure. Ctrl+Z takes a change of settings back.",
    ),
    (
        "status",
        "Messages",
        "The lamp lights for cautions; F9: they were seen. Both rates stand on the right.",
    ),
    (
        "menu",
        "All the rest",
        "Every command is in the menus, in F1 and in Ctrl+P. ? tells about the panel under the mouse.",
    ),
)
"""Panel (or bar) that a card points at, its title, its text."""


class TourPanel(Panel):
    """A card at a time; Escape ends the tour."""

    name, title, place, shown = "tour", "Tour", "over", False

    def draw(self, console: Console) -> None:
        """Draw into the current window."""
        w, imgui = self._w, self._w.imgui
        scale = w.window.scale
        step = min(max(console.help.tour_step, 0), len(CARDS) - 1)
        about, title, text = CARDS[step]
        self._place(console, about)
        w.one_line(f"{step + 1} of {len(CARDS)}   {title}", style.ACCENT)
        w.text(text)
        imgui.dummy(w.vec(0, 4 * scale))
        if step:
            w.button(console, "help.tour-back", label="Back")
            imgui.same_line()
        if step + 1 < len(CARDS):
            w.button(console, "help.tour-next", label="Next")
            imgui.same_line()
        w.button(console, "help.tour-end", label="Skip" if step + 1 < len(CARDS) else "Done")

    def _place(self, console: Console, about: str) -> None:
        """Beside what the card speaks of, inside the window; what it speaks of is framed."""
        w, imgui = self._w, self._w.imgui
        scale, screen = w.window.scale, imgui.get_main_viewport()
        width, height = min(340 * scale, 0.9 * screen.size.x), 150 * scale
        x, y, wide, tall = console.help.rects.get(about, (0.0, 0.0, screen.size.x, screen.size.y))
        left = x - width - 12 * scale
        if left < 0:
            left = (
                x + wide + 12 * scale
                if x + wide + width + 12 * scale < screen.size.x
                else x + (wide - width) / 2
            )
        top = y if about != "status" else y - height - 12 * scale
        top += 12 * scale if about in ("camera", "menu") else 0
        if about == "menu":
            top = y + tall + 12 * scale
        imgui.set_window_pos(
            w.vec(
                min(max(left, 8.0), screen.size.x - width - 8), min(max(top, 8.0), screen.size.y - height - 8)
            )
        )
        imgui.set_window_size(w.vec(width, height))
        draw = imgui.get_foreground_draw_list()
        draw.add_rect(w.vec(x + 1, y + 1), w.vec(x + wide - 1, y + tall - 1), w.color(style.ACCENT), 3.0, 2.0)
