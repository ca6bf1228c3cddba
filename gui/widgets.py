"""Widgets that panels share: controls of commands, tables and plots, beside the fields and texts of their bases."""

from __future__ import annotations

from abc import ABC, abstractmethod
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from flyaround.gui import style
from flyaround.gui.fields import Fields
from flyaround.gui.icons import PRIMARY, labelled
from flyaround.simulator.piloting.readouts import mission_time

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from flyaround.gui.command_table import Value
    from flyaround.gui.console import Console
    from flyaround.gui.surface import Surface


class Widgets(Fields):
    """Controls of commands, tables and plots of the current panel.

    Parameters
    ----------
    window : Surface
        Surface with the fonts and scale.
    """

    # --- controls of commands

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
        if name == console.help.framed:
            low, high = self.imgui.get_item_rect_min(), self.imgui.get_item_rect_max()
            if high.y > self.imgui.get_window_pos().y + self.imgui.get_window_height():
                self.imgui.set_scroll_here_y(1.0)
            self.frame(style.ACCENT, (low.x - 1, low.y + 1, high.x + 1, high.y - 1))
        self.command_tip(console, name, *arguments)

    def filled_button(self, label: str, width: float, fill: style.Rgba | None) -> bool:
        """Draw a button of a colour, also when hovered; return True if it was clicked."""
        imgui = self.imgui
        if fill is not None:
            lighter = style.over((*style.INK[:3], 0.08), style.over(fill, style.GROUND))
            colours = {"text": style.letters_on(fill), "button": fill, "button_hovered": lighter}
            for which, colour in colours.items():
                imgui.push_style_color(getattr(imgui.Col_, which), imgui.ImVec4(*colour))
        clicked = bool(imgui.button(label, imgui.ImVec2(width, 0)))
        if fill is not None:
            imgui.pop_style_color(3)
        return clicked

    def buttons(self, console: Console, names: Sequence[str], per_row: int, primary: str = "") -> None:
        """Draw buttons of one width, ``per_row`` in a row, or fewer in a narrow panel; ``primary`` is filled."""
        widest = max(self.button_width(labelled(n, console.table[n].title)) for n in names)
        share = (self.width + self.imgui.get_style().item_spacing.x) / per_row - 9
        widths = self.grid(len(names), max(widest, share) / self.window.scale)
        for name, width in zip(names, widths, strict=True):
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
        shown: Mapping[str, str] | None = None,
        argument: str = "",
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
        shown : mapping, optional
            Texts of choices that are not their names.
        argument : str, optional
            Name of the argument, if the command has others.
        """
        self.imgui.set_next_item_width(-1)
        titles = [(shown or {}).get(n, n) for n in names]
        changed, k = self.imgui.combo(f"##{name}{argument}", names.index(now), titles)
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
            self.row(first, (last,), "{}", "times of the flight at the first and at the last point")

    def curve(self, rgba: style.Rgba) -> Any:  # noqa: ANN401 - an implot value
        """Return the style of a plotted line of this colour."""
        spec = self.implot.Spec()
        spec.line_color, spec.line_weight = self.imgui.ImVec4(*rgba), 1.5
        return spec


class Panel(ABC):
    """A panel or view of the window.

    ``name`` is that of its command (``panel.NAME``), with its ``keys``. ``place`` is the initial dock (``over``: a
    floating window in the centre, of ``size`` at scale 1), ``shown`` is True if it is open initially, ``bare`` if it
    draws up to its edges, ``modal`` if nothing else takes clicks. Further attributes of a class are the
    initial state of its panels.
    """

    name: str
    title: str
    place: str
    shown: bool
    keys: tuple[str, ...] = ()
    bare = modal = False
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
