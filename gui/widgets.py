"""Widgets that panels share: headings, rows of figures, controls of commands, tables, plots, wrapped text."""

from __future__ import annotations

from abc import ABC, abstractmethod
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from flyaround.gui import hover_text, style
from flyaround.gui.icons import PRIMARY, labelled
from flyaround.simulator.piloting.readouts import mission_time

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from flyaround.gui.command_table import Argument, Value
    from flyaround.gui.console import Console
    from flyaround.gui.surface import Surface


DRAGGED = "figure"
"""Type of the drag-and-drop payload of a row of figures."""


class Widgets:
    """Widgets over one window's Dear ImGui.

    Parameters
    ----------
    window : Surface
        Surface with the fonts and scale.
    """

    def __init__(self, window: Surface) -> None:
        self.window = window
        self.imgui = window.imgui
        self.implot = window.implot
        self._refused: dict[object, tuple[str, str]] = {}
        """Typed texts that were refused, and the reasons, by field and owner."""
        self._good: dict[str, str] = {}
        """Last right text of each field, by its key; of one that follows a value, the text while it takes input."""
        self._drawn: dict[object, int] = {}
        """Number of the last frame in which a field was drawn."""

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
        self.coloured(style.ACCENT)
        self.imgui.separator_text(self.elided(title, self.width - 30 * self.window.scale))
        self.imgui.pop_style_color()

    def coloured(self, rgba: style.Rgba) -> None:
        """Colour text until ``imgui.pop_style_color``."""
        self.imgui.push_style_color(self.imgui.Col_.text, self.imgui.ImVec4(*rgba))

    def one_line(self, text: str, rgba: style.Rgba) -> None:
        """Draw coloured text without wrapping."""
        self.coloured(rgba)
        self.imgui.text_unformatted(text)
        self.imgui.pop_style_color()

    def text(self, text: str, rgba: style.Rgba = style.INK, tip: str = "") -> None:
        """Draw text that wraps at the panel's edge; ``tip`` is its hover text."""
        self.imgui.push_text_wrap_pos(0.0)
        self.one_line(text, rgba)
        self.imgui.pop_text_wrap_pos()
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

    def tip(self, text: str) -> None:
        """Give the last item a hover text."""
        hover_text.item_tip(self.imgui, text)

    def command_tip(self, console: Console, name: str, *given: Value, argument: str = "") -> None:
        """Give the last item the hover text of its command: purpose, key, and arguments with their units.

        Parameters
        ----------
        console : Console
            The console.
        name : str
            Name of the command.
        given : Value
            Arguments that the item supplies.
        argument : str, optional
            Name of the only one that it sets.
        """
        command = console.table[name]
        if argument:
            self.tip(next(a.description for a in command.arguments if a.name == argument))
        else:
            self.tip(command.hover_text(*given))

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

    def heads(self, names: Sequence[str]) -> None:
        """Draw the names of fields that follow in as many columns."""
        for name, _ in zip(names, self.grid(len(names), 1e6, len(names)), strict=True):
            self.one_line(name, style.QUIET)

    def field(self, text: str, tip: str, share: float, rgba: style.Rgba = style.INK) -> None:
        """Draw the name of the next control, which gets at most this share of the line, at its end."""
        imgui = self.imgui
        width = min(16 * share * imgui.get_font_size(), share * self.width)
        end = imgui.get_cursor_pos_x() + self.width
        imgui.align_text_to_frame_padding()
        self.cut_line(text, self.width - width - 8, rgba, tip)
        imgui.same_line(end - width)
        imgui.set_next_item_width(width)

    def typed(self, key: str, text: str, argument: Argument, title: str, follows: str = "") -> str:
        """Draw a field for an argument's value, which says what is wrong with its text.

        Parameters
        ----------
        key : str
            Identifier within the panel.
        text : str
            Typed text.
        argument : Argument
            The argument.
        title : str
            Name of the group of fields, for refusals.
        follows : str, optional
            Value that the field shows, dimmed, while its text is empty: before any input, and after Esc.

        Returns
        -------
        str
            The text; empty if the field follows a value.
        """
        shown = text or self._good.get(key, "") or follows if follows else text
        self.coloured(style.QUIET if follows and not text else style.INK)
        new = self._number(key, shown)
        self.imgui.pop_style_color()
        text = new if text or new != shown else ""
        given_up, escaped = self._given_up(key), self.imgui.is_item_deactivated()
        if given_up and ((escaped and follows) or argument.flaw(text or follows, title)):
            text = "" if follows else self._good.get(key, "")
        self.flaw(flaw := argument.flaw(text or follows, title))
        if follows:
            # a value that changes under the cursor is no input
            self._good[key] = shown if self.imgui.is_item_active() else ""
        elif not flaw:
            self._good[key] = text
        self.tip(flaw or argument.description + "; dim: it follows, Esc lets it follow again" * bool(follows))
        return text

    def _number(self, key: str, text: str) -> str:
        """Draw a text field, in which a double click selects everything; return its text."""
        imgui = self.imgui
        text = str(imgui.input_text(f"##{key}", text)[1])
        if imgui.is_item_active() and imgui.is_mouse_double_clicked(0):
            # Dear ImGui selects a word, which of -0.02 are its last digits
            imgui.internal.get_input_text_state(imgui.get_item_id()).select_all()
        return text

    def entry(self, key: str, shown: str, take: Callable[[str], str], tip: str, of: object = None) -> None:
        """Draw a field for a value that Enter, or leaving the field, hands to ``take``.

        What ``take`` refuses stays in the field until it is mended, Esc brings the value back, or the panel is hidden.

        Parameters
        ----------
        key : str
            Identifier within the panel.
        shown : str
            Present value.
        take : callable
            Function that takes a text and returns why it refuses it, or an empty text.
        tip : str
            Hover text.
        of : object, optional
            Owner of the value, if the field may become another one's.
        """
        imgui = self.imgui
        text = self._number(key, self._refused.get((key, of), (shown, ""))[0])
        ended = imgui.is_item_deactivated_after_edit() and not imgui.is_key_pressed(imgui.Key.escape)
        given_up = self._given_up((key, of))
        if ended and (refusal := take(text)):
            self._refused[key, of] = text, refusal
        elif ended or given_up:
            self._refused.pop((key, of), None)
        self.flaw(flaw := self._refused.get((key, of), ("", ""))[1])
        self.tip(flaw or f"{tip}; Enter applies it, Esc discards it")

    def _given_up(self, key: object) -> bool:
        """Return True on Esc, and if the field was out of sight since it was last drawn."""
        now = self.imgui.get_frame_count()
        before, self._drawn[key] = self._drawn.get(key, now), now
        return now > before + 1 or self.imgui.is_key_pressed(self.imgui.Key.escape)

    def flaw(self, text: str) -> None:
        """Frame the last item, and say in the message line what is wrong with its value; unless empty."""
        if text and self.imgui.is_item_visible():
            low, high = self.imgui.get_item_rect_min(), self.imgui.get_item_rect_max()
            self.frame(style.BAD, (low.x, low.y, high.x, high.y))
            self.window.flaw = text

    # --- controls of commands

    def button(
        self,
        console: Console,
        name: str,
        *arguments: Value,
        label: str | None = None,
        width: float = 0.0,
        on: bool = False,
        icon: str = "",
        fill: style.Rgba | None = None,
        enabled: bool = True,
    ) -> None:
        """Draw a button of a command with its icon and hover text.

        Parameters
        ----------
        console : Console
            The console.
        name : str
            Name of the command.
        *arguments : Value
            Arguments of the command.
        label : str, optional
            Replaces the command's title.
        width : float, optional
            0 for that of the label, -1 for the rest of the line.
        on : bool, optional
            True if lit.
        icon : str, optional
            Icon of another command or state.
        fill : Rgba, optional
            Colour, by default that of a primary command.
        enabled : bool, optional
            False for a grey one, which stays in its place.
        """
        fill = fill or (style.PRIMARY if name in PRIMARY else style.LIT if on else None)
        text = labelled(icon or name, console.table[name].title if label is None else label)
        # label and numbers may change while a button is down, so they are not part of its identity
        words = " ".join(a for a in arguments if isinstance(a, str))
        self.imgui.begin_disabled(not enabled)
        if self.filled_button(f"{text}###{name} {words}", width, fill):
            console.do(name, *arguments)
        self.imgui.end_disabled()
        self.command_tip(console, name, *arguments)

    def filled_button(self, label: str, width: float, fill: style.Rgba | None) -> bool:
        """Draw a button of a colour, also when hovered; return True if it was clicked."""
        imgui = self.imgui
        if fill is not None:
            self.coloured(style.letters_on(fill))
            lighter = style.over((*style.INK[:3], 0.08), style.over(fill, style.GROUND))
            for which, colour in ((imgui.Col_.button, fill), (imgui.Col_.button_hovered, lighter)):
                imgui.push_style_color(which, imgui.ImVec4(*colour))
        clicked = bool(imgui.button(label, imgui.ImVec2(width, 0)))
        if fill is not None:
            imgui.pop_style_color(3)
        return clicked

    def buttons(self, console: Console, names: Sequence[str], per_row: int, primary: str = "") -> None:
        """Draw buttons of one width, ``per_row`` in a row, or fewer in a narrow panel; ``primary`` is filled."""
        imgui = self.imgui
        widest = max(self.button_width(labelled(n, console.table[n].title)) for n in names)
        widest = (
            max(widest, (self.width + imgui.get_style().item_spacing.x) / per_row - 9) / self.window.scale
        )
        for name, width in zip(names, self.grid(len(names), widest), strict=True):
            state = console.table[name].state
            fill = style.PRIMARY if name == primary else None
            self.button(console, name, width=width, on=state is not None and state(console), fill=fill)

    def switch(self, console: Console, name: str, label: str | None = None) -> None:
        """Draw a tick box of a switch."""
        command = console.table[name]
        state = command.state is not None and command.state(console)
        changed, value = self.imgui.checkbox(f"{label or command.title}##{name}", state)
        if changed:
            console.do(name, value) if command.arguments else console.do(name)
        self.command_tip(console, name)

    def switches(self, console: Console, names: Sequence[str], beside: Sequence[str] = ()) -> None:
        """Draw tick boxes in as many columns as fit, which are also those of the switches ``beside``."""
        widest = max(self.imgui.calc_text_size(console.table[n].title).x for n in (*names, *beside))
        column = (widest + 1.9 * self.imgui.get_frame_height()) / self.window.scale
        for name, _ in zip(names, self.grid(len(names), column), strict=True):
            self.switch(console, name)

    def choice(
        self,
        console: Console,
        name: str,
        now: str,
        names: Sequence[str],
        *,
        shown: Callable[[str], str] = str,
        argument: str = "",
        width: float = -1.0,
    ) -> str:
        """Draw a list of choices for a command's argument; return the selected one.

        A new choice runs the command, unless it has other arguments.

        Parameters
        ----------
        console : Console
            The console.
        name : str
            Name of the command.
        now : str
            Present choice.
        names : sequence of str
            All choices.
        shown : callable, optional
            Function that returns the text of a choice.
        argument : str, optional
            Name of the argument, if the command has others.
        width : float, optional
            Width on the screen; -1 for the rest of the line.
        """
        imgui = self.imgui
        imgui.set_next_item_width(width)
        changed, k = imgui.combo(f"##{name}{argument}", names.index(now), [shown(n) for n in names])
        self.command_tip(console, name, argument=argument)
        if changed and not argument:
            console.do(name, names[k])
        return names[k]

    # --- tables and plots

    def table(
        self,
        name: str,
        shares: Sequence[float],
        rows: Iterable[Sequence[Callable[[], object]]],
        heads: Sequence[str] = (),
    ) -> None:
        """Draw a table.

        Parameters
        ----------
        name : str
            Identifier within the panel.
        shares : sequence of float
            Relative widths of the columns.
        rows : iterable of sequence of callable
            Functions that draw the cells.
        heads : sequence of str, optional
            Titles of the columns.
        """
        imgui = self.imgui
        if not imgui.begin_table(name, len(shares), imgui.TableFlags_.sizing_stretch_prop):
            return
        for share, head in zip(shares, heads or [""] * len(shares), strict=True):
            imgui.table_setup_column(head, imgui.TableColumnFlags_.width_stretch, share)
        if heads:
            imgui.table_headers_row()
        for row in rows:
            imgui.table_next_row()
            for cell in row:
                imgui.table_next_column()
                cell()
        imgui.end_table()

    @contextmanager
    def plot(
        self,
        name: str,
        height: float,
        tip: str,
        axes: tuple[str, str] = ("", ""),
        *,
        span_s: tuple[float, float] | None = None,
    ) -> Iterator[bool]:
        """Open a plot without legend and title; yield False if it is not visible.

        Parameters
        ----------
        name : str
            Identifier within the panel.
        height : float
            Height at scale 1.
        tip : str
            Hover text.
        axes : tuple of str, optional
            Names of the axes.
        span_s : tuple of float, optional
            Times of its first and last point, which are written below it; without them the mouse does not move it.
        """
        flags = self.implot.Flags_
        quiet = flags.no_legend | flags.no_menus | flags.no_mouse_text | flags.no_title
        size = self.imgui.ImVec2(-1, height * self.window.scale)
        opened = self.implot.begin_plot(f"##{name}", size, quiet | (0 if span_s else flags.no_inputs))
        if opened:
            quiet = self.implot.AxisFlags_.no_highlight
            times = self.implot.AxisFlags_.no_tick_labels if span_s else 0
            self.implot.setup_axes(*axes, quiet | times, quiet)
        yield bool(opened)
        if opened:
            self.implot.end_plot()
            self.tip(tip)
        if opened and span_s:
            first, last = (mission_time(t_s, whole=True) for t_s in span_s)
            self.one_line(first, style.QUIET)
            self.tip("first time shown, of the flight")
            left = self.width - self.imgui.calc_text_size(last).x
            self.imgui.same_line(self.imgui.get_cursor_pos_x() + left)
            self.one_line(last, style.QUIET)
            self.tip("last time shown, of the flight")

    def curve(self, rgba: style.Rgba) -> Any:  # noqa: ANN401 - an implot value
        """Return the style of a plotted line of this colour."""
        spec = self.implot.Spec()
        spec.line_color, spec.line_weight = self.imgui.ImVec4(*rgba), 1.5
        return spec

    # --- values of Dear ImGui

    def vec(self, x: float, y: float) -> Any:  # noqa: ANN401 - an imgui value
        """Return a point."""
        return self.imgui.ImVec2(x, y)

    def color(self, rgba: style.Rgba) -> int:
        """Return a colour for a draw list."""
        return int(self.imgui.color_convert_float4_to_u32(self.imgui.ImVec4(*rgba)))


class Panel(ABC):
    """A panel or view of the window.

    ``name`` is that of its command (``panel.NAME``), with its ``keys``. ``place`` is the initial dock (``over``: a
    floating window in the centre, of ``size`` at scale 1), ``shown`` is True if it is open initially, ``bare`` if it
    draws up to its edges. Further attributes of a class are the initial state of its panels.
    """

    name: str
    title: str
    place: str
    shown: bool
    keys: tuple[str, ...] = ()
    bare = False
    size = (760.0, 620.0)

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
