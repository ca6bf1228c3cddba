"""Sizes, text, frames and rows of figures, over one window's Dear ImGui."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flyaround.gui import hover_text, style

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from contextlib import AbstractContextManager

    from flyaround.gui.surface import Surface

DRAGGED = "figure"
"""Type of the drag-and-drop payload of a row of figures."""


class TextWidgets:
    """Text and sizes in the current panel.

    Parameters
    ----------
    window : Surface
        Surface with the fonts and scale.
    """

    def __init__(self, window: Surface) -> None:
        self.window, self.imgui, self.implot, self.ctx = window, window.imgui, window.implot, window.ctx

    # --- sizes

    @property
    def width(self) -> float:
        """Available width of the panel [px]."""
        return float(self.imgui.get_content_region_avail().x)

    @property
    def line(self) -> float:
        """Height of a line of text [px]."""
        return float(self.imgui.get_text_line_height_with_spacing())

    def button_width(self, label: str) -> float:
        """Return the width of a button with this label [px]."""
        return float(self.imgui.calc_text_size(label).x + 2 * self.imgui.get_style().frame_padding.x)

    def flow(self, width: float, *, first: bool) -> None:
        """Continue the line if an item of this width still fits."""
        imgui = self.imgui
        if first:
            return
        end = imgui.get_item_rect_max().x + imgui.get_style().item_spacing.x + width
        if end <= imgui.get_cursor_screen_pos().x + self.width:
            imgui.same_line()

    def grid(self, count: int, least: float, fewest: int = 1) -> Iterator[float]:
        """Yield the width of each of ``count`` cells, in columns of at least the width ``least`` at scale 1."""
        spacing = self.imgui.get_style().item_spacing.x
        columns = max(fewest, int((self.width + spacing) / (least * self.window.scale + spacing)))
        width = (self.width - (columns - 1) * spacing) / columns
        start, step = self.imgui.get_cursor_pos_x(), width + spacing
        for k in range(count):
            if k % columns:
                self.imgui.same_line()
                # not an offset of the line, which a table's column would add again
                self.imgui.set_cursor_pos_x(start + k % columns * step)
            yield width

    def frame(self, rgba: style.Rgba, rect: Sequence[float] = (), window: Any = None) -> None:  # noqa: ANN401
        """Draw a frame over a Dear ImGui window, and below those that float over it.

        Parameters
        ----------
        rgba : Rgba
            Colour.
        rect : sequence of float, optional
            Left, top, right and bottom; by default the whole window.
        window : object, optional
            The window, by default the current one.
        """
        native = window or self.imgui.internal.get_current_window()
        low, high = native.pos, self.vec(native.pos.x + native.size.x, native.pos.y + native.size.y)
        x, y, right, bottom = rect or (low.x + 1, low.y + 1, high.x - 1, high.y - 1)
        native.draw_list.push_clip_rect(low, high)
        native.draw_list.add_rect(self.vec(x, y), self.vec(right, bottom), self.color(rgba), 3.0, 2.0)
        native.draw_list.pop_clip_rect()

    # --- text

    def section(self, title: str) -> None:
        """Draw a heading."""
        self.imgui.dummy(self.imgui.ImVec2(0, 1))
        with self.coloured(style.ACCENT):
            self.imgui.separator_text(self.elided(title, self.width - 30 * self.window.scale))

    def coloured(self, rgba: style.Rgba) -> AbstractContextManager[object]:
        """Colour the text of a ``with`` block."""
        return self.ctx.push_style_color(self.imgui.Col_.text, self.imgui.ImVec4(*rgba))

    def one_line(self, text: str, rgba: style.Rgba) -> None:
        """Draw coloured text without wrapping."""
        with self.coloured(rgba):
            self.imgui.text_unformatted(text)

    def text(self, text: str, rgba: style.Rgba = style.INK, tip: str = "") -> None:
        """Draw text that wraps at the panel's edge; ``tip`` is its hover text."""
        with self.ctx.push_text_wrap_pos(0.0):
            self.one_line(text, rgba)
        if tip:
            self.tip(tip)

    def elided(self, text: str, width: float) -> str:
        """Return the text, or as much of its beginning as fits, with an ellipsis."""
        size = self.imgui.calc_text_size
        if size(text).x <= width:
            return text
        length = len(text)
        while length > 1 and size(text[:length] + "...").x > width:
            length -= 1
        return text[:length].rstrip() + "..."

    def cut_line(
        self, text: str, width: float, rgba: style.Rgba, tip: str = "", *, typing: bool = False
    ) -> None:
        """Draw as much of a text as fits; its hover text has the whole of it before ``tip``."""
        shown = self.elided(text, width)
        self.one_line(shown, rgba)
        hover_text.item_tip(self.imgui, tip if shown == text else f"{text}\n{tip}".strip(), typing=typing)

    def lines(self, text: str, rgba: style.Rgba, tip: str = "", count: int = 2) -> None:
        """Draw text that wraps, in the height of as many lines, so that what stands below does not move."""
        imgui = self.imgui
        low = imgui.get_cursor_pos_y() + count * imgui.get_text_line_height()
        self.text(text, rgba, tip)
        rest = low - imgui.get_cursor_pos_y()
        if rest > 0:
            imgui.dummy(imgui.ImVec2(0, rest))

    def tip(self, text: str) -> None:
        """Give the last item a hover text."""
        hover_text.item_tip(self.imgui, text)

    def row(
        self, name: str, values: Sequence[float | str], form: str, tip: str, *, figure: int | None = None
    ) -> None:
        """Draw a line of figures, which go below the name in a narrow panel.

        Parameters
        ----------
        name : str
            Label of the line.
        values : sequence of float or str
            Figures in order, or the names of their axes.
        form : str
            Format of each figure, as for ``str.format``.
        tip : str
            Hover text.
        figure : int, optional
            Index for dragging it into a plot; None if it cannot be dragged.
        """
        imgui = self.imgui
        figures = " ".join(form.format(v) for v in values)
        self.one_line(name, style.QUIET)
        self.tip(tip)
        label = max(imgui.calc_text_size(name).x, imgui.calc_text_size("Velocity [m/s]").x)
        imgui.push_font(self.window.figure_font, 0.0)
        width = imgui.calc_text_size(figures).x
        if label + 8 + width <= self.width:
            imgui.same_line(imgui.get_cursor_pos_x() + self.width - width)
        shown = self.elided(figures, self.width)
        imgui.text_unformatted(shown)
        if figure is not None and imgui.begin_drag_drop_source(imgui.DragDropFlags_.source_allow_null_id):
            imgui.set_drag_drop_payload_py_id(DRAGGED, figure)
            imgui.text_unformatted(f"{name.strip()}: drop it in Plots")
            imgui.end_drag_drop_source()
        self.tip(tip if shown == figures else f"{figures}\n{tip}")
        imgui.pop_font()

    # --- values of Dear ImGui

    def vec(self, x: float, y: float) -> Any:  # noqa: ANN401 - an imgui value
        """Return a point."""
        return self.imgui.ImVec2(x, y)

    def color(self, rgba: style.Rgba) -> int:
        """Return a colour for a draw list."""
        return int(self.imgui.color_convert_float4_to_u32(self.imgui.ImVec4(*rgba)))
