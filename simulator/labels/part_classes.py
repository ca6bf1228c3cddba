"""Seven classes of parts, derived from the parts' names.

The first that matches: solar_array, antenna, propulsion, docking, sensor, radiator, else body.
"""

from __future__ import annotations

import re
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any, Literal, get_args

import msgspec

from flyaround.simulator.errors import UserError, near_names
from flyaround.simulator.targets.model import PartClass

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.targets.model import Target

PART_CLASSES: tuple[PartClass, ...] = get_args(PartClass)

_NOT_A_BODY_PANEL = "".join(
    f"(?<!{word}_)"
    for word in ("asar", "radiator", "side", "body", "access", "front", "rear", "top", "bottom", "back")
)
_WORDS: dict[PartClass, str] = {
    "solar_array": r"solar(?!_(?:probe|orbiter|sensors?|telescope|observatory|shield))"
    r"|(?<!fuel_)(?<!load_)cells?|wings?"
    rf"|(?<!antenna_)(?<!phased_)arrays?|{_NOT_A_BODY_PANEL}panels?|busbars|trunk_cell_base|photovoltaics?|pv",
    "antenna": r"antennas?|antennae|aerials?|dish|dishes|(?:gnss|gps|uhf|vhf|s_band|x_band)(?:_patch)?|spirals?|^rod"
    r"|whips?|^tape|feeds?|feedhorns?|[slcxk]_band|asar|doris|ka|(?:relay|rendezvous)_boom|horns|(?<!retro_)reflectors?|relay"
    r"|hga|mga|lga|patch",
    "propulsion": r"thrusters?|engines?|nozzles?|tanks?|chamber|draco|rcs|propulsion|propellant",
    "docking": r"docking|hatch|capture_petals|soft_capture|guide_(?:petals|ring)|berthing|^probe(?:_arms|_base)?$"
    r"|^target_(?:cross|disc)$|^grip_feet$|collar|interface_(?:deck|ring)|forward_ring",
    "sensor": r"sensors?|lens(?:es)?|(?:star_)?trackers?|cameras?|telescopes?|instruments?|periscope|meris|mipas|gomos"
    r"|aatsr|sciamachy|mwr|ra_2|navigation|windows?|panes|portholes?|prisms|retro_?reflectors?|lidar|magnetometers?"
    r"|spectrometers?|radiometers?|altimeters?|imagers?",
    "radiator": r"radiators?|(?:heat|engine)_shield|louvers?",
    "body": r"body|bus|hull|chassis|structure|frames?|shell|plates?|module|truss|box|mli|blankets?",
}

_STEMS: dict[PartClass, str] = {
    "solar_array": "solarpane|solararray|solarcell|solarwing|photovoltaic",
    "antenna": "antenna",
    "propulsion": "thruster|nozzle",
    "docking": "docking|berthing",
    "sensor": "startracker|telescope|camera|spectrometer|magnetometer",
    "radiator": "radiator",
}
"""Words recognised within longer ones, for run-together names."""

_RULES = tuple((name, re.compile(rf"(?:^|_)(?:{words})(?:_|$)")) for name, words in _WORDS.items())
_STEM_RULES = tuple((name, re.compile(stems)) for name, stems in _STEMS.items())
_WORD = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[^\W\d_A-Z]+|[A-Z]+|\d+")


def class_from_name(part: str) -> PartClass | None:
    """Return the class that a part's name implies, or None.

    Words are separated by changes of case, digits and punctuation: ``SolarPanel``, ``solar-panel.001``.
    """
    name = "_".join(_WORD.findall(part)).lower()
    matches = (c for rules in (_RULES, _STEM_RULES) for c, rule in rules if rule.search(name))
    return next(matches, None)


def part_class(part: str) -> PartClass:
    """Return the class of a part by its name.

    Returns
    -------
    str
        One of `PART_CLASSES`; ``body`` if the name implies none.
    """
    return class_from_name(part) or "body"


def target_classes(target: Target) -> tuple[PartClass, ...]:
    """Return the classes of a target's parts.

    Returns
    -------
    tuple of str
        Classes in the order of the parts: those that the target sets explicitly, else by name.
    """
    return tuple(target.part_classes.get(part.name) or part_class(part.name) for part in target.parts)


def class_report(target: Target) -> list[str]:
    """Describe the classes of a target's parts for the user.

    Returns
    -------
    list of str
        A line that lists the parts of each class and, if names imply no class, a line of these parts.
    """
    parts_by_class: dict[str, list[str]] = {}
    unclassified = []
    for part, part_class_ in zip(target.parts, target_classes(target), strict=True):
        parts_by_class.setdefault(part_class_, []).append(part.name)
        if part.name not in target.part_classes and class_from_name(part.name) is None:
            unclassified.append(part.name)
    listing = "; ".join(f"{c} {_summary(parts_by_class[c])}" for c in PART_CLASSES if c in parts_by_class)
    lines = [f"classes of parts by their names (--classes FILE sets them): {listing}"]
    if unclassified:
        lines.append(f"class unknown from the name, body assumed: {_summary(unclassified)}")
    return lines


def _summary(parts: list[str]) -> str:
    """Return the number of parts, and the names of the first."""
    return f"{len(parts)} ({', '.join(p[:60] for p in parts[:5])}{', ...' * (len(parts) > 5)})"


class PartClassFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A file that sets classes by part name or pattern (``*`` and ``?``); the last match wins."""

    schema: Literal["flyaround.part_classes"]
    version: Literal[1]
    classes: dict[str, PartClass]


def classes_from_file(document: dict[str, Any], source: str, parts: Sequence[str]) -> dict[str, PartClass]:
    """Return the classes of the parts that a file sets.

    Parameters
    ----------
    document : dict
        The parsed file.
    source : str
        Name of the file in messages.
    parts : sequence of str
        Names of the target's parts.

    Returns
    -------
    dict
        Class by the name of a part.

    Raises
    ------
    UserError
        If the file has a mistake, or names no part of the target.
    """
    try:
        file = msgspec.convert(document, PartClassFile)
    except msgspec.ValidationError as error:
        raise UserError(
            f'{source}: {error}; it has schema = "flyaround.part_classes", version = 1, and under [classes] a line '
            f'"PART" = "CLASS" for each part, CLASS one of {", ".join(PART_CLASSES)}'
        ) from error
    classes: dict[str, PartClass] = {}
    for pattern, class_name in file.classes.items():
        matching = [p for p in parts if p == pattern or fnmatchcase(p, pattern)]
        if not matching:
            near = near_names(pattern, parts, 3) or list(parts[:3])
            raise UserError(
                f"{source}: key classes.{pattern!r} is not a part; name one, such as {', '.join(near)}"
            )
        classes |= dict.fromkeys(matching, class_name)
    return classes
