"""Scenarios for the commands that fly one: a recipe's name is not one, and they say what takes it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from simulator.errors import UserError
from simulator.scenario.load import load_scenario

if TYPE_CHECKING:
    from simulator.scenario.scenario import Scenario


def load_flown(name: str, command: str) -> Scenario:
    """The scenario called ``name``, or of a file, for a command that has no use for a recipe.

    Raises
    ------
    UserError
        If there is none; of a recipe's name the sentence says what a recipe is for.
    """
    try:
        return load_scenario(name)
    except UserError:
        from simulator.scenario.recipes import list_recipes  # noqa: PLC0415 - slow to import, and hardly ever asked for

        if name not in list_recipes():
            raise
        raise UserError(
            f"{name} is a recipe of independent samples, and {command} takes a scenario:"
            f" `flyaround capture {name} -o DIR` takes recipes, `flyaround scenarios` lists scenarios"
        ) from None
