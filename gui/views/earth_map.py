"""The map of the Earth (or the Moon) below the target: ground track, day and night, upcoming eclipse."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import numpy as np

from flyaround.gui import style
from flyaround.gui.canvas import Canvas, legend_keys, point
from flyaround.gui.picture.ground_map import GroundMap, load_ground_map
from flyaround.gui.views.letterbox import Letterbox
from flyaround.gui.widgets import Panel
from flyaround.simulator.piloting import ground_track
from flyaround.simulator.piloting.readouts import duration_text

if TYPE_CHECKING:
    from concurrent.futures import Future

    from flyaround.gui.canvas import Point
    from flyaround.gui.console import Console
    from flyaround.gui.surface import Surface
    from flyaround.simulator.piloting.session import FlightSession
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.flight.world_state import WorldState

TRACK_EVERY_S = 60.0
"""Simulated time between two tracks, up to 60x; beyond that one per second of real time."""
SHADE_EVERY_DEG = 0.5
"""Angular step in which day and night follow the Sun."""
PAST, SUNLIT, SHADOWED = style.ACCENT, style.YELLOW, style.SHADOW  # colours of the ground track
KEYS = legend_keys("ground-map")
AHEAD = "simulated time until then [min:s], by an orbit under J2 alone, which is right to a second an orbit"


class EarthMap(Panel):
    """Ground track of the last orbit and the next; begin and end of shadow."""

    name, title, place, shown = "earth-map", "Earth map", "bottom", False
    bare = True

    def __init__(self, window: Surface) -> None:
        super().__init__(window)
        # decoding maps and propagating an orbit must not block the window
        self._aside = ThreadPoolExecutor(1)
        self._maps: dict[str, Future[GroundMap]] = {}
        self._shade: tuple[object, ...] = ()
        self._session: FlightSession | None = None
        self._track: ground_track.GroundTrack | None = None
        self._coming: Future[ground_track.GroundTrack] | None = None
        self._requested_s = -math.inf

    def draw(self, console: Console) -> None:
        """Draw into the current view."""
        session = console.session
        place = self._free(32.0)
        canvas = Canvas(self._window)
        canvas.clip(place[:2], place[2:])
        world = session.craft.world
        self._follow(session)
        rows = self._figures(session, world)
        line = canvas.line
        below = place[3] > 0.5 * place[2] + 2 * line
        keys = KEYS if place[3] > (len(rows) + len(KEYS) + 0.8) * line else ()
        sizes = [canvas.size(text)[0] for text, _, _ in rows]
        side = max(*sizes, *(canvas.size(key.name)[0] + 1.2 * line for key in keys)) + 20
        wide = not below and place[2] - side > 1.1 * place[3]
        across = place[2] - side if wide else place[2]
        box = Letterbox.fit((360, 180), (place[0], place[1], across, place[3]))
        if below:
            box = Letterbox(box.x, place[1], box.width, box.height, box.scale)
        self._ground(canvas, box, world)
        self._graticule(canvas, box)
        self._paths(canvas, box, session.t_s)
        self._marks(canvas, box, world)
        left = box.x + box.width + 10 if wide else place[0] + 8
        top = place[1] + box.height + 4 if below else place[1] + 6
        for k, (text, colour, tip) in enumerate(rows):
            if top + (k + 1) * line < place[1] + place[3]:
                canvas.text((left, top + k * line), text, colour, tip)
        if wide or below:
            canvas.legend((left, top + (len(rows) + 0.5) * line), 0.0 if wide else place[2], keys)
        canvas.unclip()

    # --- computed in a thread

    def _follow(self, session: FlightSession) -> None:
        """Request a new track if the last one is old."""
        if self._session is not session:
            self._session, self._track, self._requested_s = session, None, -math.inf
            self._coming = None
        if self._coming is not None and self._coming.done():
            if self._coming.exception() is None:
                self._track = self._coming.result()
            self._coming = None
        old = abs(session.t_s - self._requested_s) > max(TRACK_EVERY_S, session.clock.rate)
        if old and self._coming is None:
            self._requested_s = session.t_s
            self._coming = self._aside.submit(ground_track.ground_track, session.flight, session.t_s)

    def _ground(self, canvas: Canvas, box: Letterbox, world: WorldState) -> None:
        body = world.central_body
        if body not in self._maps:
            self._maps[body] = self._aside.submit(load_ground_map, world.central.body)
        canvas.box((box.x, box.y), (box.width, box.height), style.RAISED)
        loading = self._maps[body]
        if not loading.done():
            return
        error = loading.exception()
        if error is not None:
            # the track is useful without the map
            text = f"no map of {world.central.body.title}: {error}"
            canvas.text((box.x + 6, box.y + 6), text, style.YELLOW)
            return
        ground = loading.result()
        sun = self._subsolar(world)
        key = (body, *(round(x / SHADE_EVERY_DEG) for x in sun))
        if key != self._shade:
            self._shade = key
        # the picture is computed again only for another key
        place = (box.x, box.y, box.width, box.height)
        canvas.picture(self.name, self._shade, lambda: ground.lit(*sun), place)

    @staticmethod
    def _subsolar(world: WorldState) -> tuple[float, float]:
        to_sun = np.subtract(world.r_sun_eci_m, world.central.r_eci_m)
        return ground_track.subsolar_deg(to_sun, world.central.R_fixed_from_eci)

    @staticmethod
    def _below(world: WorldState) -> tuple[float, float]:
        central = world.central
        out = central.R_fixed_from_eci @ np.subtract(world.r_target_eci_m, central.r_eci_m)
        latitude, longitude = ground_track.geodetic_deg(out, central.body)
        return float(latitude), float(longitude)

    # --- what is drawn

    def _graticule(self, canvas: Canvas, box: Letterbox) -> None:
        lines = [(angle, (-90.0, angle), (90.0, angle)) for angle in np.arange(-150.0, 180.0, 30.0)]
        lines += [(angle, (angle, -180.0), (angle, 180.0)) for angle in np.arange(-60.0, 90.0, 30.0)]
        for angle, start, end in lines:
            ends = [map_place(box, *start), map_place(box, *end)]
            canvas.stroke(ends, (1, 1, 1, 0.12 if angle else 0.3), 1.0, halo=False)

    def _paths(self, canvas: Canvas, box: Letterbox, now_s: float) -> None:
        track = self._track
        if track is None:
            return
        is_past = track.times_s <= now_s
        shadowed = track.sunlit < 0.5
        legs = (is_past, PAST), (~is_past & ~shadowed, SUNLIT), (~is_past & shadowed, SHADOWED)
        for part, colour in legs:
            # a segment starts where the previous one ends
            on = part | np.append(part[1:], False)
            latitude = np.where(on, track.latitude_deg, np.nan)
            latitude, longitude = ground_track.split_at_map_edge(latitude, track.longitude_deg)
            canvas.stroke(map_places(box, latitude, longitude), colour, 1.8, dashed=colour != PAST)

    def _marks(self, canvas: Canvas, box: Letterbox, world: WorldState) -> None:
        sun = self._subsolar(world)
        latitude, longitude = ground_track.terminator_deg(*sun)
        canvas.stroke(map_places(box, latitude, longitude), style.ORANGE, 1.2)
        at, radius = map_place(box, *sun), 5.0 * self._window.scale
        canvas.dot(at, radius, style.YELLOW)
        canvas.rays(at, 1.4 * radius, 2.0 * radius, style.YELLOW, 1.4, count=8)
        at = map_place(box, *self._below(world))
        canvas.dot(at, 4.5 * self._window.scale, style.INK if world.sun_visible_fraction > 0 else SHADOWED)
        canvas.circle(at, 8.0 * self._window.scale, style.ACCENT, 1.6)

    def _figures(self, session: FlightSession, world: WorldState) -> list[tuple[str, style.Rgba, str]]:
        place, high = place_text(*self._below(world)), f"{world.altitude_m / 1e3:.1f} km high"
        rows = [(place, style.INK, "geodetic latitude and longitude below the target")]
        rows.append((high, style.INK, "the target above a sphere of the equatorial radius"))
        sun_share = world.sun_visible_fraction
        state = "in the shadow" if sun_share <= 0 else f"{100 * sun_share:.0f} % of the Sun"
        state, colour = ("in sunlight", style.GOOD) if sun_share >= 1 else (state, style.WARN)
        rows.append((state, colour, "share of the Sun's disc that the target sees"))
        track = self._track
        if track is not None:
            for name, event_s in (("shadow in", track.enters_s), ("sunlight in", track.leaves_s)):
                if event_s is not None and event_s > session.t_s:
                    rows.append((f"{name} {duration_text(event_s - session.t_s)}", style.INK, AHEAD))
            if track.enters_s is None and track.leaves_s is None:
                never = "no shadow ahead" if sun_share >= 1 else "no sunlight ahead"
                rows.append((never, style.QUIET, AHEAD))
        return rows


def map_places(box: Letterbox, latitude_deg: FloatArray, longitude_deg: FloatArray) -> FloatArray:
    """Return screen positions (n, 2) of geodetic coordinates."""
    x = box.x + (longitude_deg + 180.0) / 360.0 * box.width
    y = box.y + (90.0 - latitude_deg) / 180.0 * box.height
    return np.stack([x, y], axis=-1)


def map_place(box: Letterbox, latitude_deg: float, longitude_deg: float) -> Point:
    """Return the screen position of geodetic coordinates."""
    return point(map_places(box, np.array(latitude_deg), np.array(longitude_deg)))


def place_text(latitude_deg: float, longitude_deg: float) -> str:
    """Return coordinates as maps write them."""
    north, east = "N" if latitude_deg >= 0 else "S", "E" if longitude_deg >= 0 else "W"
    return f"{abs(latitude_deg):.1f}° {north}  {abs(longitude_deg):.1f}° {east}"
