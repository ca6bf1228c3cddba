"""Planned burns on the LVLH map: nodes on the predicted path, with draggable handles."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from flyaround.gui import style
from flyaround.gui.canvas import point
from flyaround.gui.picture.label_placement import place_labels
from flyaround.simulator.piloting.planned_burns import BurnPlan, PlannedBurn
from flyaround.simulator.piloting.readouts import speed_text
from flyaround.simulator.runtime.arrays import vec3

if TYPE_CHECKING:
    from flyaround.gui.canvas import Canvas, Point
    from flyaround.gui.console import Console
    from flyaround.gui.picture.relative_map import MapPort, Plane
    from flyaround.gui.views.camera import Place
    from flyaround.simulator.piloting.planned_burns import PredictedPath
    from flyaround.simulator.piloting.session import FlightSession
    from flyaround.simulator.runtime.arrays import FloatArray

COLOUR = style.PURPLE
ARM = 16.0
"""Distance from a node to its handle, in screen units, for a burn without a component in the plane."""
PER_M_S = 800.0
"""Additional distance per m/s: 40 units for 5 cm/s."""
GRIP = 9.0
"""Distance within which the pointer picks a node or handle."""
FIRST_M_S = 0.02
"""Along-track delta-v of a burn that is planned by a click."""
EVERY_S = 0.5
"""Interval at which the path is recomputed, at 1x."""
SAMPLES = 40  # points of the predicted path per burn


@dataclass(frozen=True)
class Grip:
    """The node or handle that the pointer holds, the plane, and the burn's time in the plan."""

    burn: PlannedBurn
    what: Literal["node", "handle"]
    port: MapPort
    planned_s: float


class BurnNodes:
    """Planned burns with handles for the pointer; the command is given on release."""

    def __init__(self) -> None:
        self._grip: Grip | None = None
        self._plan = BurnPlan()
        self._path: PredictedPath | None = None
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
        if self._grip is not None:
            if down:
                self._drag(session, mouse)
            else:
                self._let_go(console)
            return True
        if port is None or not (clicked or other):
            return False
        grip = self._found(port, mouse)
        if clicked and grip is not None:
            self._grip, self._plan = grip, session.craft.steering.burns
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
        path, burns = self._path, self._plan.burns
        if path is None or not burns:
            return
        canvas.stroke(port.at(path.points_lvlh_m), style.BAD if self._risk else COLOUR, 1.6, dashed=True)
        tips = []
        for burn, node in zip(burns, path.nodes_lvlh_m, strict=False):
            at = point(port.at(node))
            tips.append(handle(at, burn, port.plane))
            canvas.arrow(at, tips[-1], COLOUR, 1.8)
            canvas.dot(tips[-1], 3.5, style.INK)
            canvas.diamond(at, 5.0, COLOUR)
        texts = [speed_text(burn.size_m_s) for burn in burns[: len(tips)]]
        sizes = [canvas.size(text) for text in texts]
        about = "size of the burn; drag its handle for that, its node for the time"
        labels = place_labels(tips, sizes, port.rect, obstacles=obstacles)
        for text, tip, label in zip(texts, tips, labels, strict=True):
            if label is not None:
                canvas.stroke([tip, label.lead or tip], COLOUR, 1.0)
                canvas.label(label.corner, text, style.INK, about)

    @property
    def path_lvlh_m(self) -> FloatArray:
        """(n, 3) predicted path through the burns; empty without any."""
        return np.zeros((0, 3)) if self._path is None else self._path.points_lvlh_m

    def hold_map(self, ports: tuple[MapPort, ...], mouse: Point, *, down: bool) -> bool:
        """Return True while the scale must stay: the pointer holds or could pick a grip, or has a button down."""
        if self._grip is not None:
            return True
        return any(p.inside(*mouse) and (down or self._found(p, mouse) is not None) for p in ports)

    # --- inside

    def _refresh(self, session: FlightSession, plan: BurnPlan) -> None:
        key = (
            session,
            plan,
            session.craft.steering.guard,
            int(session.t_s / (EVERY_S * max(session.clock.rate, 1.0))),
        )
        if key == self._key:
            return
        self._key, self._plan = key, plan
        # a burn in progress has no node
        ahead = BurnPlan(tuple(b for b in plan.burns if b.t_s >= session.t_s))
        self._plan = ahead
        self._path = session.craft.predicted_burns(ahead, samples=SAMPLES) if ahead.burns else None
        self._risk = session.craft.risk_of(self.path_lvlh_m)

    def _found(self, port: MapPort, mouse: Point) -> Grip | None:
        if self._path is None:
            return None
        for burn, node in zip(self._plan.burns, self._path.nodes_lvlh_m, strict=False):
            at = point(port.at(node))
            for what, place in (("handle", handle(at, burn, port.plane)), ("node", at)):
                if np.hypot(place[0] - mouse[0], place[1] - mouse[1]) <= GRIP:
                    return Grip(burn, "handle" if what == "handle" else "node", port, burn.t_s)
        return None

    def _drag(self, session: FlightSession, mouse: Point) -> None:
        grip = self._grip
        if grip is None or self._path is None:
            return
        nodes = dict(zip((b.t_s for b in self._plan.burns), self._path.nodes_lvlh_m, strict=False))
        node = nodes.get(grip.burn.t_s)
        if node is None:
            self._grip = None
            return
        if grip.what == "handle":
            burn = dragged(grip.burn, grip.port.plane, point(grip.port.at(node)), mouse)
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


def handle(node: Point, burn: PlannedBurn, plane: Plane) -> Point:
    """Return the screen position of a burn's handle: from its node along the delta-v in this plane."""
    part = np.array([burn.delta_v_lvlh_m_s[plane.right], -burn.delta_v_lvlh_m_s[plane.up]])
    size = float(np.linalg.norm(part))
    along = part / size if size > 0 else np.array([1.0, 0.0])
    return point(np.array(node) + (ARM + PER_M_S * size) * along)


def dragged(burn: PlannedBurn, plane: Plane, node: Point, mouse: Point) -> PlannedBurn:
    """Return the burn with its handle at the pointer, in whole millimetres per second; never zero."""
    way = np.array([mouse[0] - node[0], node[1] - mouse[1]])
    length = float(np.linalg.norm(way))
    size = max(length - ARM, 0.0) / PER_M_S
    parts = np.array(burn.delta_v_lvlh_m_s)
    parts[[plane.right, plane.up]] = size * way / max(length, 1e-9)
    parts = np.round(parts, 3) + 0.0
    return replace(burn, delta_v_lvlh_m_s=vec3(parts)) if parts.any() else burn
