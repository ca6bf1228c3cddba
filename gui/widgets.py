"""Small parts that panels share: sections, rows of figures, buttons of commands, text that never leaves its panel."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

from flyaround.gui import hover_text, style

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.gui.command_table import Value
    from flyaround.gui.console import Console
    from flyaround.gui.surface import Surface


DRAGGED = "figure"
"""Type of the drag-and-drop payload of a row of figures."""


class Widgets:
    """Parts over one window's Dear ImGui.

    Parameters
    ----------
    window : whose fonts and scale are used.
    """

    def __init__(self, window: Surface) -> None:
        self.window = window
        self.imgui = window.imgui
        self.implot = window.implot

    @property
    def width(self) -> float:
        """What is free in the panel, across."""
        return float(self.imgui.get_content_region_avail().x)

    @property
    def line(self) -> float:
        """Height of a line of text."""
        return float(self.imgui.get_text_line_height_with_spacing())

    def section(self, title: str) -> None:
        """A heading."""
        self.imgui.dummy(self.imgui.ImVec2(0, 1))
        self.coloured(style.ACCENT)
        self.imgui.separator_text(self.elided(title, self.width - 30 * self.window.scale))
        self.imgui.pop_style_color()

    def coloured(self, rgba: style.Rgba) -> None:
        """Text of this colour until ``imgui.pop_style_color``."""
        self.imgui.push_style_color(self.imgui.Col_.text, self.imgui.ImVec4(*rgba))

    def one_line(self, text: str, rgba: style.Rgba) -> None:
        """Text of this colour that is not wrapped."""
        self.coloured(rgba)
        self.imgui.text_unformatted(text)
        self.imgui.pop_style_color()

    def columns(self, least: float, fewest: int = 1) -> tuple[int, float]:
        """Return how many columns of at least this width fit at scale 1, and the width of each."""
        spacing = self.imgui.get_style().item_spacing.x
        n = max(fewest, int((self.width + spacing) / (least * self.window.scale + spacing)))
        return n, (self.width - (n - 1) * spacing) / n

    def text(self, text: str, rgba: style.Rgba = style.INK, tip: str = "") -> None:
        """Text that goes on in the next line where the panel ends; ``tip`` is told over it."""
        self.coloured(rgba)
        self.imgui.push_text_wrap_pos(0.0)
        self.imgui.text_unformatted(text)
        self.imgui.pop_text_wrap_pos()
        self.imgui.pop_style_color()
        if tip:
            self.tip(tip)

    def elided(self, text: str, width: float) -> str:
        """The text, or as much of its beginning as fits, with an ellipsis."""
        size = self.imgui.calc_text_size
        if size(text).x <= width:
            return text
        kept = len(text)
        while kept > 1 and size(text[:kept] + "...").x > width:
            kept -= 1
        return text[:kept].rstrip() + "..."

    def tip(self, text: str) -> None:
        """What the mouse over the last part tells."""
        hover_text.tell_item(self.imgui, text)

    def about(self, console: Console, name: str, *given: Value, argument: str = "") -> None:
        """Tell of the last part what its command does, by which key, and what its arguments are, with their units.

        Parameters
        ----------
        given : arguments that the part has. argument : the only one that it is for.
        """
        command = console.table[name]
        if argument:
            self.tip(next(a.about for a in command.arguments if a.name == argument))
        else:
            self.tip(command.about(*given))

    def row(
        self, name: str, values: Sequence[float], form: str, tip: str, *, figure: int | None = None
    ) -> None:
        """A line of figures; the figures go under the name where the panel is narrow.

        Parameters
        ----------
        figure : number under which it can be dragged into a plot; None where it cannot.
        """
        imgui = self.imgui
        figures = " ".join(form.format(v) for v in values)
        imgui.push_font(self.window.figure_font, 0.0)
        self.one_line(name, style.QUIET)
        self.tip(tip)
        width = imgui.calc_text_size(figures).x
        if max(imgui.calc_text_size(name).x, imgui.calc_text_size("Rel. °/s").x) + 8 + width <= self.width:
            imgui.same_line(imgui.get_cursor_pos_x() + self.width - width)
        imgui.text_unformatted(self.elided(figures, self.width))
        if figure is not None and imgui.begin_drag_drop_source(imgui.DragDropFlags_.source_allow_null_id):
            imgui.set_drag_drop_payload_py_id(DRAGGED, figure)
            imgui.text_unformatted(f"{name.strip()}: drop it in Plots")
            imgui.end_drag_drop_source()
        self.tip(tip)
        imgui.pop_font()

    def flow(self, width: float, *, first: bool) -> None:
        """Stay in the line if a part of this width still fits."""
        imgui = self.imgui
        if first:
            return
        end = imgui.get_item_rect_max().x + imgui.get_style().item_spacing.x + width
        if end <= imgui.get_cursor_screen_pos().x + self.width:
            imgui.same_line()

    def button(
        self,
        console: Console,
        name: str,
        *arguments: Value,
        label: str | None = None,
        width: float = 0.0,
        on: bool = False,
    ) -> None:
        """A button of a command, with its help and key.

        Parameters
        ----------
        label : instead of the command's title. width : 0 for what the label needs. on : lit.
        """
        command = console.table[name]
        if on:
            self.imgui.push_style_color(self.imgui.Col_.button, self.imgui.ImVec4(*style.ACCENT[:3], 0.45))
        text = label if label is not None else command.title
        if self.imgui.button(f"{text}##{name}{arguments}", self.imgui.ImVec2(width, 0)):
            console.do(name, *arguments)
        if on:
            self.imgui.pop_style_color()
        self.about(console, name, *arguments)

    def buttons(self, console: Console, names: Sequence[str], per_row: int) -> None:
        """Buttons of one width, so many in a row or fewer in a narrow panel."""
        spacing = self.imgui.get_style().item_spacing.x
        widest = max(self.imgui.calc_text_size(console.table[n].title).x for n in names)
        widest += 2 * self.imgui.get_style().frame_padding.x
        per_row = max(1, min(per_row, int((self.width + spacing) / (widest + spacing))))
        width = (self.width - (per_row - 1) * spacing) / per_row
        for k, name in enumerate(names):
            if k % per_row:
                self.imgui.same_line()
            state = console.table[name].state
            self.button(console, name, width=width, on=state is not None and state(console))

    def switch(self, console: Console, name: str, label: str | None = None) -> None:
        """A tick box of a command that is switched."""
        command = console.table[name]
        state = command.state is not None and command.state(console)
        changed, value = self.imgui.checkbox(f"{label or command.title}##{name}", state)
        if changed:
            console.do(name, value) if command.arguments else console.do(name)
        self.about(console, name)

    def switches(self, console: Console, names: Sequence[str]) -> None:
        """Tick boxes in as many columns as fit, two at most."""
        widest = max(self.imgui.calc_text_size(console.table[n].title).x for n in names)
        column = self.width / 2
        two = widest + 2.5 * self.imgui.get_frame_height() <= column
        start = self.imgui.get_cursor_pos_x()
        for k, name in enumerate(names):
            if two and k % 2:
                self.imgui.same_line(start + column)
            self.switch(console, name)

    def vec(self, x: float, y: float) -> Any:  # noqa: ANN401 - an imgui value
        """A point."""
        return self.imgui.ImVec2(x, y)

    def color(self, rgba: style.Rgba) -> int:
        """A colour for a draw list."""
        return int(self.imgui.color_convert_float4_to_u32(self.imgui.ImVec4(*rgba)))


class Panel(ABC):
    """A panel or view of the window.

    ``name`` is of its command (``panel.NAME``), with its ``keys``. ``place`` is the dock at first (``over``: a window
    of its own in the middle), ``shown`` whether it is open at first, ``bare`` whether it draws up to its edges.
    """

    name: str
    title: str
    place: str
    shown: bool
    keys: tuple[str, ...] = ()
    bare = False

    def __init__(self, window: Surface) -> None:
        self._window = window
        self._imgui = window.imgui
        self._w = Widgets(window)

    @abstractmethod
    def draw(self, console: Console) -> None:
        """Draw into the current Dear ImGui window."""

    def _free(self, least: float) -> tuple[float, float, float, float]:
        """Return the free rectangle: left, top, width and height, both at least ``least``."""
        corner, free = self._imgui.get_cursor_screen_pos(), self._imgui.get_content_region_avail()
        return corner.x, corner.y, max(free.x, least), max(free.y, least)
