"""The side panel and the key list."""

from __future__ import annotations

import math
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from gui import style
from gui.keys import BINDINGS
from gui.session import RATES
from gui.view_settings import DETAILS, LAYERS, OVERLAYS

if TYPE_CHECKING:
    from gui.feed import Feed
    from gui.session import Session
    from gui.view_settings import Options, Overlays
    from gui.window import Window

PANEL_WIDTH = 330.0
DRIFT_EVERY_S = 0.25
"""The predicted drift is drawn anew this often, at 1x."""
SHOWN_RATES = (0.1, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)


class SidePanel:
    """State, time, steering, view and trajectory beside the picture."""

    def __init__(self, window: Window, session: Session) -> None:
        self._window = window
        self._imgui = window.imgui
        self._implot = window.implot
        self._path = np.array(session.planned_path_lvlh_m())
        self._drift, self._drift_t_s = np.zeros((1, 3)), -np.inf
        self._plot_aspect = 2.0
        self.message = ""

    @property
    def width(self) -> float:
        """Screen units."""
        return PANEL_WIDTH * self._window.scale

    def draw(
        self, place: tuple[float, float, float, float], session: Session, feed: Feed, options: Options
    ) -> None:
        """Draw into ``place`` (x, y, width, height on the screen)."""
        imgui = self._imgui
        imgui.set_next_window_pos(imgui.ImVec2(place[0], place[1]))
        imgui.set_next_window_size(imgui.ImVec2(place[2], place[3]))
        flags = imgui.WindowFlags_
        imgui.begin(
            "panel",
            None,
            flags.no_title_bar | flags.no_resize | flags.no_move | flags.no_collapse | flags.no_nav,
        )
        imgui.text(session.plan.scenario.title or session.plan.scenario.name)
        self._time(session)
        self._steering(session)
        self._state(feed)
        self._trajectory(session, place[3])
        self._look(session, feed, options)
        imgui.end()

    def _section(self, title: str) -> None:
        imgui = self._imgui
        imgui.dummy(imgui.ImVec2(0, 1))
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*style.ACCENT))
        imgui.separator_text(title)
        imgui.pop_style_color()

    def _time(self, session: Session) -> None:
        imgui = self._imgui
        self._section("Time")
        third = (imgui.get_content_region_avail().x - 2 * imgui.get_style().item_spacing.x) / 3
        wide = imgui.ImVec2(third, 0)
        if imgui.button("Go on" if session.paused else "Pause", wide):
            session.toggle_pause()
        self._tip("Space")
        imgui.same_line()
        if imgui.button("One frame", wide):
            session.step_once()
        self._tip("full stop key")
        imgui.same_line()
        if imgui.button("Restart", wide):
            session.restart()
        self._tip("Backspace")
        space = 2.0 * self._window.scale
        each = (imgui.get_content_region_avail().x - (len(SHOWN_RATES) - 1) * space) / len(SHOWN_RATES)
        imgui.push_style_var(imgui.StyleVar_.item_spacing, imgui.ImVec2(space, 4))
        imgui.push_style_var(imgui.StyleVar_.frame_padding, imgui.ImVec2(0, 4))
        for k, rate in enumerate(SHOWN_RATES):
            if k:
                imgui.same_line()
            chosen = rate == session.rate
            if chosen:
                imgui.push_style_color(imgui.Col_.button, imgui.ImVec4(*style.ACCENT[:3], 0.45))
            if imgui.button(f"{rate:g}x", imgui.ImVec2(each, 0)):
                session.set_rate(rate)
            if chosen:
                imgui.pop_style_color()
        imgui.pop_style_var(2)
        if session.rate not in SHOWN_RATES:
            imgui.text_disabled(f"{session.rate:g}x, one of {', '.join(f'{r:g}' for r in RATES)}")

    def _steering(self, session: Session) -> None:
        imgui = self._imgui
        self._section("Chaser")
        third = imgui.ImVec2(
            (imgui.get_content_region_avail().x - 2 * imgui.get_style().item_spacing.x) / 3, 0
        )
        steered = session.mode == "steer"
        if imgui.radio_button("Guidance", not steered) and steered:
            session.toggle_steering()
        imgui.same_line()
        if imgui.radio_button("Steer", steered) and not steered:
            session.toggle_steering()
        self._tip("G, or the first steering key")
        imgui.same_line()
        imgui.begin_disabled(not steered)
        changed, _ = imgui.checkbox("Track", session.tracking)
        if changed:
            session.toggle_tracking()
        self._tip("T: the attitude follows the target; turn keys move its place in the picture")
        if imgui.button("Centre", third):
            session.centre()
        self._tip("C: bring the target to the middle")
        imgui.same_line()
        if imgui.button("Stop", third):
            session.stop()
        self._tip("X: brake to rest in LVLH")
        imgui.same_line()
        if imgui.button("Reset", third):
            session.reset_chaser()
        self._tip("Home: back onto the scenario's trajectory")
        imgui.end_disabled()

    def _state(self, feed: Feed) -> None:
        imgui = self._imgui
        self._section("State")
        if feed.newest is None:
            imgui.text_disabled("no picture yet")
            return
        r = feed.newest.telemetry
        imgui.push_font(self._window.figure_font, 0.0)
        self._row("LVLH m", r.position_lvlh_m, "{:+8.3f}", "radial, along-track, cross-track")
        self._row("  mm/s", tuple(1e3 * v for v in r.velocity_lvlh_m_s), "{:+8.2f}", "in the rotating frame")
        self._row(
            "Rel. rate", r.relative_rate_deg_s, "{:+8.3f}", "target seen by the camera, camera axes [deg/s]"
        )
        self._row("Cam. rate", r.camera_rate_deg_s, "{:+8.3f}", "camera to the stars, camera axes [deg/s]")
        imgui.text(f"off-axis {r.off_boresight_deg:6.2f}°   altitude {r.altitude_km:6.1f} km")
        imgui.pop_font()

    def _row(self, name: str, values: tuple[float, ...], form: str, tip: str) -> None:
        imgui = self._imgui
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*style.QUIET))
        imgui.text(f"{name:9s}")
        imgui.pop_style_color()
        self._tip(tip)
        imgui.same_line(0, 4)
        imgui.text(" ".join(form.format(v) for v in values))

    def _trajectory(self, session: Session, panel_height: float) -> None:
        implot, imgui = self._implot, self._imgui
        self._section("Relative trajectory, LVLH")
        height = min(max(0.25 * panel_height, 150.0), 330.0)
        flags = implot.Flags_
        shown = flags.no_legend | flags.no_menus | flags.no_mouse_text | flags.no_title | flags.no_inputs
        if not implot.begin_plot("##lvlh", imgui.ImVec2(-1, height), shown):
            return
        here = np.array(session.moment.world.position_lvlh_m)
        flown = np.vstack([*session.trail, here])
        axis = implot.AxisFlags_.no_highlight
        implot.setup_axes("along-track [m]", "radial [m]", axis, axis)
        limits = _equal_limits(np.vstack([self._path, flown, np.zeros((1, 3))])[:, [1, 0]], self._plot_aspect)
        implot.setup_axes_limits(*limits, self._imgui.Cond_.always)
        size = implot.get_plot_size()
        self._plot_aspect = size.x / max(size.y, 1.0)
        self._line("planned", self._path, (*style.QUIET[:3], 0.7), 1.0)
        self._line("flown", flown, style.ACCENT, 2.0)
        if session.mode == "steer":
            if abs(session.t_s - self._drift_t_s) > DRIFT_EVERY_S * session.rate:
                self._drift, self._drift_t_s = session.predicted_drift_lvlh_m(), session.t_s
            self._line("drift", self._drift, (*style.WARN[:3], 0.6), 1.0)
        self._dot("target", np.zeros(3), style.WARN)
        self._dot("chaser", here, style.ACCENT)
        implot.end_plot()

    def _line(self, name: str, points: np.ndarray, color: style.Rgba, weight: float) -> None:
        spec = self._implot.Spec()
        spec.line_color = self._imgui.ImVec4(*color)
        spec.line_weight = weight
        self._implot.plot_line(
            name, np.ascontiguousarray(points[:, 1]), np.ascontiguousarray(points[:, 0]), spec
        )

    def _dot(self, name: str, point: np.ndarray, color: style.Rgba) -> None:
        spec = self._implot.Spec()
        spec.marker = self._implot.Marker_.circle
        spec.marker_size = 4.5
        spec.marker_fill_color = spec.marker_line_color = self._imgui.ImVec4(*color)
        self._implot.plot_scatter(name, np.array([point[1]]), np.array([point[0]]), spec)

    def _look(self, session: Session, feed: Feed, options: Options) -> None:
        imgui = self._imgui
        imgui.dummy(imgui.ImVec2(0, 2))
        if not imgui.begin_tab_bar("view"):
            return
        if imgui.begin_tab_item_simple("Picture"):
            self._picture(session, feed, options)
            imgui.end_tab_item()
        if imgui.begin_tab_item_simple("Overlays"):
            self._switches(options.overlays)
            imgui.end_tab_item()
        if imgui.begin_tab_item_simple("World"):
            options.settings.environment = self._layers(options.settings.environment)
            imgui.end_tab_item()
        imgui.end_tab_bar()

    def _picture(self, session: Session, feed: Feed, options: Options) -> None:
        imgui, settings = self._imgui, options.settings
        exposure_s = session.plan.scenario.sensor.exposure_s * 2.0**settings.exposure_stops
        imgui.text("Exposure")
        imgui.same_line()
        imgui.text_disabled(f"{_exposure(exposure_s)}, {settings.exposure_stops:+.1f} stops")
        imgui.set_next_item_width(-1)
        _, settings.exposure_stops = imgui.slider_float("##exposure", settings.exposure_stops, -8.0, 8.0, "")
        self._tip("Ctrl and click to type a figure; right click: the scenario's own")
        if imgui.is_item_clicked(imgui.MouseButton_.right):
            settings.exposure_stops = 0.0
        imgui.set_next_item_width(imgui.get_content_region_avail().x * 0.42)
        _, k = imgui.combo("##detail", DETAILS.index(settings.detail), [f"{d} detail" for d in DETAILS])
        settings.detail = DETAILS[k]
        self._tip("resolution while time runs; a paused picture is always whole")
        imgui.same_line()
        changed, colour = imgui.checkbox("Colour", settings.bands == "rgb")
        if changed:
            settings.bands = "rgb" if colour else "mono"
        imgui.same_line()
        _, settings.noise = imgui.checkbox("Noise", settings.noise)
        if imgui.button("Saving ..." if feed.saving else "Save picture and truth", imgui.ImVec2(-1, 0)):
            feed.ask_to_save()
        self._tip("P: PNG and JSON into out/console")
        if self.message:
            imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*style.QUIET))
            imgui.text_wrapped(self.message)
            imgui.pop_style_color()

    def _switches(self, on: Overlays) -> None:
        imgui = self._imgui
        for k, (field, label) in enumerate(OVERLAYS):
            if k % 2:
                imgui.same_line(imgui.get_window_width() / 2)
            _, value = imgui.checkbox(label, getattr(on, field))
            setattr(on, field, value)

    def _layers(self, environment: Any) -> Any:  # noqa: ANN401
        imgui = self._imgui
        values = {}
        for k, (field, label) in enumerate(LAYERS):
            if k % 2:
                imgui.same_line(imgui.get_window_width() / 2)
            _, values[field] = imgui.checkbox(label, getattr(environment, field))
        return type(environment)(**values)

    def _tip(self, text: str) -> None:
        if self._imgui.is_item_hovered(self._imgui.HoveredFlags_.delay_short):
            self._imgui.set_tooltip(text)


def _equal_limits(points: np.ndarray, aspect: float) -> tuple[float, float, float, float]:
    """x0 x1 y0 y1 that hold all points with one scale on both axes, so that a circle looks like one.

    Parameters
    ----------
    points : (N, 2). aspect : width over height of the plot.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    centre, size = (low + high) / 2, 1.15 * (high - low)
    height = max(float(size[1]), float(size[0]) / aspect, 1.0)
    half_x, half_y = height * aspect / 2, height / 2
    return (centre[0] - half_x, centre[0] + half_x, centre[1] - half_y, centre[1] + half_y)


def _exposure(seconds: float) -> str:
    """An exposure in the unit that gives two or three digits; doubled percent signs are not needed."""
    unit, factor = next(
        ((u, f) for u, f in (("us", 1e6), ("ms", 1e3), ("s", 1.0)) if seconds * f < 1000), ("s", 1.0)
    )
    digits = max(0, 2 - math.floor(math.log10(seconds * factor)))
    return f"{seconds * factor:.{digits}f} {unit}"


def draw_help(window: Window, options: Options) -> None:
    """The list of keys, over everything."""
    if not options.help:
        return
    imgui = window.imgui
    screen = imgui.get_main_viewport()
    centre = screen.get_center()
    imgui.set_next_window_pos(centre, imgui.Cond_.always, imgui.ImVec2(0.5, 0.5))
    imgui.set_next_window_bg_alpha(0.97)
    flags = imgui.WindowFlags_
    imgui.push_style_var(imgui.StyleVar_.window_padding, imgui.ImVec2(24, 20))
    imgui.push_style_var(imgui.StyleVar_.window_border_size, 1.0)
    imgui.begin(
        "keys",
        None,
        flags.no_title_bar | flags.no_resize | flags.no_move | flags.always_auto_resize | flags.no_nav,
    )
    groups = [(name, list(rows)) for name, rows in groupby(BINDINGS, key=lambda b: b.group)]
    columns = (groups[:3], groups[3:])
    if imgui.begin_table("columns", 2, imgui.TableFlags_.sizing_fixed_fit):
        for column in columns:
            imgui.table_next_column()
            for name, rows in column:
                imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*style.ACCENT))
                imgui.text(name)
                imgui.pop_style_color()
                for b in rows:
                    imgui.text(f"  {b.shown}")
                    imgui.same_line(110 * window.scale)
                    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*style.QUIET))
                    imgui.text(f"{b.what}     ")
                    imgui.pop_style_color()
                imgui.dummy(imgui.ImVec2(0, 6))
        imgui.end_table()
    imgui.end()
    imgui.pop_style_var(2)
