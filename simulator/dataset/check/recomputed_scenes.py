"""Check of the recorded scenes against scenes recomputed from the scenario or recipe in the card."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
from msgspec import UNSET

from flyaround.simulator.dataset.stereo import SecondCameraPlan
from flyaround.simulator.errors import UserError
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.scenario.checks import check_document
from flyaround.simulator.scenario.flight import frame_times
from flyaround.simulator.scenario.plan import plan_flight, varied_plan
from flyaround.simulator.scenario.recipe import Recipe
from flyaround.simulator.scenario.scenario import Scenario
from flyaround.simulator.scenario.vary import Vary
from flyaround.simulator.scene.record import SceneRecord
from flyaround.simulator.scene.second_camera import SECOND_SEED
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.time.instant import Instant

if TYPE_CHECKING:
    from collections.abc import Container, Mapping

    from flyaround.simulator.dataset.card import DatasetCard
    from flyaround.simulator.scenario.plan import DocumentPlan
    from flyaround.simulator.scene.environments import Environment
    from flyaround.simulator.scene.state import SceneState

RELATIVE = 1e-7
"""Relative tolerance of a propagated state on another machine."""

ABSOLUTE = {"_m": 1e-5, "_m_s": 1e-6}
"""Absolute tolerance by unit suffix [m, m/s], for differences of large ECI vectors."""

DEFAULT_ABSOLUTE = 1e-9  # tolerance of all other numbers
MAX_SAMPLES = 50  # per recipe: a constrained pose takes as long as the labels of a frame

EXCLUDED_FIELDS = ("camera", "target")
"""Fields that other checks cover."""


@dataclass(frozen=True)
class SceneCheck:
    """Result of the check: faults, each with its frame number (None for all), and reasons for skipped comparisons."""

    faults: tuple[tuple[int | None, str], ...] = ()
    not_checked: tuple[str, ...] = ()


def check_scenes(card: DatasetCard, scenes: Mapping[int, SceneState], seed: int) -> SceneCheck:
    """Plan the card's scenario or recipe again and compare the scenes of its frames with the records.

    Parameters
    ----------
    card : DatasetCard
        Card of the data set.
    scenes : mapping
        Recorded scenes by number.
    seed : int
        Seed for the random choice of `MAX_SAMPLES` frames of a recipe.
    """
    if not scenes:
        return SceneCheck()
    if not card.is_of_this_version:
        reason = f"scenes were computed by another version, flyaround {card.machine.flyaround}"
        return SceneCheck(not_checked=(reason,))
    numbers = sorted(scenes)
    try:
        document = _read_document(card)
    except (UserError, ValueError) as error:  # msgspec's errors are ValueErrors
        return SceneCheck(((None, f"the card's scenario is not valid: {error}"),))
    if isinstance(document, Recipe):
        order = np.random.default_rng([seed % 2**63, 2]).permutation(numbers)
        numbers = sorted(order[:MAX_SAMPLES].tolist())
    try:
        if load_target(document.target).name != card.target.name:
            return SceneCheck(
                ((None, f"the scenario's target is {document.target}, not {card.target.name}"),)
            )
        reasons, differing = _wrong_fields(card, document, scenes, numbers)
    except (UserError, KeyError, IndexError, ValueError) as error:
        return SceneCheck(not_checked=(f"the card's scenario cannot be planned here: {error}",))
    if len(differing) > max(1, len(numbers) // 2):
        common = Counter(name for fields in differing.values() for name in fields)
        names = ", ".join(name for name, _ in common.most_common())
        return SceneCheck(
            ((None, f"scenes of {len(differing)} frames are not those of the card's scenario in {names}"),),
            tuple(reasons),
        )
    return SceneCheck(
        tuple(
            (k, f"the scene is not that of the card's scenario in {', '.join(fields)}")
            for k, fields in differing.items()
        ),
        tuple(reasons),
    )


def _read_document(card: DatasetCard) -> Recipe | Scenario:
    """Return the recipe or scenario in the card.

    Raises
    ------
    ValueError
        If it is neither, or a field is wrong.
    UserError
        If it is physically impossible.
    """
    kind = card.scenario.get("schema")
    if kind == "flyaround.recipe":
        recipe = msgspec.convert(card.scenario, Recipe)
        check_document(recipe, "it")
        return recipe
    if kind != "flyaround.scenario":
        raise ValueError(f"it is neither a scenario nor a recipe but {kind!r}")
    document = {key: value for key, value in card.scenario.items() if key != "vary"}
    scenario = msgspec.convert(document, Scenario)
    Instant.from_utc(scenario.epoch_utc)
    check_document(scenario, "it")
    return scenario


def _wrong_fields(
    card: DatasetCard, document: Recipe | Scenario, scenes: Mapping[int, SceneState], numbers: list[int]
) -> tuple[list[str], dict[int, list[str]]]:
    """Return the skipped comparisons, and the names of each frame's wrong fields."""
    excluded = set(EXCLUDED_FIELDS)
    if document.sensor.auto_exposure is not None:
        excluded.add("exposure_s")  # slow to compute

    def differences(environment: Environment | None) -> dict[int, list[str]]:
        plan = _plan_again(card, document, scenes, environment)
        differing = {k: _differences(plan.scene(k), scenes[k], excluded) for k in numbers}
        return {k: fields for k, fields in differing.items() if fields}

    def is_other_environment(differing: dict[int, list[str]]) -> bool:
        return 2 * sum("environment" in fields for fields in differing.values()) > len(numbers)

    reasons = []
    if isinstance(document, Scenario):
        camera = document.camera_in(_most_common(scenes, "bands"))
        if card.camera not in (camera, replace(camera, encoding=UNSET)):  # older sets have linear colour
            reasons.append("the camera is not the scenario's")
        if not _has_default_times(card, document, scenes):
            reasons.append("the frames' times are not those that the scenario's duration gives")
    differing = differences(None)
    if isinstance(document, Recipe) and is_other_environment(differing):
        reasons.append("the environment is not the recipe's, as --environment replaces it")
        differing = differences(_most_common(scenes, "environment"))
        if is_other_environment(differing):
            excluded.add("environment")
            differing = differences(None)
    return reasons, differing


def _plan_again(
    card: DatasetCard,
    document: Recipe | Scenario,
    scenes: Mapping[int, SceneState],
    environment: Environment | None,
) -> DocumentPlan:
    is_second = card.stereo is not None and card.stereo.camera == "second"
    first_seed = card.seed - (SECOND_SEED if is_second else 0)
    options: dict[str, Any] = {name: _most_common(scenes, name) for name in ("bands", "quality")}
    plan: Any
    if isinstance(document, Recipe):
        target = card.target.name
        recipe_plan = plan_recipe(
            document, card.n_frames, seed=first_seed, target=target, environment=environment, **options
        )
        plan = replace(recipe_plan, camera=card.camera)
    else:
        times = tuple(_times(card, document, scenes))
        flight_plan = plan_flight(document, times=times, seed=first_seed, **options)
        plan = replace(flight_plan, camera=card.camera, exposures=None)
        vary = card.scenario.get("vary")
        plan = plan if vary is None else varied_plan(plan, msgspec.convert(vary, Vary))
    return SecondCameraPlan.from_plan(plan, plan.second_camera) if is_second else plan


def _most_common(scenes: Mapping[int, SceneState], name: str) -> Any:  # noqa: ANN401 - the type of the field
    """Return the most frequent value of a field over the scenes."""
    return Counter(getattr(scene, name) for scene in scenes.values()).most_common(1)[0][0]


def _has_default_times(card: DatasetCard, scenario: Scenario, scenes: Mapping[int, SceneState]) -> bool:
    """Return True if most frames are at the times that the command line would choose."""
    default_times = frame_times(scenario.duration_s, card.n_frames, card.every_s).tolist()
    agreeing = sum(math.isclose(scene.t_s, default_times[k], abs_tol=1e-9) for k, scene in scenes.items())
    return card.every_s is not None or 2 * agreeing > len(scenes)


def _times(card: DatasetCard, scenario: Scenario, scenes: Mapping[int, SceneState]) -> list[float]:
    """Return the times of the frames: those of the command line, unless the records follow others."""
    if _has_default_times(card, scenario, scenes):
        return list(frame_times(scenario.duration_s, card.n_frames, card.every_s).tolist())
    return [scenes[k].t_s if k in scenes else 0.0 for k in range(card.n_frames)]


def _differences(expected: SceneState, recorded: SceneState, excluded: Container[str]) -> list[str]:
    """Return the names of the fields in which two scenes differ by more than rounding."""
    a, b = (msgspec.to_builtins(SceneRecord.from_scene(scene)) for scene in (expected, recorded))
    return [
        name
        for name in sorted(a.keys() | b.keys())
        if name not in excluded and not _is_near(name, a.get(name), b.get(name))
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
    tolerance = next((value for end, value in ABSOLUTE.items() if name.endswith(end)), DEFAULT_ABSOLUTE)
    return bool(np.linalg.norm(x - y) <= tolerance + RELATIVE * np.linalg.norm(x))


def _is_numbers(value: Any) -> bool:  # noqa: ANN401 - the same
    rows = value if isinstance(value, list | tuple) else [value]
    return bool(rows) and all(isinstance(v, int | float) and not isinstance(v, bool) for v in rows)
