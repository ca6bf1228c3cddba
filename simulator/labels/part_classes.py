"""Seven classes of parts that every craft has some of, by the names of its parts: what an inspection looks for.

First that applies: solar_array, antenna, propulsion, docking, sensor, radiator, else body.
"""

from __future__ import annotations

import re
from typing import Literal, get_args

PartClass = Literal["solar_array", "antenna", "propulsion", "docking", "sensor", "radiator", "body"]
PART_CLASSES: tuple[PartClass, ...] = get_args(PartClass)

_WORDS: dict[PartClass, str] = {
    "solar_array": r"cells?|wings?|array|panel|busbars|trunk_cell_base",
    "antenna": r"antennas?|dish|patch|spirals?|rod|whip|tape|feed|s_band|x_band|asar|doris|ka|boom|horns|reflectors"
    r"|gimbal|relay",
    "propulsion": r"thrusters?|engines?|nozzle|tanks?|abort|chamber|draco",
    "docking": r"docking|hatch|capture|guides?|probe|grips?|hooks|target|petals|soft|collar|berthing|interface|forward",
    "sensor": r"sensors?|lens(es)?|tracker|camera|telescope|instruments?|periscope|meris|mipas|gomos|aatsr|sciamachy"
    r"|mwr|ra|navigation|windows?|panes|porthole|prisms|retroreflector",
    "radiator": r"radiators?|shield",
}
_RULES = tuple((name, re.compile(rf"(^|_)({words})\d*(_|$)")) for name, words in _WORDS.items())


def part_class(part: str) -> PartClass:
    """The class of a part by its name."""
    return next((name for name, rule in _RULES if rule.search(part)), "body")
