"""Checks of a recipe as a whole: bounds that are allowed one by one, but leave nothing to draw together."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.simulator.errors import UserError
from flyaround.simulator.recipes.file import (
    EulerAttitude,
    FacingAttitude,
    PoseList,
    Sequences,
    UniformRange,
)
from flyaround.simulator.recipes.poses import radius_m, resolved_range
from flyaround.simulator.world.ephemeris.body import body_named

if TYPE_CHECKING:
    from flyaround.simulator.recipes.file import Background, Recipe, Sky
    from flyaround.simulator.targets.model import Target


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
        low, high = sky.nadir_off_boresight_deg
        if low > high:
            raise UserError(
                f"{where}: key sky[{number}].nadir_off_boresight_deg is [{low:g}, {high:g}], allowed: the smaller first"
            )
        _check_place(where, f"sky[{number}]", sky)
    if recipe.background is not None:
        _check_place(where, "background", recipe.background)
    if isinstance(recipe.poses, Sequences):
        for key in ("range_m", "rate_deg_s"):
            low, high = getattr(recipe.poses, key)
            if low > high:
                raise UserError(
                    f"{where}: key poses.{key} is [{low:g}, {high:g}], allowed: the smaller first"
                )
    _check_poses(recipe, where)
    recipe.sensor.metering(where)


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


def check_with_target(recipe: Recipe, target: Target) -> None:
    """Refuse a range that has the camera inside the target whatever is drawn.

    Raises
    ------
    UserError
        With the range and the target's size.
    """
    if recipe.poses is not None or isinstance(recipe.attitude, FacingAttitude):
        return
    kind = resolved_range(recipe.range, target)
    if isinstance(kind, UniformRange) and kind.far_m < 0.25 * radius_m(target):
        raise UserError(
            f"recipe {recipe.name}: section [range] ends at far_m = {kind.far_m:g}, inside of {target.name}, whose "
            f"mesh reaches {radius_m(target):.3g} m from its origin; make it larger, or choose another --target"
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
