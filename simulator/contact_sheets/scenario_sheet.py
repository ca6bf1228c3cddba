"""Contact sheets of scenarios and recipes: six small frames of a flight, or six samples without noise."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.camera.detector.sensor import noiseless
from flyaround.simulator.dataset.formats.native import encode_png
from flyaround.simulator.imaging.display import display_picture
from flyaround.simulator.labels.overlay import draw_axes
from flyaround.simulator.loop import FrameRequest, open_frames, run_frames, whole_frame
from flyaround.simulator.recipes.plan import RecipePlan, plan_recipe
from flyaround.simulator.recipes.poses import radius_m
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.scenario.plan import plan_flight

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    from flyaround.simulator.frame import Frame
    from flyaround.simulator.runtime.arrays import ByteArray
    from flyaround.simulator.scenario.recipe import Recipe
    from flyaround.simulator.scenario.scenario import Scenario
    from flyaround.simulator.scene.state import SceneState

# Tiles of a sheet.
COLUMNS, ROWS = 3, 2
WIDTH_PX, SAMPLE_WIDTH_PX = 480, 256  # width of a frame and of a sample

_AXIS_LENGTH = 0.6
"""Length of an arrow relative to the distance of the mesh's farthest vertex."""


def write_contact_sheets(scenarios: Iterable[Scenario], folder: Path, width_px: int = WIDTH_PX) -> None:
    """Write ``NAME.png`` of each scenario into a folder; ``width_px`` is that of one frame."""
    with Renderer() as renderer:
        for scenario in scenarios:
            sheet = contact_sheet(scenario, renderer, width_px)
            write_atomic(folder / f"{scenario.name}.png", encode_png(sheet))


def contact_sheet(scenario: Scenario, renderer: Renderer, width_px: int = WIDTH_PX) -> ByteArray:
    """Draw six frames of a scenario's flight, from start to end, row by row: (H, W, 3) RGB.

    Each is drawn by the scenario's own camera at a smaller size, with the time and the range written in.
    """
    plan = plan_flight(scenario, n=COLUMNS * ROWS, bands="rgb", quality="draft")
    plan = replace(plan, camera=plan.camera.resized(width_px))
    tiles = []
    for frame in run_frames(plan, renderer, labels=False):
        scene = frame.scene
        tile = display_picture(frame.image, scene.sensor, scene.camera.pixel_encoding)
        distance = float(np.linalg.norm(scene.t_camera_from_target_m))
        label = f"t = {scene.t_s:.0f} s   {distance:.1f} m"
        cv2.putText(tile, label, (9, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 3, cv2.LINE_AA)
        cv2.putText(tile, label, (9, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 200, 60), 1, cv2.LINE_AA)
        tiles.append(tile)
    return _grid(tiles)


def write_recipe_sheets(
    recipes: Iterable[Recipe],
    folder: Path,
    *,
    axes: bool = False,
    width_px: int = SAMPLE_WIDTH_PX,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> None:
    """Write ``NAME.png`` of each recipe into a folder; a recipe of several data sets is skipped.

    Parameters
    ----------
    recipes : iterable of Recipe
        Recipes to draw.
    folder : Path
        Output folder.
    axes : bool, optional
        True to draw the model's axes: x red, y green, z blue.
    width_px : int, optional
        Width of one sample.
    progress : callable, optional
        Called with the number done, and the total.
    """
    drawable = [r for r in recipes if not r.members]
    for n_done, recipe in enumerate(drawable):
        plan = plan_recipe(recipe, recipe.frames)
        plan = replace(plan, camera=plan.camera.resized(width_px), quality="draft")
        write_atomic(folder / f"{recipe.name}.png", encode_png(recipe_sheet(plan, axes=axes)))
        progress(n_done + 1, len(drawable))


def recipe_sheet(plan: RecipePlan, *, axes: bool = False) -> ByteArray:
    """Draw six samples of a plan, row by row: (H, W, 3) RGB. They are spread over a flight, or else the first ones."""
    n = COLUMNS * ROWS
    step = max(1, plan.n_frames // n) if plan.recipe.poses is not None else 1
    scenes = [_clean(plan.scene(min(k * step, plan.n_frames - 1))) for k in range(n)]
    with open_frames(whole_frame, first=scenes[0], target=plan.target) as producer:
        frames = producer.frames(FrameRequest(scene=scene, labels=False) for scene in scenes)
        tiles = [_tile(frame, plan, axes=axes) for frame in frames]
    return _grid(tiles)


def _clean(scene: SceneState) -> SceneState:
    """Return the scene without noise and blur, which a small image would exaggerate."""
    return replace(scene, sensor=replace(noiseless(scene.sensor), blur_sigma_px=0.0))


def _tile(frame: Frame, plan: RecipePlan, *, axes: bool) -> ByteArray:
    scene = frame.scene
    image = display_picture(frame.image, scene.sensor, scene.camera.pixel_encoding)
    tile = image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)
    if not axes:
        return tile
    return draw_axes(tile, plan.camera, frame.scene.camera_from_target, _AXIS_LENGTH * radius_m(plan.target))


def _grid(tiles: list[ByteArray]) -> ByteArray:
    """Join tiles to one image, row by row."""
    return np.vstack([np.hstack(tiles[r * COLUMNS : (r + 1) * COLUMNS]) for r in range(ROWS)])
