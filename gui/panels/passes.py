"""What each pass of the picture takes, as a table with bars."""

from __future__ import annotations

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
        w, imgui, feed = self._w, self._w.imgui, console.feed
        rows = shown_passes(feed.pass_ms)
        if not rows:
            w.text("timing the passes ...", style.QUIET)
            return
        total = sum(ms for _, ms in rows)
        flags = imgui.TableFlags_.sizing_stretch_prop
        if imgui.begin_table("passes", 3, flags):
            imgui.table_setup_column("pass", imgui.TableColumnFlags_.width_stretch, 0.45)
            imgui.table_setup_column("ms", imgui.TableColumnFlags_.width_stretch, 0.2)
            imgui.table_setup_column("share", imgui.TableColumnFlags_.width_stretch, 0.35)
            for name, ms in (*rows, ("picture", total)):
                imgui.table_next_row()
                imgui.table_next_column()
                colour = style.WARN if name == "picture" else style.INK
                w.one_line(w.elided(name, w.width), colour)
                w.tip(
                    "all of them: the whole picture" if name == "picture" else f"pass of the renderer: {name}"
                )
                imgui.table_next_column()
                imgui.text_unformatted(f"{ms:.1f}")
                w.tip("milliseconds a picture, median of five")
                imgui.table_next_column()
                self._bar(ms / total, colour)
            imgui.end_table()
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
