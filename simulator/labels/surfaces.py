"""The label raster: depth, normal and part at each pixel's centre, each row of a rolling shutter at its own time."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.imaging.rolling_shutter import crop, row_bands
from flyaround.simulator.scene.motion import propagated_scene

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.simulator.render.craft.label_raster import Surfaces
    from flyaround.simulator.render.renderer import Renderer
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target


def start_surfaces(
    renderer: Renderer, scene: SceneState, target: Target, *, layers: bool
) -> Callable[[], Surfaces]:
    """Start `surfaces` asynchronously; the returned function, called once, waits for the result."""
    if len(row_bands(scene, target)) > 1:
        return partial(surfaces, renderer, scene, target, layers=layers)
    return renderer.start_surfaces(scene, target, layers=layers)


def surfaces(
    renderer: Renderer, scene: SceneState, target: Target, *, layers: bool, margin_px: int = 0
) -> Surfaces:
    """Return the surface at each pixel's centre at its row's mid-exposure, with ``margin_px`` beyond the edges.

    Returns
    -------
    Surfaces
        Arrays of H + 2 ``margin_px`` rows and W + 2 ``margin_px`` columns, camera frame; normals and parts are None
        without ``layers``.

    Raises
    ------
    RuntimeError
        If the image has no rows.
    """
    height, m = scene.camera.height_px, margin_px
    bands = row_bands(scene, target)
    joined: Surfaces | None = None
    for k in reversed(range(len(bands))):
        band = bands[k]
        # rows beyond the image are exposed with its edge
        top, bottom = band.y0 - (m if k == 0 else 0), band.y1 + (m if k == len(bands) - 1 else 0)
        camera = crop(scene.camera, -m, top, scene.camera.width_px + 2 * m, bottom - top)
        band_surfaces = renderer.surfaces(
            replace(propagated_scene(scene, band.dt_s), camera=camera), target, layers=layers
        )
        if len(bands) == 1:
            return band_surfaces
        if joined is None:
            joined = _empty_like(band_surfaces, height + 2 * m)
        rows = slice(top + m, bottom + m)
        joined.depth_m[rows] = band_surfaces.depth_m
        for joined_layer, band_layer in (
            (joined.normals, band_surfaces.normals),
            (joined.parts, band_surfaces.parts),
        ):
            if joined_layer is not None and band_layer is not None:
                joined_layer[rows] = band_layer
    if joined is None:
        raise RuntimeError("an image without rows has no labels")
    return joined


def _empty_like(band: Surfaces, height: int) -> Surfaces:
    return replace(
        band,
        depth_m=np.full((height, band.depth_m.shape[1]), np.nan, np.float32),
        normals=None if band.normals is None else np.zeros((height, *band.normals.shape[1:]), np.float16),
        parts=None if band.parts is None else np.zeros((height, band.parts.shape[1]), np.uint16),
        window=(slice(None), slice(None)),
    )
