"""Contact sheets: a scenario at a glance, a few small frames spread over its flight."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.dataset.formats.native import encode_png
from flyaround.simulator.loop import run_frames
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.scenario.plan import plan_flight

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.runtime.arrays import ByteArray
    from flyaround.simulator.scenario.scenario import Scenario

COLUMNS, ROWS = 3, 2
WIDTH_PX = 480


def write_contact_sheets(scenarios: Iterable[Scenario], folder: Path, width_px: int = WIDTH_PX) -> None:
    """Write ``NAME.png`` of each scenario into a folder; ``width_px`` is that of one frame."""
    with Renderer() as renderer:
        for scenario in scenarios:
            sheet = contact_sheet(scenario, renderer, width_px)
            write_atomic(folder / f"{scenario.name}.png", encode_png(sheet))


def contact_sheet(scenario: Scenario, renderer: Renderer, width_px: int = WIDTH_PX) -> ByteArray:
    """Six frames of a scenario's flight, from start to end, row by row: (H, W, 3) RGB.

    Each is drawn by the scenario's own camera at a smaller size, with the time and the range written in.
    """
    plan = plan_flight(scenario, n=COLUMNS * ROWS, bands="rgb", quality="draft")
    plan = replace(plan, camera=smaller(plan.camera, width_px))
    tiles = []
    for frame in run_frames(plan, renderer, labels=False):
        scene = frame.scene
        depth = scene.sensor.bits - 8
        tile = np.ascontiguousarray(frame.image >> depth, dtype=np.uint8)
        distance = float(np.linalg.norm(scene.t_camera_from_target_m))
        label = f"t = {scene.t_s:.0f} s   {distance:.1f} m"
        cv2.putText(tile, label, (9, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 3, cv2.LINE_AA)
        cv2.putText(tile, label, (9, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 200, 60), 1, cv2.LINE_AA)
        tiles.append(tile)
    rows = [np.hstack(tiles[r * COLUMNS : (r + 1) * COLUMNS]) for r in range(ROWS)]
    return np.vstack(rows)


def smaller(camera: Camera, width_px: int) -> Camera:
    """The same field of view on fewer pixels: ``c' = (c + 0.5) s - 0.5``."""
    s = width_px / camera.width_px
    return replace(
        camera,
        width_px=width_px,
        height_px=round(camera.height_px * s),
        fx_px=camera.fx_px * s,
        fy_px=camera.fy_px * s,
        cx_px=(camera.cx_px + 0.5) * s - 0.5,
        cy_px=(camera.cy_px + 0.5) * s - 0.5,
    )
