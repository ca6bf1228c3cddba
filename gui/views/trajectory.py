"""The relative trajectory in the target's orbital plane."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gui import style

if TYPE_CHECKING:
    from gui.console import Console
    from gui.flight.session import Session
    from gui.window import Window

DRIFT_EVERY_S = 0.25
"""The predicted drift is drawn anew this often, at 1x."""


class TrajectoryView:
    """What was planned, flown, and where the chaser drifts without thrust."""

    name, title, place, shown = "trajectory", "Trajectory, LVLH", "right-middle", True

    def __init__(self, window: Window) -> None:
        self._imgui = window.imgui
        self._implot = window.implot
        self._session: Session | None = None
        self._path = np.zeros((1, 3))
        self._drift, self._drift_t_s = np.zeros((1, 3)), -np.inf
        self._plot_aspect = 2.0

    def draw(self, console: Console) -> None:
        """Draw into the view that is begun."""
        implot, imgui, session = self._implot, self._imgui, console.session
        if self._session is not session:
            self._session, self._drift_t_s = session, -np.inf
            self._path = np.array(session.planned_path_lvlh_m())
        flags = implot.Flags_
        shown = flags.no_legend | flags.no_menus | flags.no_mouse_text | flags.no_title | flags.no_inputs
        if not implot.begin_plot("##lvlh", imgui.ImVec2(-1, -1), shown):
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
