"""Commands of maps and further pictures: their place and scale."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui.command_table import Argument, command, number, word
from flyaround.gui.picture.orbit_camera import ABOUT, FARTHEST_M, NEAREST_M
from flyaround.gui.picture.relative_map import LEAST_WIDTH_M, MOST_WIDTH_M

if TYPE_CHECKING:
    from flyaround.gui.console import Console


def _zoom(console: Console, factor: float) -> None:
    look = console.options.map
    look.place(look.centre_lvlh_m, look.width_m / factor)


def _place(console: Console, along_m: float, radial_m: float, cross_m: float, width_m: float) -> None:
    console.options.map.place((radial_m, along_m, cross_m), width_m)


def _about(console: Console, about: str) -> None:
    console.options.orbit.about = next(a for a in ABOUT if a == about)


def _metres(name: str, of: str) -> Argument:
    return number(name, of, -MOST_WIDTH_M, MOST_WIDTH_M, "m")


COMMANDS = (
    command("map.fit", lambda console: setattr(console.options.map, "fitted", True)),
    command("map.zoom", _zoom, number("factor", "as large; above 1: nearer", 0.01, 100.0, "times")),
    command(
        "map.place",
        _place,
        _metres("along", "middle, along-track"),
        _metres("radial", "middle, radial"),
        _metres("cross", "middle, cross-track"),
        number("width", "across the map", LEAST_WIDTH_M, MOST_WIDTH_M, "m"),
    ),
    command("orbit-camera.about", _about, word("about", "the centre", ABOUT)),
    command(
        "orbit-camera.place",
        lambda console, *angles_distance: console.options.orbit.place(*angles_distance),
        number("azimuth", "0 looks along the flight", -360, 360, "°"),
        number("elevation", "above the orbit", -90, 90, "°"),
        number("distance", "from the centre", NEAREST_M, FARTHEST_M, "m"),
    ),
    command("orbit-camera.reset", lambda c: c.options.orbit.reset(c.session.craft.world.range_m)),
)
