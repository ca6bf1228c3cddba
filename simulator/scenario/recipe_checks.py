"""Checks of a recipe as a whole: bounds that are allowed one by one, but leave nothing to draw together."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.recipe import EulerAttitude, PoseList
from flyaround.simulator.world.ephemeris.body import body_named

if TYPE_CHECKING:
    from flyaround.simulator.scenario.recipe import Background, Recipe, Sky


def check_recipe(recipe: Recipe, where: str) -> None:
    """Refuse bounds that are the wrong way round, and sections that contradict each other.

    Raises
    ------
    UserError
        With file, section, values and what is allowed.
    """
    _ordered(where, "range", recipe.range.near_m, recipe.range.far_m, "near_m", "far_m")
    if isinstance(recipe.attitude, EulerAttitude):
        _ordered(where, "attitude", recipe.attitude.from_deg, recipe.attitude.to_deg, "from_deg", "to_deg")
    for number, sky in enumerate(recipe.sky):
        _check_place(where, f"sky[{number}]", sky)
    if recipe.background is not None:
        _check_place(where, "background", recipe.background)
    for key in ("sky", "poses", "vary"):
        refuse_reversed(getattr(recipe, key), where, key)
    _check_poses(recipe, where)
    recipe.sensor.metering(where)


def refuse_reversed(value: object, where: str, key: str = "") -> None:
    """Refuse an interval, at any depth of a section, whose larger end stands first.

    Parameters
    ----------
    value : section, list of sections or value. key : under which it stands in the file.

    Raises
    ------
    UserError
        With the key, its values and what is allowed.
    """
    if isinstance(value, msgspec.Struct):
        for name, inner in msgspec.structs.asdict(value).items():
            refuse_reversed(inner, where, f"{key}.{name}" if key else name)
    elif isinstance(value, list):
        for number, inner in enumerate(value):
            refuse_reversed(inner, where, f"{key}[{number}]")
    elif isinstance(value, tuple) and value[0] > value[1]:
        low, high = value
        raise UserError(f"{where}: key {key} is [{low:g}, {high:g}], allowed: the smaller first")


def _check_poses(recipe: Recipe, where: str) -> None:
    """Refuse what poses of a list or of a flight leave no room for."""
    if recipe.poses is None:
        return
    c = recipe.constraints
    if c.clearance_m is not None or c.origin_in_image or c.inside is not None:
        raise UserError(
            f"{where}: section [constraints] has poses drawn again, and those of [poses] are given: remove one of them"
        )
    if not isinstance(recipe.poses, PoseList) and recipe.background is not None:
        raise UserError(
            f"{where}: section [background] is given, but a flight in [poses] has its own sky: remove one of them"
        )


def _check_place(where: str, section: str, place: Sky | Background) -> None:
    """Refuse an unknown body, and an altitude below the lowest orbit about it."""
    try:
        body = body_named(place.body)
    except UserError as error:
        raise UserError(f"{where}: key {section}.body: {error}") from error
    if place.altitude_km * 1e3 < body.lowest_m:
        raise UserError(
            f"{where}: key {section}.altitude_km is {place.altitude_km:g}, allowed above {body.title}: at least "
            f"{body.lowest_m / 1e3:g}"
        )


def _ordered(where: str, section: str, low: float, high: float, low_key: str, high_key: str) -> None:
    if low > high:
        raise UserError(
            f"{where}: section [{section}] has {low_key} {low:g} beyond {high_key} {high:g}: exchange them"
        )
