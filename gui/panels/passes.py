"""Time of each pass of the picture, as a table with bars."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.views.camera import shown_passes
from flyaround.gui.widgets import Panel

if TYPE_CHECKING:
    from flyaround.gui.console import Console


class PassesPanel(Panel):
    """Times of the passes, medians of five pictures, and what draws."""

    name, title, place, shown = "passes", "Passes", "right-low", False

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w, feed = self._w, console.feed
        rows = shown_passes(feed.pass_ms)
        if not rows:
            w.text("timing the passes ...", style.QUIET)
            return
        total = sum(ms for _, ms in rows)
        cells = []
        for name, ms in (*rows, ("picture", total)):
            whole = name == "picture"
            colour = style.WARN if whole else style.INK
            about = "all of them: the whole picture" if whole else f"pass of the renderer: {name}"
            cells.append(
                (
                    partial(w.text, name, colour, about),
                    partial(w.text, f"{ms:.1f} ms", tip="milliseconds a picture, median of five"),
                    partial(self._bar, ms / total, colour),
                )
            )
        w.table("passes", (0.45, 0.2, 0.35), cells)
        picture = feed.newest
        if picture is not None:
            height, width = picture.frame.image.shape[:2]
            size = f"{width} x {height} px, {picture.frame.scene.quality}"
            w.text(size, style.QUIET, "pixels of the picture that was timed, and its quality preset")
        w.text(
            "The renderer waits after each pass while this is open: a few milliseconds a picture.",
            style.QUIET,
        )

    def _bar(self, share: float, rgba: style.Rgba) -> None:
        imgui, w = self._w.imgui, self._w
        at, height = imgui.get_cursor_screen_pos(), imgui.get_text_line_height()
        across = max(w.width * share, 1.0)
        imgui.get_window_draw_list().add_rect_filled(
            w.vec(at.x, at.y + 0.25 * height),
            w.vec(at.x + across, at.y + 0.75 * height),
            w.color((*rgba[:3], 0.8)),
        )
        imgui.dummy(w.vec(across, height))
