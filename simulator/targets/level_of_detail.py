"""Levels of detail of a craft, and their names.

Every level of a craft has the same part of the target file that is not geometry: keypoints, wireframe, occluders,
mass, frames.
"""

from __future__ import annotations

from typing import Literal

Detail = Literal["full", "medium", "low"]
DETAILS: tuple[Detail, ...] = ("full", "medium", "low")


def split_level(name: str) -> tuple[str, Detail]:
    """Return the craft and the level of a name such as ``tango@low``; without a level, full detail."""
    craft, _, level = name.rpartition("@")
    for detail in DETAILS:
        if craft and level == detail:
            return craft, detail
    return name, "full"


def level_name(name: str, detail: Detail) -> str:
    """Return the name of a craft at a level; the inverse of `split_level`."""
    return name if detail == "full" else f"{name}@{detail}"
