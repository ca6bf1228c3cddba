"""The arrangement of the window: menu, status line, dockable panels; the layout is saved between starts.

A window narrower than 900 units has its own layout: the view above, everything else in tabs below.
"""

from __future__ import annotations

import logging
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import msgspec
import platformdirs

from flyaround.gui import style
from flyaround.gui.command_table import command, switch
from flyaround.gui.menus import MenuBar
from flyaround.gui.panels.all import PANELS
from flyaround.gui.panels.tour import STEPS
from flyaround.gui.status_line import StatusLine
from flyaround.gui.texts import texts
from flyaround.gui.transport import JobStrip, TransportStrip
from flyaround.gui.widgets import Widgets
from flyaround.simulator.runtime.files import write_atomic

if TYPE_CHECKING:
    from flyaround.gui.command_table import Command
    from flyaround.gui.console import Console
    from flyaround.gui.panels.tour import TourStep
    from flyaround.gui.surface import Surface
    from flyaround.gui.widgets import Panel

log = logging.getLogger(__name__)

Form = Literal["wide", "narrow"]
RAISE_FRAMES, FRAMED_S = 2, 1.5
"""Frames in which a panel that a command opens is raised, until its tab exists, and the time for which it is framed."""
DOUBLE_CLICK_S, DOUBLE_CLICK_FRAMES = 0.4, 4
"""Longest time between the presses of a double click, and the frames that it may take in a slow window, up to 2 s."""
NARROW = 900.0
"""Window width in screen units, at scale 1, below which panels go under the view."""
VERSION = 1  # version of the saved layout's file
LARGEST_BYTES = 400_000
SHADE = 0.4  # opacity of what covers everything beside a question
ALWAYS = {"centre", "over"}  # places that stay while the side panels are hidden
RIGHT, LEFT, BOTTOM = 0.295, 0.31, 0.26  # shares of the window that the docks take
LOWEST, HIGHEST = 0.22, 0.5
"""Bounds of the bottom dock's share of the height, chosen for the view's aspect ratio."""
PRESETS: dict[str, frozenset[str]] = {
    "first": frozenset(p.name for p in PANELS if p.shown),
    **{name: frozenset(panels) for name, panels in texts("layouts").items()},
}
"""Open panels of each layout."""


class SavedLayout(msgspec.Struct, forbid_unknown_fields=True):
    """A saved layout.

    Parameters
    ----------
    version : int, optional
        Version of the file format.
    shown : dict of str to bool, optional
        Panels by name, True if open.
    docking : dict of str to str, optional
        Dear ImGui's settings by layout form.
    font_scale : float, optional
        Font size relative to the default [1].
    tour_seen : bool, optional
        True once the tour has been closed.
    recent : list of str, optional
        Scenarios flown last.
    flights : list of str, optional
        Replays of kept flights.
    """

    version: int = VERSION
    shown: dict[str, bool] = {}
    docking: dict[str, str] = {}
    font_scale: float = 1.0
    tour_seen: bool = False
    recent: list[str] = []
    flights: list[str] = []


def layout_file() -> Path:
    """Return ``FLYAROUND_CONSOLE_LAYOUT``, or ``console.json`` in the platform's settings folder of Flyaround."""
    path = os.environ.get("FLYAROUND_CONSOLE_LAYOUT", "")
    return Path(path) if path else Path(platformdirs.user_config_dir("flyaround")) / "console.json"


def read_layout(path: Path) -> SavedLayout:
    """Return the saved layout, or a new one if there is none or it is damaged."""
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST_BYTES + 1)
        if len(data) > LARGEST_BYTES:
            raise ValueError("too large")
        layout = msgspec.json.decode(data, type=SavedLayout)
        if layout.version != VERSION or not 0.5 <= layout.font_scale <= 3.0:
            raise ValueError("of another version")
    except FileNotFoundError:
        return SavedLayout()
    except (OSError, ValueError) as error:
        # a damaged layout must not prevent a flight
        log.warning("the console's layout in %s is not used: %s", path, error)
        return SavedLayout()
    return layout


def panel_commands() -> tuple[Command, ...]:
    """Return a command for each panel that opens or closes it, and one for each layout."""

    def layout(name: str, opened: frozenset[str]) -> Command:
        def choose(console: Console) -> None:
            console.window.preset = console.window.layout = name
            console.options.overlays.docking &= name == "dock"

        text = f"panels: {', '.join(p.title for p in PANELS if p.name in opened)}"
        return command(f"layout.{name}", choose, title=name.capitalize(), text=text)

    def panel(p: type[Panel]) -> Command:
        def shown(console: Console) -> bool:
            # what lies behind another tab is brought to the front, not closed
            return console.shown.get(p.name, False) and p.name not in console.help.behind

        def toggle(console: Console, state: bool) -> None:  # noqa: FBT001 - a switch
            console.open_panel(p.name, shown=state)

        text = f"open or close: {p.title}"
        return switch(f"panel.{p.name}", toggle, shown, *p.keys, title=p.title, text=text)

    return (*(layout(*item) for item in PRESETS.items()), *(panel(p) for p in PANELS))


class Layout:
    """Menus, strips, panels and status line of one window.

    Parameters
    ----------
    window : Surface
        Surface to draw in.
    saved : SavedLayout
        Last layout.
    """

    def __init__(self, window: Surface, saved: SavedLayout) -> None:
        self._window = window
        self._w = Widgets(window)
        self._menus, self._status = MenuBar(window), StatusLine(window)
        self._transport, self._jobs = TransportStrip(window), JobStrip(window)
        self.panels: tuple[Panel, ...] = tuple(p(window) for p in PANELS)
        self._saved = saved
        self._form: Form | None = None
        self._build = False
        self._aspect, self._left_open, self._bottom_open = 1.6, False, False
        """Aspect ratio of the camera's picture, and True if a panel is at the left of the view, or below it."""
        self._to_raise: list[str] = []
        self._opened, self._opened_s, self._raises = "", -FRAMED_S, 0
        """Panel that a command opened last, the time at which it did, and the frames in which it is still raised."""
        self._was_shown: dict[str, bool] = {}
        self._dockspace = 0
        self._step: TourStep | None = None
        self._titled, self._untitled = window.imgui.WindowClass(), window.imgui.WindowClass()
        # a tab has a button that closes it
        no_second = window.imgui.internal.DockNodeFlagsPrivate_.no_close_button
        self._titled.dock_node_flags_override_set = no_second
        hidden_alone = window.imgui.DockNodeFlags_.auto_hide_tab_bar
        self._untitled.dock_node_flags_override_set = no_second | hidden_alone
        self._docked: set[str] = set()
        """Panels on the window's own background, as of the last frame."""

    def first_shown(self) -> dict[str, bool]:
        """Return the initial state of each panel, True if open."""
        return {p.name: self._saved.shown.get(p.name, p.shown and p.place != "over") for p in self.panels}

    def before_frame(self, console: Console, size: tuple[float, float]) -> None:
        """Load the docking of another form or preset, which is impossible during a frame."""
        io = self._window.imgui.get_io()
        # a slow window sees one event of a button in a frame
        io.mouse_double_click_time = min(max(DOUBLE_CLICK_S, DOUBLE_CLICK_FRAMES * io.delta_time), 2.0)
        io.mouse_single_click_delay = 1.5 * io.mouse_double_click_time
        form: Form = "narrow" if size[0] < NARROW * self._window.scale else "wide"
        if console.window.preset:
            open_ = PRESETS[console.window.preset]
            console.window.preset = ""
            self._saved.docking.clear()
            # the tour goes on below what a task needs
            open_ |= {"tour"} & {name for name, shown in console.shown.items() if shown}
            console.shown.update({p.name: p.name in open_ for p in self.panels if p.place != "over"})
            self._form = None
        elif self._form is not None and form != self._form:
            self._saved.docking[self._form] = self._window.imgui.save_ini_settings_to_memory()
        if form != self._form:
            self._form = form
            if settings := self._saved.docking.get(form, ""):
                self._window.imgui.load_ini_settings_from_memory(settings)
            self._build = not settings
        if {p.name: p.place for p in self.panels}.get(console.window.front, "over") != "over":
            # whatever hides it gives way
            console.options.panel, console.window.enlarged = True, ""
        camera = console.session.plan.camera
        self._aspect = camera.width_px / camera.height_px
        opened = {p.place for p in self.panels if console.shown.get(p.name)}
        self._left_open, self._bottom_open = "left" in opened, "bottom" in opened
        self._guide(console)

    def _guide(self, console: Console) -> None:
        """Choose the control that the tour frames; bring its panel to the front at the beginning of a step."""
        runs = console.shown.get("tour") and "tour" not in console.help.behind
        step = STEPS[k] if runs and (k := console.help.tour_step) < len(STEPS) else None
        # a narrow window has one dock, where the panel would hide the tour
        if step and step.at_once and step != self._step and self._form == "wide":
            console.open_panel(step.place, shown=True)
        self._step, console.help.framed = step, step.control(console) if step else ""

    def keep(self, console: Console, path: Path) -> None:
        """Write the layout; a full disk is ignored."""
        if self._form is not None:
            self._saved.docking[self._form] = self._window.imgui.save_ini_settings_to_memory()
        self._saved.shown = {p.name: console.shown[p.name] for p in self.panels if p.place != "over"}
        self._saved.font_scale, self._saved.recent = console.window.font_scale, console.recent
        self._saved.flights = [path for path in console.flights.files if Path(path).is_file()]
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_atomic(path, msgspec.json.format(msgspec.json.encode(self._saved)))
        except OSError as error:
            log.warning("the console's layout could not be kept in %s: %s", path, error)

    def draw(self, console: Console) -> None:
        """Draw menus, strips and panels into the current frame."""
        imgui = self._window.imgui
        menu_open = imgui.is_popup_open("", imgui.PopupFlags_.any_popup)
        if menu_open and imgui.is_key_pressed(imgui.Key.escape, False):
            # Dear ImGui closes menus and lists on Escape only with keyboard navigation
            imgui.internal.close_popup_to_level(0, True)
        if imgui.begin_main_menu_bar():
            self._menus.draw(console)
            imgui.end_main_menu_bar()
        self._status.draw(console)
        self._strip(console)
        if imgui.get_frame_count() < 2:
            # the bars have taken no height yet, of which docks have shares
            return
        self._dockspace = imgui.get_id("panels of the console")
        if self._build:
            self._build_docks()
        # the window is cleared to the panels' background: blending a plate over it costs a software driver 10 ms
        bare = imgui.DockNodeFlags_.passthru_central_node
        imgui.dock_space_over_viewport(self._dockspace, None, bare)
        hovered = ""
        for panel in self.panels:
            if panel.name == console.window.enlarged:
                self._enlarged(console, panel)
            elif console.shown.get(panel.name) and (console.options.panel or panel.place in ALWAYS):
                hovered = panel.name if self._panel(console, panel) else hovered
        floating = any(panel.place == "over" and console.shown.get(panel.name) for panel in self.panels)
        if self._build:
            # new tabs raise themselves for some frames; one window per frame takes the focus
            self._build, self._to_raise = False, [""] * 4 + self._first_tabs(console)
        elif self._to_raise and (name := self._to_raise.pop(0)):
            # a floating window keeps it
            (self._show_tab if floating else imgui.set_window_focus)(name)
        console.help.hovered = hovered
        self._saved.tour_seen |= bool(self._was_shown.get("tour")) and not console.shown.get("tour")
        self._was_shown = dict(console.shown)

    def _strip(self, console: Console) -> None:
        """Draw the transport strip above the status line, and above it the jobs."""
        imgui = self._window.imgui
        flags = imgui.WindowFlags_.no_scrollbar | imgui.WindowFlags_.no_saved_settings
        padding = imgui.get_style().window_padding
        low = self._w.vec(padding.x, 0.4 * padding.y)
        height = imgui.get_frame_height() + 2 * low.y
        imgui.push_style_var(imgui.StyleVar_.window_padding, low)
        strips: dict[str, TransportStrip | JobStrip] = {"transport": self._transport, "jobs": self._jobs}
        for name, strip in strips.items():
            screen = imgui.get_main_viewport()
            if imgui.internal.begin_viewport_side_bar(name, screen, imgui.Dir.down, height, flags):
                strip.draw(console)
            imgui.end()
        imgui.pop_style_var()

    def _first_tabs(self, console: Console) -> list[str]:
        """Return the windows of the first open panel of each place, the centre's last; the tour is before others."""
        first: dict[str, str] = {}
        for panel in sorted(self.panels, key=lambda p: p.name != "tour"):
            if console.shown.get(panel.name) and panel.place != "over":
                first.setdefault(panel.place, _window_name(panel))
        # panels on the left belong to a task: in a narrow window, with a single dock, theirs is raised last
        last = ["left", "centre"]
        return [first[place] for place in sorted(first, key=lambda p: last.index(p) if p in last else -1)]

    @property
    def tour_seen(self) -> bool:
        """True once the tour was completed or skipped."""
        return self._saved.tour_seen

    def descriptions(self) -> dict[str, tuple[str, str]]:
        """Return title and description of each panel."""
        return {p.name: (p.title, _description(type(p))) for p in self.panels}

    def _panel(self, console: Console, panel: Panel) -> bool:
        """Draw a panel; return True if the mouse is over it."""
        imgui, w, over = self._window.imgui, self._w, panel.place == "over"
        flags = imgui.WindowFlags_.no_collapse
        if panel.modal:
            self._shade(panel)
        if over:
            screen, scale = imgui.get_main_viewport(), self._window.scale
            (wide, tall), room = panel.size, screen.work_size
            size = w.vec(min(wide * scale, 0.94 * room.x), min(tall * scale, 0.9 * room.y))
            imgui.set_next_window_size(size, imgui.Cond_.appearing)
            imgui.set_next_window_pos(screen.get_center(), imgui.Cond_.appearing, w.vec(0.5, 0.5))
            flags |= imgui.WindowFlags_.no_docking | imgui.WindowFlags_.no_saved_settings
        elif not self._was_shown.get(panel.name):
            imgui.set_next_window_dock_id(self._dock_of(panel), imgui.Cond_.first_use_ever)
        if panel.name in self._docked:
            flags |= imgui.WindowFlags_.no_background
        if panel.bare:
            imgui.push_style_var(imgui.StyleVar_.window_padding, w.vec(0, 0))
        imgui.set_next_window_class(self._untitled if panel.place == "centre" else self._titled)
        if over:
            imgui.push_style_var(imgui.StyleVar_.window_border_size, 1.0)
        self._raise(console, panel)
        # no corner that brings back the title of the view
        for which in (imgui.Col_.button, imgui.Col_.button_active):
            imgui.push_style_color(which, imgui.ImVec4(0, 0, 0, 0))
        visible, stays = imgui.begin(_window_name(panel), True, flags)
        imgui.pop_style_color(2)
        imgui.pop_style_var(panel.bare + over)
        (self._docked.add if imgui.is_window_docked() else self._docked.discard)(panel.name)
        hovered = False
        (console.help.behind.discard if visible else console.help.behind.add)(panel.name)
        if visible:
            panel.draw(console)
            hovered = not over and imgui.is_window_hovered(imgui.HoveredFlags_.child_windows)
            if not over and imgui.is_window_focused(imgui.FocusedFlags_.child_windows):
                console.help.clicked = panel.name
            if panel.name == self._opened and (age := (imgui.get_time() - self._opened_s) / FRAMED_S) < 1.0:
                w.frame((*style.ACCENT[:3], 1.0 - age))
        imgui.end()
        # ignore an Escape that arrived with the key that opened it
        escaped = over and self._was_shown.get(panel.name) and imgui.is_key_pressed(imgui.Key.escape, False)
        if not stays or escaped:
            console.do(f"panel.{panel.name}", False)
        return hovered

    def _shade(self, panel: Panel) -> None:
        """Cover everything but a question, so that it alone takes clicks."""
        imgui, screen = self._window.imgui, self._window.imgui.get_main_viewport()
        imgui.set_next_window_pos(screen.pos)
        imgui.set_next_window_size(screen.size)
        imgui.set_next_window_bg_alpha(SHADE)
        imgui.begin("shade", None, imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.no_saved_settings)
        imgui.end()
        for name in ("shade", _window_name(panel)):
            if (native := imgui.internal.find_window_by_name(name)) is not None:
                imgui.internal.bring_window_to_display_front(native)

    def _raise(self, console: Console, panel: Panel) -> None:
        """Give the next window the focus if a command opened it, and scroll its tab into sight."""
        imgui = self._window.imgui
        if console.window.front == panel.name:
            console.window.front = ""
            self._opened, self._opened_s, self._raises = panel.name, imgui.get_time(), RAISE_FRAMES
        if panel.name == self._opened and self._raises:
            self._raises -= 1
            imgui.set_next_window_focus()
            self._show_tab(_window_name(panel))

    def _show_tab(self, window_name: str) -> None:
        """Bring the tab of a window to the front of its dock, without the focus."""
        internal = self._window.imgui.internal
        native = internal.find_window_by_name(window_name)
        if native is not None and native.dock_node is not None and (bar := native.dock_node.tab_bar):
            tab = internal.tab_bar_find_tab_by_id(bar, native.tab_id)
            if tab is not None:
                internal.tab_bar_queue_focus(bar, tab)

    def _enlarged(self, console: Console, panel: Panel) -> None:
        """Draw a panel over all others, keeping its dock."""
        imgui, screen = self._window.imgui, self._window.imgui.get_main_viewport()
        imgui.set_next_window_pos(screen.work_pos)
        imgui.set_next_window_size(screen.work_size)
        flags = imgui.WindowFlags_
        fixed = flags.no_docking | flags.no_saved_settings | flags.no_resize | flags.no_collapse
        visible, stays = imgui.begin(f"{panel.title}, enlarged###enlarged", True, fixed)
        if visible:
            panel.draw(console)
        imgui.end()
        if not stays or imgui.is_key_pressed(imgui.Key.escape, False):
            console.do("window.enlarge")

    def _dock_of(self, panel: Panel) -> int:
        """Return the dock of an open panel of the same place; the centre by default."""
        internal = self._window.imgui.internal
        for other in self.panels:
            if other is not panel and other.place == panel.place and self._was_shown.get(other.name):
                native = internal.find_window_by_name(_window_name(other))
                if native is not None and native.dock_id:
                    return int(native.dock_id)
        return self._dockspace

    def _build_docks(self) -> None:
        imgui = self._window.imgui
        internal = imgui.internal
        screen = imgui.get_main_viewport()
        internal.dock_builder_remove_node(self._dockspace)
        internal.dock_builder_add_node(self._dockspace, internal.DockNodeFlagsPrivate_.dock_space)
        internal.dock_builder_set_node_size(self._dockspace, screen.work_size)
        nodes = {"centre": self._dockspace}

        def split(place: str, of: str, where: Any, share: float) -> None:  # noqa: ANN401 - an imgui value
            _, nodes[place], nodes[of] = internal.dock_builder_split_node_py(nodes[of], where, share)

        if self._form == "narrow":
            split("bottom", "centre", imgui.Dir.down, 0.45)
            for place in ("right", "right-upper", "right-middle", "right-low", "left"):
                nodes[place] = nodes["bottom"]
        else:
            split("right", "centre", imgui.Dir.right, RIGHT)
            split("right-upper", "right", imgui.Dir.down, 0.81)
            split("right-middle", "right-upper", imgui.Dir.down, 0.57)
            split("right-low", "right-middle", imgui.Dir.down, 0.52)
            # docks whose panels are all closed take no space
            split("left", "centre", imgui.Dir.left, LEFT)
            view = screen.work_size.x * (1 - RIGHT) * (1 - LEFT * self._left_open) / self._aspect
            share = min(max(1 - view / screen.work_size.y, LOWEST), HIGHEST)
            split("bottom", "centre", imgui.Dir.down, share if self._bottom_open else BOTTOM)
        for panel in self.panels:
            if panel.place != "over":
                node = nodes.get(panel.place, nodes["centre"])
                internal.dock_builder_dock_window(_window_name(panel), node)
        for node in nodes.values():
            # a new dock is white until a panel has drawn its background
            internal.dock_builder_get_node(node).last_bg_color = self._w.color(style.GROUND)
        internal.dock_builder_finish(self._dockspace)


def _description(panel: type[Panel]) -> str:
    """Return the description of a panel: the docstrings of its file and class."""
    module = sys.modules[panel.__module__].__doc__ or ""
    own = (panel.__doc__ or "").partition("Parameters\n")[0]
    return " ".join(f"{module} {own}".split())


def _window_name(panel: Panel | type[Panel]) -> str:
    return f"{panel.title}###{panel.name}"
