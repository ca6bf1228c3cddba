"""From a name on the command line to the frames it means: a flight sampled in time, or a recipe's samples."""

from __future__ import annotations

import msgspec

from simulator.camera.lens.files import read_camera_file
from simulator.errors import UserError
from simulator.loop import Plan, plan_flight
from simulator.scenario.load import load_scenario
from simulator.scenario.picture import environment_section
from simulator.scenario.recipes import RecipePlan, list_recipes, plan_recipe
from simulator.scene.environments import environment_preset
from simulator.scene.state import Bands, Quality


def choose_plan(
    name: str,
    *,
    n: int,
    every_s: float | None,
    seed: int | None,
    bands: Bands | None,
    quality: Quality | None,
    camera: str | None = None,
    environment: str | None = None,
) -> Plan | RecipePlan:
    """The plan of a recipe's name, else of a scenario.

    Parameters
    ----------
    camera : name or file of a camera to use instead of the plan's own. environment : name of one, likewise.

    Raises
    ------
    UserError
        If there is no such scenario or recipe, or ``every_s`` is asked of a recipe.
    """
    if name in list_recipes():
        if every_s is not None:
            raise UserError(f"recipe {name} has no time, so --every means nothing; use -n")
        layers = None if environment is None else environment_preset(environment)
        return plan_recipe(
            name, n, seed=seed, bands=bands, quality=quality, camera=camera, environment=layers
        )
    count = None if every_s is not None else n
    scenario = load_scenario(name)
    if camera is not None:
        scenario = msgspec.structs.replace(scenario, camera=read_camera_file(camera))
    if environment is not None:
        scenario = msgspec.structs.replace(scenario, environment=environment_section(environment))
    return plan_flight(scenario, n=count, every_s=every_s, seed=seed, bands=bands, quality=quality)
