"""The docking display over the camera's picture: corridor, port, reticle, and figures coloured by their limits."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flyaround.gui import style
from flyaround.gui.canvas import Canvas
from flyaround.gui.picture.figures import flown_colour
from flyaround.gui.texts import texts
from flyaround.gui.widgets import Widgets
from flyaround.simulator.piloting.docking_figures import CAPTURE_M, JudgedFigure, judge

if TYPE_CHECKING:
    from flyaround.gui.canvas import Place, Point
    from flyaround.gui.console import Console
    from flyaround.gui.picture.feed import Picture
    from flyaround.gui.surface import Surface
    from flyaround.gui.views.letterbox import Letterbox
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.piloting.docking_figures import DockingFigures
    from flyaround.simulator.piloting.docking_watch import Docking

NEAR_M = 0.05  # least depth of a drawn point in front of the camera
RING_SHARE = 0.31
"""Radius of the ring over the smaller side of the picture."""
LEAST_RING = 105.0
"""Size below which a picture shows no figures; the panel has them."""
WIDE = 700.0
"""Width below which the centre of the upper edge is occupied by other text."""
LABELLED = 60.0
"""Width from which on the squares of further hold points are named."""
FULL_SCALE_DEG = 15.0
"""Angle at which an attitude needle stops."""

DISTANCE = "of the docking point before the port's plane"
FIGURE_TIPS: dict[str, str] = texts("docking")
"""Hover text of each figure of `flyaround.simulator.piloting.docking_figures.judge`."""


class Sight(NamedTuple):
    """A picture with the docking figures of its time and of now, and where it is drawn."""

    canvas: Canvas
    box: Letterbox
    camera: Camera
    figures: DockingFigures
    now: DockingFigures
    rows: dict[str, JudgedFigure]

    def seen(self, points_port_m: np.ndarray) -> list[Point] | None:
        """Return screen positions of points, or None if one is beside or behind the camera."""
        in_camera = self.figures.in_camera_m(points_port_m)
        depth = in_camera[:, 2]
        # the lens distorts points far outside the picture
        if depth.min() < NEAR_M or np.any(np.linalg.norm(in_camera[:, :2], axis=1) > 1.5 * depth):
            return None
        return [self.box.at((float(x), float(y))) for x, y in self.camera.project(in_camera)]


class DockingHud:
    """The docking display over one view.

    Parameters
    ----------
    window : Surface
        Surface to draw in.
    """

    def __init__(self, window: Surface) -> None:
        self._window = window
        self._w = Widgets(window)
        self.plates: list[Place] = []
        """Rectangles of the texts drawn last, which other texts leave free."""

    def draw(self, box: Letterbox, console: Console, picture: Picture) -> None:
        """Draw over a picture what lies in it, and the figures of the time that is shown."""
        session, self.plates = console.session, []
        if picture.target is not session.plan.target:
            # the last picture may be of another scenario
            return
        docking = session.craft.docking
        chasers = picture.state.chaser, session.craft.chaser
        seen, now = (docking.figures(chaser, session.flight) for chaser in chasers)
        rows = {r.name: r for r in judge(now, docking.limits, docking.corridor_deg)}
        canvas, camera = Canvas(self._window), picture.frame.scene.camera
        sight = Sight(canvas, box, camera, seen, now, rows)
        self._corridor(sight, docking)
        self._port(sight)
        with self._window.ctx.push_font(self._window.figure_font, 0.0):
            centre = box.at((camera.cx_px, camera.cy_px))
            radius = RING_SHARE * min(box.width, box.height)
            if radius < LEAST_RING * self._window.scale:
                radius = 0.0
            self._ring(sight, centre, radius)
            self._status(canvas, box, centre, radius, console)

    # --- in the picture

    @staticmethod
    def _corridor(sight: Sight, docking: Docking) -> None:
        """Draw a square about the axis at each hold point, as wide as the allowed offset there."""
        canvas, following = sight.canvas, docking.hold_points.next
        for point in docking.hold_points.points:
            if point.axial_m > sight.figures.axial_m + 1.0:
                continue
            half = docking.limits.lateral_at_m(point.axial_m)
            corners = np.array([[x * half, y * half, -point.axial_m] for x, y in _SQUARE])
            if (corners_px := sight.seen(corners)) is None:
                continue
            ahead = following is not None and point.name == following.name
            colour = style.ACCENT if ahead else style.QUIET
            canvas.stroke(corners_px, colour, 2.0 if ahead else 1.2, closed=True)
            width = max(abs(corners_px[1][0] - corners_px[0][0]), abs(corners_px[1][1] - corners_px[0][1]))
            if ahead or width > LABELLED:
                at, name = (corners_px[1][0] + 5, corners_px[1][1] - 8), f"{point.name} {point.axial_m:g} m"
                canvas.text(at, name, colour, "hold point, and metres before the port")

    @staticmethod
    def _port(sight: Sight) -> None:
        """Draw the port's rim, its upper side, and the predicted point of contact."""
        canvas, rows = sight.canvas, sight.rows
        turn = np.linspace(0.0, 2 * np.pi, 33)[:-1]
        rim = np.stack([CAPTURE_M * np.cos(turn), CAPTURE_M * np.sin(turn), 0 * turn], axis=1)
        worst = max((rows["offset right"], rows["offset down"]), key=lambda r: r.share)
        colour = style.LIMIT_COLORS[worst.state]
        if (rim_px := sight.seen(rim)) is not None:
            canvas.stroke(rim_px, colour, 1.8, closed=True)
        if (cross := sight.seen(np.array(_CROSS) * CAPTURE_M)) is not None:
            for k in (0, 2, 4):
                canvas.stroke(cross[k : k + 2], colour, 1.8)
        aim = sight.figures.aimed_at_m
        if aim is not None and (at := sight.seen(np.array([[*aim, 0.0]]))) is not None:
            canvas.diamond(at[0], 6.0, style.INK)

    # --- over the picture

    def _ring(self, sight: Sight, centre: Point, radius: float) -> None:
        """Draw the boresight's reticle and, unless the radius is 0, the ring with its figures."""
        canvas, rows = sight.canvas, sight.rows
        cx, cy = centre
        canvas.rays(centre, 6.0, 22.0, style.INK, 1.4)
        if radius == 0.0:
            return
        canvas.circle((cx, cy), radius, (*style.INK[:3], 0.8), 1.4)
        self._needles(sight, centre, radius)
        line = self._w.line
        self._pair(canvas, (cx, cy - radius - 2.2 * line), rows["roll"], rows["roll rate"], 0.5)
        self._pair(canvas, (cx + radius + 14, cy - line), rows["pitch"], rows["pitch rate"], 0.0)
        self._pair(canvas, (cx, cy + radius + 0.4 * line), rows["yaw"], rows["yaw rate"], 0.5)
        self._pair(canvas, (cx - radius - 14, cy - 2.2 * line), rows["offset right"], rows["rate right"], 1.0)
        self._pair(canvas, (cx - radius - 14, cy + 0.2 * line), rows["offset down"], rows["rate down"], 1.0)
        at = (cx, cy + radius - 3.1 * line)
        self._text(canvas, at, f"{sight.now.axial_m:z.2f} m", style.INK, 0.5, DISTANCE)
        self._figure(canvas, (cx, cy + radius - 2.1 * line), "closing", rows["closing"], 0.5)

    @staticmethod
    def _needles(sight: Sight, centre: Point, radius: float) -> None:
        """Draw marks on the ring that move with roll (top), pitch (right) and yaw (bottom) error."""
        (cx, cy), figures = centre, sight.now
        values = figures.roll_deg, -figures.pitch_deg, -figures.yaw_deg
        for name, value, base in zip(("roll", "pitch", "yaw"), values, (-90.0, 0.0, 90.0), strict=True):
            angle_deg = base + 2 * float(np.clip(value, -FULL_SCALE_DEG, FULL_SCALE_DEG))
            for angle, colour, inner, outer, weight in (
                (base, style.INK, 0.97, 1.03, 1.4),
                (angle_deg, style.LIMIT_COLORS[sight.rows[name].state], 0.90, 1.0, 3.0),
            ):
                c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
                a = (cx + inner * radius * c, cy + inner * radius * s)
                sight.canvas.stroke([a, (cx + outer * radius * c, cy + outer * radius * s)], colour, weight)

    def _pair(self, canvas: Canvas, at: Point, value: JudgedFigure, rate: JudgedFigure, share: float) -> None:
        self._figure(canvas, at, value.name.removeprefix("offset "), value, share)
        self._figure(canvas, (at[0], at[1] + self._w.line), "", rate, share)

    def _text(self, canvas: Canvas, at: Point, text: str, rgba: style.Rgba, share: float, tip: str) -> None:
        """Draw text with a ``share`` of its width left of the position: 0.5 centres it."""
        corner, size = (at[0] - share * canvas.size(text)[0], at[1]), canvas.size(text)
        canvas.label(corner, text, rgba, tip)
        self.plates.append((*corner, *size))

    def _figure(self, canvas: Canvas, at: Point, name: str, row: JudgedFigure, share: float) -> None:
        text = f"{name} {row.text} {row.unit}".strip() + style.LIMIT_MARKS[row.state]
        tip = f"{FIGURE_TIPS[row.name]} [{row.unit}]"
        self._text(canvas, at, text, style.LIMIT_COLORS[row.state], share, tip)

    def _status(self, canvas: Canvas, box: Letterbox, centre: Point, radius: float, console: Console) -> None:
        """Write the control mode and the operator's next decision, where other text leaves room."""
        text, colour = status(console)
        if console.session.craft.steering.plume:
            text, colour = f"{text}   PLUME ON TARGET".strip(), style.OUTSIDE
        line = self._w.line
        x, y = box.x + box.width / 2, box.y + 0.6 * line
        if radius == 0.0:
            y = box.y + box.height - 1.8 * line
        elif box.width < WIDE * self._window.scale:
            x, y = centre[0], centre[1] - radius + 0.8 * line
        self._text(canvas, (x, y), text, colour, 0.5, "active guidance, and what it waits for")


_SQUARE = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))  # corners of a gate
# right arm, left arm, and the upper one
_CROSS = ((0.6, 0, 0), (1.4, 0, 0), (-0.6, 0, 0), (-1.4, 0, 0), (0, -0.4, 0), (0, -1.8, 0))


def status(console: Console) -> tuple[str, style.Rgba]:
    """Return a line on the state of the approach, and its colour."""
    session = console.session
    docking, steering = session.craft.docking, session.craft.steering
    contact = docking.contact
    if docking.docked and contact is not None:
        return f"DOCKED   score {contact.score}", style.WITHIN
    if steering.aborting:
        return f"ABORT: RETREAT to {steering.retreat_to_m:.3g} m", style.OUTSIDE
    if contact is not None and not contact.docked and session.t_s - contact.t_s < 20.0:
        return f"CONTACT, NO DOCKING: {contact.misses[0]}", style.OUTSIDE
    point = docking.hold_points.next
    goal = "the port" if point is None else f"{point.name} {point.axial_m:g} m"
    if not steering.autopilot:
        return f"{console.flown_by}   next: {goal}", flown_colour(console.session, style.INK)
    if point is not None and point.decision == "no-go":
        return f"NO-GO at {goal}", style.NEAR
    if session.waits_for_go:
        return f"{goal}: GO? (Enter)", style.NEAR
    return f"AUTOPILOT to {goal}", style.ACCENT
