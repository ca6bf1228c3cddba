"""Planned burns on the LVLH map: nodes on the predicted path, with draggable handles."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.gui import style
from flyaround.gui.canvas import point
from flyaround.gui.picture.label_placement import place_labels
from flyaround.gui.texts import texts
from flyaround.simulator.piloting.planned_burns import BurnPlan, PlannedBurn
from flyaround.simulator.piloting.readouts import speed_text
from flyaround.simulator.runtime.arrays import vec3

if TYPE_CHECKING:
    from flyaround.gui.canvas import Canvas, Place, Point
    from flyaround.gui.console import Console
    from flyaround.gui.picture.relative_map import MapPort
    from flyaround.simulator.piloting.planned_burns import PredictedPath
    from flyaround.simulator.piloting.session import FlightSession
    from flyaround.simulator.runtime.arrays import FloatArray

COLOUR = style.PURPLE
MARKS = {"node": COLOUR, "handle": style.INK}
ARM = 16.0
"""Distance from a node to its handle, in screen units, for a burn without a component in the plane."""
PER_M_S = 800.0
"""Additional distance per m/s, 40 units for 5 cm/s; less where the handle would lie off the map."""
GRIP = 9.0
"""Distance within which the pointer picks a node or handle."""
HINTS = texts("burn-grips")
"""Hover text of each grip."""
FIRST_M_S = 0.02
"""Along-track delta-v of a burn that is planned by a click."""
EVERY_S = 0.5
"""Interval at which the path is recomputed, at 1x."""
SAMPLES = 40  # points of the predicted path per burn


@dataclass(frozen=True)
class Grip:
    """The node or handle that the pointer holds, the plane, the burn's time in the plan, and its arrow's scale."""

    burn: PlannedBurn
    what: str
    port: MapPort
    planned_s: float
    scale: tuple[float, float]


class BurnNodes:
    """Planned burns with handles for the pointer; the command is given on release."""

    def __init__(self) -> None:
        self._grip: Grip | None = None
        self._quiet = False
        """True from a drag until the pointer leaves the grips; hover texts would cover the path that it changed."""
        self.under: Grip | None = None
        """Node or handle under the pointer, or held by it."""
        self._plan = BurnPlan()
        self._path: PredictedPath | None = None
        self.path_lvlh_m = self.nodes_lvlh_m = np.zeros((0, 3))
        """(n, 3) predicted path through the burns, and their positions; empty without any."""
        self._risk = ""
        self._key: tuple[object, ...] = ()

    def take_mouse(
        self, console: Console, ports: tuple[MapPort, ...], mouse: Point, pressed: tuple[bool, bool, bool]
    ) -> bool:
        """Apply the pointer's actions to burns; return True if the map must ignore it.

        Parameters
        ----------
        console : Console
            The console.
        ports : tuple of MapPort
            Planes on the screen.
        mouse : Point
            Position of the pointer.
        pressed : tuple of bool
            Left button went down on the map, is down; right button went down on the map.
        """
        session = console.session
        self._refresh(session, session.craft.steering.burns if self._grip is None else self._plan)
        clicked, down, other = pressed
        port = next((p for p in ports if p.inside(*mouse)), None)
        self.under = self._grip or (None if port is None else self._found(port, mouse))
        self._quiet &= self.under is not None
        if self._grip is not None:
            if down:
                self._drag(session, mouse)
            else:
                self._let_go(console)
            return True
        if port is None or not (clicked or other):
            return False
        grip = self.under
        if clicked and grip is not None:
            self._grip, self._plan, self._quiet = grip, session.craft.steering.burns, True
            return True
        if other and grip is not None:
            console.do("burn.cancel", grip.burn.t_s)
        elif other:
            console.do("burn.plan", self._time_at(session, port, mouse), 0.0, FIRST_M_S, 0.0)
        return other

    def draw(self, canvas: Canvas, port: MapPort, obstacles: tuple[Place, ...]) -> None:
        """Draw the path after the burns, each node, and its handle in this plane.

        Parameters
        ----------
        canvas : Canvas
            Canvas of the map.
        port : MapPort
            View of the map.
        obstacles : tuple of Place
            Rectangles that the burns' sizes avoid, x, y, width, height.
        """
        if self._path is None:
            return
        colour = style.BAD if self._risk else COLOUR
        canvas.stroke(port.at(self._path.points_lvlh_m), colour, 1.6, dashed=True)
        arrows = self._arrows(port)
        for _, node, tip in arrows:
            canvas.arrow(node, tip, COLOUR, 1.8)
        texts = [speed_text(burn.size_m_s) for burn, *_ in arrows]
        sizes, tips = [canvas.size(text) for text in texts], [tip for *_, tip in arrows]
        about = "" if self._quiet else "size of the burn; drag its handle for that, its node for the time"
        labels = place_labels(tips, sizes, port.rect, obstacles=obstacles)
        for (burn, _, tip), text, size, label in zip(arrows, texts, sizes, labels, strict=True):
            if label is not None:
                canvas.stroke([tip, label.lead or tip], COLOUR, 1.0)
                canvas.label(label.corner, text, style.INK, about)
            elif self.under is not None and self.under.burn == burn:
                # over other marks, because the size of a burn that is dragged must be read
                most = np.add(port.rect[:2], port.rect[2:]) - size
                canvas.label(point(np.minimum(np.array(tip) + 8.0, most)), text, style.INK)

    def draw_grips(self, canvas: Canvas, port: MapPort) -> None:
        """Draw nodes and handles, over the letters of the map, with their hover texts."""
        under = None if self.under is None else (self.under.burn, self.under.what, self.under.port.plane)
        for burn, *places in self._arrows(port):
            for what, place in zip(HINTS, places, strict=True):
                size = 7.0 if under == (burn, what, port.plane) else 5.0
                # the handle is a ring, as of a slider's grab; the chaser is a dot
                (canvas.diamond if what == "node" else canvas.dot)(place, size, MARKS[what])
                canvas.dot(place, 2.0, COLOUR)
                hint = "" if self._quiet else HINTS[what]
                canvas.tip((place[0] - GRIP, place[1] - GRIP), (2 * GRIP, 2 * GRIP), hint)

    def hold_map(self, ports: tuple[MapPort, ...], mouse: Point, *, down: bool) -> bool:
        """Return True while the scale must stay: the pointer holds or could pick a grip, or has a button down."""
        return self.under is not None or (down and any(p.inside(*mouse) for p in ports))

    # --- inside

    def _arrows(self, port: MapPort) -> list[tuple[PlannedBurn, Point, Point]]:
        """Return each burn with the positions of its node and its handle on the screen."""
        nodes, held = () if self._path is None else self._path.nodes_lvlh_m, self._grip
        arrows = []
        for burn, node in zip(self._plan.burns, nodes, strict=False):
            at, scale = point(port.at(node)), None
            if held is not None and (held.burn, held.what, held.port.plane) == (burn, "handle", port.plane):
                scale = held.scale
            arrows.append((burn, at, handle(at, burn, port, scale)))
        return arrows

    def _refresh(self, session: FlightSession, plan: BurnPlan) -> None:
        turn = int(session.t_s / (EVERY_S * max(session.clock.rate, 1.0)))
        key = session, plan, session.craft.steering.guard, turn
        if key == self._key:
            return
        self._key = key
        # a burn in progress has no node
        self._plan = ahead = BurnPlan(tuple(b for b in plan.burns if b.t_s >= session.t_s))
        self._path = session.craft.predicted_burns(ahead, samples=SAMPLES) if ahead.burns else None
        found = (self._path.points_lvlh_m, self._path.nodes_lvlh_m) if self._path else ((), ())
        self.path_lvlh_m, self.nodes_lvlh_m = (np.reshape(points, (-1, 3)) for points in found)
        self._risk = session.craft.risk_of(self.path_lvlh_m)

    def _found(self, port: MapPort, mouse: Point) -> Grip | None:
        for burn, at, tip in self._arrows(port):
            for what, place in (("handle", tip), ("node", at)):
                if math.dist(place, mouse) <= GRIP:
                    return Grip(burn, what, port, burn.t_s, arrow_scale(at, burn, port)[1:])
        return None

    def _drag(self, session: FlightSession, mouse: Point) -> None:
        grip = self._grip
        if grip is None:
            return
        at = next((at for burn, at, _ in self._arrows(grip.port) if burn.t_s == grip.burn.t_s), None)
        if at is None:
            self._grip = None
            return
        if grip.what == "handle":
            burn = dragged(grip.burn, grip.port, at, mouse, grip.scale)
        else:
            burn = replace(grip.burn, t_s=self._time_at(session, grip.port, mouse))
        other_burns = tuple(b for b in self._plan.burns if b.t_s != grip.burn.t_s)
        self._grip = replace(grip, burn=burn)
        self._plan = BurnPlan(tuple(sorted((*other_burns, burn), key=lambda b: b.t_s)))
        self._refresh(session, self._plan)

    def _let_go(self, console: Console) -> None:
        grip, self._grip = self._grip, None
        if grip is None:
            return
        planned = console.session.craft.steering.burns.burns
        if grip.burn not in planned:
            console.do("burn.plan", grip.burn.t_s, *grip.burn.delta_v_lvlh_m_s, grip.planned_s)
        self._key = ()

    def _time_at(self, session: FlightSession, port: MapPort, mouse: Point) -> float:
        """Return the time at which the predicted path is nearest to the pointer, at least some seconds ahead."""
        path = self._path
        if path is None:
            path = session.craft.predicted_burns(BurnPlan(), samples=SAMPLES)
        way = port.at(path.points_lvlh_m) - np.array(mouse)
        ahead = path.times_s > session.t_s + 5.0
        k = int(np.argmin(np.where(ahead, np.hypot(way[:, 0], way[:, 1]), np.inf)))
        return round(float(path.times_s[k]), 1)


def arrow_scale(node: Point, burn: PlannedBurn, port: MapPort) -> tuple[FloatArray, float, float]:
    """Return a burn's delta-v on the screen [m/s], and the length of its arrow without delta-v and per m/s.

    The arrow ends inside the map if its node lies there.
    """
    part = np.array([burn.delta_v_lvlh_m_s[port.plane.right], -burn.delta_v_lvlh_m_s[port.plane.up]])
    size = float(np.linalg.norm(part))
    if not port.inside(*node):
        return part, ARM, PER_M_S
    along = part / size if size > 0 else np.array([1.0, 0.0])
    x, y, w, h = port.rect
    edges = np.where(along > 0, (x + w - GRIP, y + h - GRIP), (x + GRIP, y + GRIP))
    room = max(float(np.min((edges - node)[along != 0] / along[along != 0])), GRIP / 2)
    arm = min(ARM, room / 2)
    return part, arm, min(PER_M_S, (room - arm) / max(size, 1e-9))


def handle(node: Point, burn: PlannedBurn, port: MapPort, scale: tuple[float, float] | None = None) -> Point:
    """Return the screen position of a burn's handle: from its node along the delta-v in this plane, inside the map.

    Parameters
    ----------
    node : Point
        Screen position of the node.
    burn : PlannedBurn
        The burn.
    port : MapPort
        Plane on the screen.
    scale : tuple of float, optional
        Length of the arrow without delta-v and per m/s, while it is dragged.

    Returns
    -------
    Point
        Screen position.
    """
    part, *fitting = arrow_scale(node, burn, port)
    arm, per_m_s = scale or fitting
    size = float(np.linalg.norm(part))
    along = part / size if size > 0 else np.array([1.0, 0.0])
    return point(np.array(node) + (arm + per_m_s * size) * along)


def dragged(
    burn: PlannedBurn, port: MapPort, node: Point, mouse: Point, scale: tuple[float, float]
) -> PlannedBurn:
    """Return the burn with its handle at the pointer, in whole millimetres per second; never zero.

    Returns
    -------
    PlannedBurn
        The burn with the delta-v at this ``scale``: length without delta-v, and length per m/s.
    """
    way = np.array([mouse[0] - node[0], node[1] - mouse[1]])
    length, (arm, per_m_s) = float(np.linalg.norm(way)), scale
    size = max(length - arm, 0.0) / max(per_m_s, 1e-9)
    parts = np.array(burn.delta_v_lvlh_m_s)
    parts[[port.plane.right, port.plane.up]] = size * way / max(length, 1e-9)
    parts = np.round(parts, 3) + 0.0
    return replace(burn, delta_v_lvlh_m_s=vec3(parts)) if parts.any() else burn
