"""The LVLH map: the chaser around the target, in the orbital plane and across it, at one scale."""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING

import numpy as np

from flyaround.gui import style
from flyaround.gui.canvas import Canvas, legend_keys, point
from flyaround.gui.picture import relative_map
from flyaround.gui.picture.relative_map import MapLook, MapPort
from flyaround.gui.texts import texts
from flyaround.gui.views.burn_nodes import BurnNodes
from flyaround.gui.widgets import Panel
from flyaround.simulator.piloting.look_back import lvlh_position
from flyaround.simulator.piloting.piloted_craft import PREDICTION_S
from flyaround.simulator.runtime.arrays import Vec3, vec3
from flyaround.simulator.world.guidance.manual_control import predicted_drift_lvlh_m

if TYPE_CHECKING:
    from flyaround.gui.canvas import Place, Point
    from flyaround.gui.console import Console
    from flyaround.gui.surface import Surface
    from flyaround.simulator.piloting.session import FlightSession
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.frames.lvlh import Lvlh

DRIFT_EVERY_S = 0.25
"""Simulated time after which the predicted drift is computed again."""
PLANNED_POINTS = 200
"""Number of points of the scenario's path."""
SHOWN_TARGET = 7.0
"""Size in screen units below which the target is a mark."""
WHEEL_FACTOR = 1.2  # change of the width per step of the wheel
FLOWN, PLANNED, DRIFT = style.ACCENT, style.QUIET, style.ORANGE  # colours of the trajectories
LINES = texts("view-tips")["map"]
SUN_REACH = 18.0  # length of the arrow to the Sun, in screen units
BURN_REACH = 2.0
"""Ratio to the rest of the map up to which it shows the path through burns."""
LAST_RADII = 8.0
"""Range in radii of the target below which the map of a docking shows chaser and target alone."""
LEGEND_EM = 16
"""Height of the map, in text heights, from which on it has a legend."""
KEYS = legend_keys("relative-map")
SUN = "direction of the Sun, as long as it lies in this plane; grey while the target is in shadow"


class LvlhMap(Panel):
    """Planned, flown and predicted paths; keep-out sphere, corridor, burns, Sun.

    Wheel: zoom. Drag: move. Right click: plan a burn there, or cancel the one that is there; drag its node or handle.
    """

    name, title, place, shown = "lvlh-map", "LVLH map", "right-middle", True

    def __init__(self, window: Surface) -> None:
        super().__init__(window)
        self._session: FlightSession | None = None
        self._planned = np.zeros((1, 3))
        self._burns = np.zeros((0, 3))
        self._drift, self._drift_t_s = np.zeros((1, 3)), -np.inf
        self._dragged_from: MapLook | None = None
        self._nodes = BurnNodes()
        self.ports: tuple[MapPort, ...] = ()

    def draw(self, console: Console) -> None:
        """Draw into the current view."""
        imgui, session, look = self._imgui, console.session, console.options.map
        self._remember(session)
        x, y, width, height = self._free(40.0)
        legend, canvas = 0.0, Canvas(self._window)
        if height >= LEGEND_EM * imgui.get_text_line_height():
            legend = self._legend(canvas, session, (x, y), width)
        rect = x, y + legend, width, height - legend
        imgui.set_cursor_screen_pos(self._w.vec(*rect[:2]))
        world = session.craft.world
        frame = session.flight.lvlh(session.t_s)
        here = np.array(world.position_lvlh_m)
        trail = session.look_back.path(world)
        mouse, down = imgui.get_io().mouse_pos, imgui.is_any_mouse_down()
        if look.fitted and not self._nodes.hold_map(self.ports, (mouse.x, mouse.y), down=down):
            first = relative_map.ports(rect, look)[0].rect
            # keep a line of text free above and below
            height = max(first[3] - 3.0 * imgui.get_text_line_height(), 20.0)
            relative_map.fit(look, self._extent(session, trail), first[2] / height)
        self.ports = relative_map.ports(rect, look)
        imgui.set_next_item_allow_overlap()
        imgui.invisible_button("map", self._w.vec(rect[2], rect[3]))
        self._mouse(console)
        for port in self.ports:
            canvas.clip(port.rect[:2], port.rect[2:])
            self._ground(canvas, port)
            self._keep_out(canvas, port, session)
            canvas.stroke(port.at(self._planned), (*PLANNED[:3], 0.9), 1.2, halo=False)
            colour = style.BAD if session.craft.drift_risk() else DRIFT
            canvas.stroke(port.at(self._drift), colour, 1.4, dashed=True, halo=False)
            canvas.stroke(port.at(trail), FLOWN, 2.0, halo=False)
            target = self._target(canvas, port, session, frame)
            for burn in self._burns:
                canvas.diamond(point(port.at(burn)), 4.5, style.PURPLE)
            named = self._keep_out_name(canvas, port, session)
            names = () if named is None else (named[1],)
            self._nodes.draw(canvas, port, (target, *names, *self._edges(canvas, port)))
            # below the chaser, which its name may hide in a small map
            self._sun(canvas, port, relative_map.sun_lvlh(world, frame), world.sun_visible_fraction)
            self._letters(canvas, port, session)
            self._nodes.draw_grips(canvas, port)
            self._chaser(canvas, port, here, relative_map.boresight_lvlh(world, frame))
            canvas.unclip()
        self._buttons(console)

    def _remember(self, session: FlightSession) -> None:
        """Compute slowly changing contents."""
        if self._session is not session:
            self._session, self._drift_t_s = session, -np.inf
            times = np.linspace(0.0, session.plan.scenario.duration_s, PLANNED_POINTS)
            flight = session.flight
            self._planned = np.array([lvlh_position(flight, flight.chaser(float(t))) for t in times])
            self._burns = planned_burns_lvlh_m(session)
        if abs(session.t_s - self._drift_t_s) > DRIFT_EVERY_S:
            chaser = session.craft.chaser
            self._drift = predicted_drift_lvlh_m(session.flight.orbit, chaser, PREDICTION_S)
            self._drift_t_s = session.t_s

    def _extent(self, session: FlightSession, trail: FloatArray) -> FloatArray:
        """Return the points that a fitted map must hold, predicted paths only near the rest."""
        craft = session.craft
        docks = craft.steering.autopilot or craft.docking.docked
        if docks and craft.world.range_m < LAST_RADII * craft.docking.radius_m:
            # the last metres: the chaser before the port
            edges = craft.docking.radius_m * np.vstack([np.eye(3), -np.eye(3)])
            return np.vstack([edges, craft.world.position_lvlh_m])
        points = [self._planned, trail, self._burns, self._nodes.nodes_lvlh_m, np.zeros((1, 3))]
        keep_out = session.plan.scenario.chaser.keep_out
        if keep_out is not None:
            points.append(keep_out.radius_m * np.vstack([np.eye(3), -np.eye(3)]))
        rest = np.vstack(points)
        reach = max(float(np.abs(rest).max()), 5.0)
        paths = (self._drift, reach), (self._nodes.path_lvlh_m, BURN_REACH * reach)
        near = [path[np.abs(path).max(axis=1) < most] for path, most in paths]
        return np.vstack([rest, *near, np.eye(3), -np.eye(3)])

    # --- the mouse

    def _mouse(self, console: Console) -> None:
        """Apply the wheel (zoom about the pointer), drags (move) and double clicks (fit); one command per gesture."""
        imgui, look = self._imgui, console.options.map
        io = imgui.get_io()
        mouse = io.mouse_pos
        port = next((p for p in self.ports if p.inside(mouse.x, mouse.y)), self.ports[0])
        over = imgui.is_item_hovered()
        clicked, other = (over and imgui.is_mouse_clicked(b) for b in (0, 1))
        pressed = clicked, imgui.is_mouse_down(0), other
        is_taken = self._nodes.take_mouse(console, self.ports, (mouse.x, mouse.y), pressed)
        if self._nodes.under is not None and (over or is_taken):
            imgui.set_mouse_cursor(imgui.MouseCursor_.hand)
        if is_taken:
            return
        if over:
            if imgui.is_mouse_double_clicked(imgui.MouseButton_.left):
                console.do("map.fit")
                return
            if io.mouse_wheel:
                centre, width = zoomed(port, look, (mouse.x, mouse.y), WHEEL_FACTOR**io.mouse_wheel)
                do_place(console, centre, width)
        if imgui.is_item_active() and imgui.is_mouse_dragging(imgui.MouseButton_.left, 3.0):
            # the point under the pointer stays there; the whole gesture is one command, at its end
            self._dragged_from = self._dragged_from or copy(look)
            centre_lvlh_m = np.array(look.centre_lvlh_m)
            centre_lvlh_m[port.plane.right] -= io.mouse_delta.x / port.scale
            centre_lvlh_m[port.plane.up] += io.mouse_delta.y / port.scale
            look.place(vec3(centre_lvlh_m), look.width_m)
            self.ports = tuple(MapPort(p.plane, p.rect, look.centre_lvlh_m, p.scale) for p in self.ports)
        elif self._dragged_from is not None:
            centre, width = look.centre_lvlh_m, look.width_m
            # the command is the change that is undone
            console.options.map, self._dragged_from = self._dragged_from, None
            do_place(console, centre, width)

    # --- what is drawn

    def _ground(self, canvas: Canvas, port: MapPort) -> None:
        x, y, w, h = port.rect
        canvas.box((x, y), (w, h), style.RAISED)
        step = relative_map.nice_step(max(90.0 * self._window.scale / port.scale, 1e-3))
        for vertical in (True, False):
            axis = port.plane.right if vertical else port.plane.up
            half = (w if vertical else h) / port.scale / 2
            first = np.ceil((port.centre_lvlh_m[axis] - half) / step)
            last = np.floor((port.centre_lvlh_m[axis] + half) / step)
            for k in np.arange(first, last + 1):
                p = np.array(port.centre_lvlh_m)
                p[axis] = k * step
                sx, sy = port.at(p)
                ends = [(sx, y), (sx, y + h)] if vertical else [(x, sy), (x + w, sy)]
                strong = abs(k) < 0.5
                canvas.stroke(ends, (*style.QUIET[:3], 0.55 if strong else 0.16), 1.0, halo=False)

    def _keep_out(self, canvas: Canvas, port: MapPort, session: FlightSession) -> None:
        whole, keep_out = session.plan.scenario.chaser.keep_out, session.craft.sphere
        if whole is None:
            return
        centre = point(port.at(np.zeros(3)))
        radius = whole.radius_m * port.scale
        if keep_out is not None:
            canvas.disc(centre, radius, (*style.BAD[:3], 0.10))
            outline = relative_map.corridor_outline(keep_out, port.plane)
            if len(outline) > 2:
                canvas.area(port.at(outline), (*style.GOOD[:3], 0.22))
                canvas.stroke(port.at(outline), (*style.GOOD[:3], 0.9), 1.2, closed=True, halo=False)
        turn = np.linspace(0, 2 * np.pi, 181)
        ring = np.array(centre) + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        canvas.stroke(ring, style.QUIET if keep_out is None else style.BAD, 1.6, dashed=True, halo=False)

    def _edges(self, canvas: Canvas, port: MapPort) -> tuple[Place, ...]:
        """Return the places of title, Sun, V-bar and scale, which burns leave free."""
        x, y, w, h = port.rect
        deep, reach = 2.2 * canvas.line, SUN_REACH * self._window.scale
        sun = 2.5 * reach + canvas.size("eclipse")[0]
        return (x, y, w, 1.3 * canvas.line), (x + w - sun, y, sun, 4 * reach), (x, y + h - deep, w, deep)

    def _target(self, canvas: Canvas, port: MapPort, session: FlightSession, frame: Lvlh) -> Place:
        """Draw the target; return the rectangle that it fills."""
        edges = relative_map.target_edges_lvlh_m(session.plan.target, session.craft.world, frame)
        flat = port.at(edges)
        size = 0.0 if not len(edges) else float(np.ptp(flat.reshape(-1, 2), axis=0).max())
        if size < SHOWN_TARGET * self._window.scale:
            x, y = point(port.at(np.zeros(3)))
            canvas.diamond((x, y), 5.0, style.WARN)
            return x - 6, y - 6, 12.0, 12.0
        for edge in flat:
            canvas.stroke(edge, style.WARN, 1.2, halo=False)
        (x, y), (right, low) = (f(flat.reshape(-1, 2), axis=0) for f in (np.min, np.max))
        return x, y, right - x, low - y

    def _chaser(self, canvas: Canvas, port: MapPort, here: FloatArray, boresight: FloatArray) -> None:
        at = port.at(here)
        direction = np.array([boresight[port.plane.right], -boresight[port.plane.up]])
        canvas.arrow(point(at), point(at + 22 * self._window.scale * direction), style.INK)
        canvas.dot(point(at), 4.5 * self._window.scale, FLOWN)

    def _sun(self, canvas: Canvas, port: MapPort, sun: FloatArray, sunlit_share: float) -> None:
        """Draw an arrow to the Sun at the right edge, with the length of its projection on the plane."""
        x, y, w, _ = port.rect
        reach = SUN_REACH * self._window.scale
        colour = style.YELLOW if sunlit_share > 0 else style.QUIET
        centre = np.array([x + w - 1.3 * reach, y + 2.9 * reach])
        flat = np.array([sun[port.plane.right], -sun[port.plane.up]])
        canvas.disc(point(centre), 2.0, colour)
        canvas.arrow(point(centre), point(centre + reach * flat), colour)
        text = "Sun" if sunlit_share > 0 else "eclipse"
        width, height = canvas.size(text)
        canvas.label((centre[0] - 1.2 * reach - width, centre[1] - height / 2), text, colour, SUN)

    def _letters(self, canvas: Canvas, port: MapPort, session: FlightSession) -> None:
        x, y, w, h = port.rect
        plane, line = port.plane, canvas.line
        narrow = w < 240 * self._window.scale
        title = plane.name if h > 12 * line else "LVLH map"
        text = f"up: {plane.up_title}" if narrow else f"{title}, up: {plane.up_title}{plane.note}"
        canvas.label((x + 6, y + 4), text, tip=LINES)
        bar_m = relative_map.nice_step(port.width_m / 4)
        bar, right, foot = bar_m * port.scale, x + w - 10, y + h - 8
        left = right - bar
        canvas.stroke([(left, foot - 5), (left, foot), (right, foot), (right, foot - 5)], style.INK)
        label = relative_map.metres_text(bar_m)
        at = (right - bar / 2 - canvas.size(label)[0] / 2, foot - 6 - line)
        canvas.label(at, label, tip="length of the bar below, in both planes")
        length = 24.0 * self._window.scale
        canvas.arrow((x + 8, foot - 4), (x + 8 + length, foot - 4), style.QUIET)
        axis, tip = "V-bar" if narrow else "V-bar, flight direction", "along-track of the target's LVLH frame"
        canvas.label((x + 14 + length, foot - 4 - line / 2), axis, style.QUIET, tip)
        if (named := self._keep_out_name(canvas, port, session)) is not None:
            text, (left, top, *_) = named
            tip = "radius of the sphere that the scenario keeps the chaser out of"
            canvas.label((left, top), text, style.QUIET if session.craft.sphere is None else style.BAD, tip)
        mouse = self._imgui.get_io().mouse_pos
        if self._imgui.is_item_hovered() and port.inside(mouse.x, mouse.y):
            p = port.point(mouse.x, mouse.y)
            text = f"{p[plane.right]:+.2f}, {p[plane.up]:+.2f} m"
            canvas.label((x + 6, foot - 4 - 1.8 * line), text, tip="position under the pointer")

    def _keep_out_name(
        self, canvas: Canvas, port: MapPort, session: FlightSession
    ) -> tuple[str, Place] | None:
        """Return the name of the keep-out sphere and its place on the other side than the chaser, if there is room."""
        (x, y, w, h), line, keep_out = port.rect, canvas.line, session.plan.scenario.chaser.keep_out
        if keep_out is None or w < 240 * self._window.scale:
            return None
        middle, here = port.at(np.zeros(3)), port.at(session.craft.world.position_lvlh_m)
        side = 1.0 if here[1] < middle[1] else -1.0
        edge = middle + np.array([0.0, side * keep_out.radius_m * port.scale])
        if not y + 3 * line < edge[1] < y + h - 3 * line:
            return None
        text = f"keep out {relative_map.metres_text(keep_out.radius_m)}{', lifted' * (session.craft.sphere is None)}"
        wide = canvas.size(text)[0]
        left = min(max(edge[0] - wide / 2, x + 4), x + w - wide - 4)
        return text, (left, edge[1] + (0.8 * side - 0.5) * line, wide, line)

    def _legend(self, canvas: Canvas, session: FlightSession, corner: Point, width: float) -> float:
        """Draw what lines and marks are, as far as there are any, above the map; return the height."""
        keep_out, sphere = session.plan.scenario.chaser.keep_out, session.craft.sphere
        burns = bool(len(self._burns) or session.craft.steering.burns.burns)
        corridor = sphere is not None and sphere.corridor_axis_lvlh is not None
        there = {"burns": burns, "keep-out": keep_out is not None, "corridor": corridor}
        with self._window.ctx.push_font(
            self._window.text_font, 0.85 * self._imgui.get_style().font_size_base
        ):
            height = canvas.legend(corner, width, [key for key in KEYS if there.get(key.name, True)])
        return height + 4.0

    def _buttons(self, console: Console) -> None:
        """Draw the buttons that fit and enlarge the map, in the upper right corner."""
        imgui, w = self._imgui, self._w
        x, y, width, _ = self.ports[0].rect
        side = imgui.get_frame_height()
        names = ("map.fit", "window.enlarge")
        imgui.set_cursor_screen_pos(w.vec(x + width - len(names) * (side + 4) - 4, y + 4))
        for name in names:
            w.button(console, name, *(["lvlh-map"] if name == "window.enlarge" else []), label="", width=side)
            imgui.same_line(0, 4)


def planned_burns_lvlh_m(session: FlightSession) -> FloatArray:
    """Return (n, 3) positions of the chaser at the scenario's planned burns, LVLH [m]."""
    scenario = session.plan.scenario
    times = [b.start_s for b in scenario.burns if b.craft == "chaser" and b.start_s <= scenario.duration_s]
    places = [session.flight.state(t).position_lvlh_m for t in times if t <= session.flight.duration_s]
    return np.array(places, float).reshape(-1, 3)


def zoomed(port: MapPort, look: MapLook, mouse: Point, factor: float) -> tuple[Vec3, float]:
    """Return centre and width of the map enlarged by a factor, with the point under the pointer fixed."""
    under = np.array(port.point(*mouse))
    centre = np.array(look.centre_lvlh_m)
    through = port.plane.through
    under[through] = centre[through]
    new_centre = under + (centre - under) / factor
    return vec3(new_centre), look.width_m / factor


def do_place(console: Console, centre_lvlh_m: Vec3, width_m: float) -> None:
    """Run the command of the map's position, in whole centimetres."""
    radial, along, cross = (round(c, 2) for c in centre_lvlh_m)
    console.do("map.place", along, radial, cross, max(round(width_m, 2), 0.5))
