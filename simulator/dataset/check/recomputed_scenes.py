"""Check of the records' scenes: the card's scenario or recipe is planned again, and must give them."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from flyaround.simulator.dataset.stereo import SecondCameraPlan
from flyaround.simulator.errors import UserError
from flyaround.simulator.recipes.file import Recipe
from flyaround.simulator.recipes.plan import plan_recipe, varied_plan
from flyaround.simulator.recipes.vary_file import Vary
from flyaround.simulator.scenario.flight import frame_times
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.scenario.scenario import Scenario
from flyaround.simulator.scene.second_camera import SECOND_SEED

if TYPE_CHECKING:
    from collections.abc import Mapping

    from flyaround.simulator.dataset.capture_plan import CapturePlan
    from flyaround.simulator.dataset.card import DatasetCard
    from flyaround.simulator.scene.state import SceneState

RELATIVE = 1e-7
"""Rounding of a propagated state on another machine, as a share of the vector."""
ABSOLUTE = {"_m": 1e-5, "_m_s": 1e-6}
"""The same [m, m/s], by the end of a field's name; differences of large ECI vectors carry it."""
ABSOLUTE_OF_OTHERS = 1e-9
MOST_SAMPLES = 50  # of a recipe: a constrained pose takes as long as some labels do
NOT_COMPARED = ("exposure_s", "camera", "target")
"""Fields that other checks compare, or that automatic exposure makes slow to compute."""


@dataclass(frozen=True)
class SceneCheck:
    """Wrong fields, by frame, and why scenes were not computed again, or nothing."""

    faults: tuple[tuple[int | None, str], ...] = ()
    reason: str = ""


def check_scenes(card: DatasetCard, scenes: Mapping[int, SceneState], seed: int) -> SceneCheck:
    """Plan the card's scenario or recipe again and compare the scenes of its frames with the records.

    Parameters
    ----------
    scenes : of the records, by number. seed : decides which samples of a recipe are compared.
    """
    if not scenes:
        return SceneCheck()
    if not card.is_of_this_version:
        return SceneCheck(
            reason=f"scenes were computed by another version, flyaround {card.machine.flyaround}"
        )
    try:
        plan = _plan_again(card, scenes)
        if plan is None:
            return SceneCheck(reason="scenes are of no scenario or recipe")
        numbers = sorted(scenes)
        if card.scenario["schema"] == RECIPE:
            order = np.random.default_rng([seed % 2**63, 2]).permutation(numbers)
            numbers = sorted(order[:MOST_SAMPLES].tolist())
        wrong = {k: _differences(plan.scene(k), scenes[k], card) for k in numbers}
    except (UserError, msgspec.ValidationError, KeyError, IndexError) as error:
        return SceneCheck(reason=f"the card's scenario cannot be planned here: {error}")
    wrong = {k: fields for k, fields in wrong.items() if fields}
    if len(wrong) > max(1, len(numbers) // 2):
        common = Counter(name for fields in wrong.values() for name in fields)
        names = ", ".join(name for name, _ in common.most_common())
        return SceneCheck(
            ((None, f"scenes of {len(wrong)} frames are not those of the card's scenario in {names}"),)
        )
    return SceneCheck(
        tuple(
            (k, f"the scene is not that of the card's scenario in {', '.join(fields)}")
            for k, fields in wrong.items()
        )
    )


RECIPE, SCENARIO = "flyaround.recipe", "flyaround.scenario"


def _plan_again(card: DatasetCard, scenes: Mapping[int, SceneState]) -> CapturePlan | None:
    document = dict(card.scenario)
    kind = document.get("schema")
    is_second = card.stereo is not None and card.stereo.camera == "second"
    first_seed = card.seed - (SECOND_SEED if is_second else 0)
    options: dict[str, Any] = {
        name: Counter(getattr(scene, name) for scene in scenes.values()).most_common(1)[0][0]
        for name in ("bands", "quality")
    }
    plan: Any
    if kind == RECIPE:
        recipe = msgspec.convert(document, Recipe)
        made = plan_recipe(recipe, card.n_frames, seed=first_seed, target=card.target.name, **options)
        plan = replace(made, camera=card.camera)
    elif kind == SCENARIO:
        vary = document.pop("vary", None)
        scenario = msgspec.convert(document, Scenario)
        times = tuple(_times(card, scenario, scenes))
        flown = plan_flight(scenario, times=times, seed=first_seed, **options)
        plan = replace(flown, camera=card.camera, exposures=None)
        plan = plan if vary is None else varied_plan(plan, msgspec.convert(vary, Vary))
    else:
        return None
    return SecondCameraPlan(plan, plan.second_camera) if is_second else plan


def _times(card: DatasetCard, scenario: Scenario, scenes: Mapping[int, SceneState]) -> list[float]:
    """Return the times of the frames: those of the command line, unless the records follow other ones."""
    usual = frame_times(scenario.duration_s, card.n_frames, card.every_s).tolist()
    agreeing = sum(math.isclose(scene.t_s, usual[k], abs_tol=1e-9) for k, scene in scenes.items())
    if card.every_s is not None or 2 * agreeing > len(scenes):
        return list(usual)
    return [scenes[k].t_s if k in scenes else 0.0 for k in range(card.n_frames)]


def _differences(expected: SceneState, found: SceneState, card: DatasetCard) -> list[str]:
    """Return the names of the fields in which two scenes differ by more than rounding."""
    left_out = set(NOT_COMPARED)
    if card.scenario["schema"] == RECIPE:
        left_out.add("environment")  # --environment of a recipe is not in its document
    a, b = (msgspec.to_builtins(scene) for scene in (expected, found))
    return [
        name
        for name in sorted(a.keys() | b.keys())
        if name not in left_out and not _is_near(name, a.get(name), b.get(name))
    ]


def _is_near(name: str, a: Any, b: Any) -> bool:  # noqa: ANN401 - any field of a scene
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(_is_near(key, a[key], b[key]) for key in a)
    if not _is_numbers(a) or not _is_numbers(b):
        return bool(a == b)
    x, y = np.atleast_1d(np.asarray(a, float)), np.atleast_1d(np.asarray(b, float))
    if x.shape != y.shape:
        return False
    if name.startswith("q_") and x @ y < 0:
        y = -y
    most = next((value for end, value in ABSOLUTE.items() if name.endswith(end)), ABSOLUTE_OF_OTHERS)
    return bool(np.linalg.norm(x - y) <= most + RELATIVE * np.linalg.norm(x))


def _is_numbers(value: Any) -> bool:  # noqa: ANN401 - the same
    rows = value if isinstance(value, list | tuple) else [value]
    return bool(rows) and all(isinstance(v, int | float) and not isinstance(v, bool) for v in rows)
