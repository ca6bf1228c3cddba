"""Levels of detail: how finely a builder cuts a curved body, and which small things it leaves out.

Every level of a craft has the same part of the target file that is not geometry: keypoints, wireframe, occluders,
mass, frames. Curved bodies are cut into a multiple of four facets, so that the points on their axes' sides
stay where they are.
"""

from __future__ import annotations

from typing import Literal

Detail = Literal["full", "medium", "low"]
DETAILS: tuple[Detail, ...] = ("full", "medium", "low")
COARSER: dict[Detail, int] = {"full": 1, "medium": 2, "low": 4}


def facets(detail: Detail, full: int) -> int:
    """Facets round a curved body that has ``full`` of them at full detail: half at medium, a quarter at low."""
    if detail == "full":
        return full
    return min(full, max(4, 4 * round(full / (4 * COARSER[detail]))))


def split_level(name: str) -> tuple[str, Detail]:
    """The craft and the level that a name such as ``tango@low`` asks for; no level is full detail."""
    craft, _, level = name.rpartition("@")
    for detail in DETAILS:
        if craft and level == detail:
            return craft, detail
    return name, "full"


def level_name(name: str, detail: Detail) -> str:
    """The name under which records keep a craft drawn at a level; the inverse of `split_level`."""
    return name if detail == "full" else f"{name}@{detail}"
