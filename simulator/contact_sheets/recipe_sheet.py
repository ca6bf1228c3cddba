"""Contact sheets of recipes: six of the samples that one draws, without noise, with the model's axes if wanted."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.camera.detector.sensor import noiseless
from flyaround.simulator.contact_sheets.scenario_sheet import COLUMNS, ROWS, smaller
from flyaround.simulator.dataset.formats.native import encode_png
from flyaround.simulator.labels.overlay import draw_axes
from flyaround.simulator.loop import FrameRequest, open_frames, whole_frame
from flyaround.simulator.recipes.plan import RecipePlan, plan_recipe
from flyaround.simulator.recipes.poses import radius_m
from flyaround.simulator.runtime.files import write_atomic

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    from flyaround.simulator.frame import Frame
    from flyaround.simulator.runtime.arrays import ByteArray
    from flyaround.simulator.scenario.recipe import Recipe
    from flyaround.simulator.scene.state import SceneState

WIDTH_PX = 256
_AXIS = 0.6
"""Length of an arrow over the distance of the mesh's farthest vertex."""


def write_recipe_sheets(
    recipes: Iterable[Recipe],
    folder: Path,
    *,
    axes: bool = False,
    width_px: int = WIDTH_PX,
    progress: Callable[[int, int], None] = lambda _done, _of: None,
) -> None:
    """Write ``NAME.png`` of each recipe into a folder; of one that is several data sets nothing.

    Parameters
    ----------
    axes : draw the model's: x red, y green, z blue. width_px : of one sample.
    """
    chosen = [r for r in recipes if not r.members]
    for done, recipe in enumerate(chosen):
        plan = plan_recipe(recipe, recipe.frames)
        plan = replace(plan, camera=smaller(plan.camera, width_px), quality="draft")
        write_atomic(folder / f"{recipe.name}.png", encode_png(recipe_sheet(plan, axes=axes)))
        progress(done + 1, len(chosen))


def recipe_sheet(plan: RecipePlan, *, axes: bool = False) -> ByteArray:
    """Six samples of a plan, row by row: (H, W, 3) RGB. Of flights they are spread over all frames, else the first."""
    n = COLUMNS * ROWS
    step = max(1, plan.n_frames // n) if plan.recipe.poses is not None else 1
    scenes = [_clean(plan.scene(min(k * step, plan.n_frames - 1))) for k in range(n)]
    with open_frames(whole_frame, first=scenes[0], target=plan.target) as producer:
        frames = producer.frames(FrameRequest(scene=scene, labels=False) for scene in scenes)
        tiles = [_tile(frame, plan, axes=axes) for frame in frames]
    return np.vstack([np.hstack(tiles[r * COLUMNS : (r + 1) * COLUMNS]) for r in range(ROWS)])


def _clean(scene: SceneState) -> SceneState:
    """The scene without noise and blur, which a small picture would show as more than they are."""
    return replace(scene, sensor=replace(noiseless(scene.sensor), blur_sigma_px=0.0))


def _tile(frame: Frame, plan: RecipePlan, *, axes: bool) -> ByteArray:
    image = np.asarray(frame.image >> (frame.scene.sensor.bits - 8), np.uint8)
    tile = image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)
    if not axes:
        return tile
    return draw_axes(tile, plan.camera, frame.scene.camera_from_target, _AXIS * radius_m(plan.target))
