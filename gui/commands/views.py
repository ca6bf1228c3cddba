"""Commands of maps and further pictures: what of the world they show."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui.command_table import Argument, Command
from flyaround.gui.picture.orbit_camera import ABOUT, FARTHEST_M, NEAREST_M
from flyaround.gui.picture.relative_map import LEAST_WIDTH_M, MOST_WIDTH_M

if TYPE_CHECKING:
    from flyaround.gui.console import Console


def _fit(console: Console) -> None:
    console.options.map.fitted = True


def _zoom(console: Console, factor: float) -> None:
    look = console.options.map
    look.place(look.centre_lvlh_m, look.width_m / factor)


def _place(console: Console, along_m: float, radial_m: float, cross_m: float, width_m: float) -> None:
    console.options.map.place((radial_m, along_m, cross_m), width_m)


def _about(console: Console, about: str) -> None:
    console.options.orbit.about = next(a for a in ABOUT if a == about)


def _turn(console: Console, azimuth_deg: float, elevation_deg: float, distance_m: float) -> None:
    console.options.orbit.place(azimuth_deg, elevation_deg, distance_m)


def _metres(name: str, of: str) -> Argument:
    return Argument(name, "number", of, least=-MOST_WIDTH_M, most=MOST_WIDTH_M, unit="m")


COMMANDS = (
    Command(
        "map.fit",
        "Map: show all",
        "the LVLH map shows the whole flight, the keep-out sphere and the target",
        _fit,
    ),
    Command(
        "map.zoom",
        "Map: zoom",
        "the LVLH map so many times as large",
        _zoom,
        arguments=(
            Argument("factor", "number", "as large; above 1: nearer", least=0.01, most=100.0, unit="times"),
        ),
    ),
    Command(
        "map.place",
        "Map: place",
        "the LVLH map's middle, and the metres across it",
        _place,
        arguments=(
            _metres("along", "middle, along-track"),
            _metres("radial", "middle, radial"),
            _metres("cross", "middle, cross-track"),
            Argument("width", "number", "across the map", least=LEAST_WIDTH_M, most=MOST_WIDTH_M, unit="m"),
        ),
    ),
    Command(
        "orbit-camera.about",
        "Orbit camera about",
        "what the free camera circles and looks at",
        _about,
        arguments=(Argument("about", "word", "the centre", ABOUT),),
    ),
    Command(
        "orbit-camera.place",
        "Orbit camera: place",
        "where the free camera is, about the target's LVLH axes",
        _turn,
        arguments=(
            Argument("azimuth", "number", "0 looks along the flight", least=-360, most=360, unit="deg"),
            Argument("elevation", "number", "above the orbit", least=-90, most=90, unit="deg"),
            Argument("distance", "number", "from the centre", least=NEAREST_M, most=FARTHEST_M, unit="m"),
        ),
    ),
    Command(
        "orbit-camera.reset",
        "Orbit camera: reset",
        "the free camera where it was at first, with target and chaser in view",
        lambda console: console.options.orbit.reset(console.session.craft.world.range_m),
    ),
)
