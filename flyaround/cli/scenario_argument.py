"""Loading of scenarios for commands that fly one; recipes are refused with advice."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.load import is_recipe, list_scenarios, load_scenario

if TYPE_CHECKING:
    from flyaround.simulator.scenario.scenario import Scenario


def load_flyable(name: str, command: str) -> Scenario:
    """Return the scenario of that name or file, for a command that does not accept recipes.

    Raises
    ------
    UserError
        If there is no such scenario; for a recipe the message explains its use.
    """
    try:
        return load_scenario(name)
    except UserError:
        refuse_recipe(
            name,
            command,
            f"`flyaround capture {name} -o DIR` takes recipes, `flyaround scenarios` lists scenarios",
        )
        raise


def refuse_recipe(name: str, command: str, advice: str) -> None:
    """Raise if ``name`` is a recipe.

    Parameters
    ----------
    name : str
        Name or file that the user gave.
    command : str
        Command that takes a scenario, as typed: ``hil host``.
    advice : str
        Advice that ends the message.

    Raises
    ------
    UserError
        If ``name`` is a recipe; the message ends with ``advice``.
    """
    if name not in list_scenarios() and is_recipe(name):
        raise UserError(
            f"{name} is a recipe of independent samples, and {command} takes a scenario: {advice}"
        )
