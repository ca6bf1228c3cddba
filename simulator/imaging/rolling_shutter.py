"""A rolling shutter: bands of rows that are rendered together, and the scene at the time when a point is imaged."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.imaging.image_motion import image_motion_px
from flyaround.simulator.scene.motion import propagated_scene

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

BAND_PX = 0.2
"""Largest motion between successive bands of rows [px]. The image differs from its labels by at most half of it."""


@dataclass(frozen=True)
class RowBand:
    """Rows ``y0 <= y < y1`` of an image, rendered at one time: ``dt_s`` after the image's mid-exposure."""

    y0: int
    y1: int
    dt_s: float


def crop(camera: Camera, x0: int, y0: int, width_px: int, height_px: int) -> Camera:
    """Return the camera of a window of the image, possibly beyond its edges.

    Returns
    -------
    Camera
        Copy with the window's size and a shifted principal point; focal lengths, lens and encoding are unchanged.
    """
    return replace(
        camera, width_px=width_px, height_px=height_px, cx_px=camera.cx_px - x0, cy_px=camera.cy_px - y0
    )


def row_bands(scene: SceneState, target: Target) -> tuple[RowBand, ...]:
    """Divide an image into bands of equal height; the last band may overlap the one before it.

    Parameters
    ----------
    scene : SceneState
        Scene at mid-exposure.
    target : Target
        Target of the scene.

    Returns
    -------
    tuple of RowBand
        Bands from the top down.
    """
    height = scene.camera.height_px
    if not scene.shutter.is_rolling:
        return (RowBand(0, height, 0.0),)
    motion = image_motion_px(scene, target, scene.shutter.readout_s)
    n = int(np.clip(np.ceil(motion / BAND_PX), 1, height))
    rows = -(-height // n)
    bands = []
    for y in range(0, height, rows):
        y0 = min(y, height - rows)
        dt = float(scene.shutter.row_time_s(y0 + (rows - 1) / 2, height))
        bands.append(RowBand(y0, y0 + rows, dt))
    return tuple(bands)


def pose_at_rows(scene: SceneState, points_target_m: FloatArray) -> tuple[SceneState, ...]:
    """Return for each point the scene at the time when the point's row is exposed.

    The row depends on the pose and the pose on the row's time, so they are found by fixed-point iteration. A point that
    is not projected to a finite row gets the scene at the image's mid-exposure, as do all points with a global shutter.

    Parameters
    ----------
    scene : SceneState
        Scene at the image's mid-exposure.
    points_target_m : (K, 3) array
        Points, target frame [m].

    Returns
    -------
    tuple of SceneState
        K scenes.
    """
    if not scene.shutter.is_rolling:
        return (scene,) * len(points_target_m)
    scenes = []
    for point in points_target_m:
        row_scene = scene
        for _ in range(8):
            row = row_scene.camera.project(row_scene.camera_from_target.apply(point[None]))[0, 1]
            if not np.isfinite(row):
                row_scene = scene
                break
            row_scene = propagated_scene(scene, float(scene.shutter.row_time_s(row, scene.camera.height_px)))
        scenes.append(row_scene)
    return tuple(scenes)
