"""Named environments: what is drawn behind the target, as scenarios and commands call it."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, get_args

from simulator.errors import UserError
from simulator.scene.state import Environment

EnvironmentName = Literal["full", "thesis", "undifferentiated", "airless", "space"]
_FULL = Environment()
NOTHING = Environment(
    earth=False,
    clouds=False,
    ocean_glint=False,
    night_lights=False,
    atmosphere=False,
    stars=False,
    sun=False,
    earthshine=False,
    moon=False,
    planets=False,
    sea_ice=False,
)
"""No body, no light but the Sun's: a base for `dataclasses.replace`."""
ENVIRONMENTS: dict[EnvironmentName, Environment] = {
    "full": _FULL,
    # the air of the SVD thesis ends at 25 km
    "thesis": replace(_FULL, atmosphere_thickness_km=25.0),
    # its counter-example: one optics for land, sea and clouds
    "undifferentiated": replace(_FULL, undifferentiated=True),
    "airless": replace(_FULL, atmosphere=False),
    # black space, and no light from the Earth on the target
    "space": replace(_FULL, earth=False, earthshine=False, moon=False),
}


def environment_preset(name: str) -> Environment:
    """The environment called ``name``.

    Raises
    ------
    UserError
        If there is none of that name.
    """
    for known, environment in ENVIRONMENTS.items():
        if known == name:
            return environment
    raise UserError(
        f"unknown environment '{name}'; choose from {', '.join(get_args(EnvironmentName))}, "
        "or set its layers in a scenario's [environment]"
    )
