"""Commands of maps and further pictures: what of the world they show."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gui.command_table import Argument, Command
from gui.flight.relative_map import LEAST_WIDTH_M, MOST_WIDTH_M

if TYPE_CHECKING:
    from gui.console import Console


def _fit(console: Console) -> None:
    console.options.map.fitted = True


def _zoom(console: Console, factor: float) -> None:
    look = console.options.map
    look.place(look.centre_lvlh_m, look.width_m / factor)


def _place(console: Console, along_m: float, radial_m: float, cross_m: float, width_m: float) -> None:
    console.options.map.place((radial_m, along_m, cross_m), width_m)


def _metres(name: str, of: str) -> Argument:
    return Argument(name, "number", f"{of} [m]", least=-MOST_WIDTH_M, most=MOST_WIDTH_M)


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
        arguments=(Argument("factor", "number", "above 1: nearer", least=0.01, most=100.0),),
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
            Argument("width", "number", "metres across", least=LEAST_WIDTH_M, most=MOST_WIDTH_M),
        ),
    ),
)
