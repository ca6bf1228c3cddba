"""Placement pass: fits the viewport, depth range and sample lattice to the target, and writes its uniforms."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.render.craft.finishes import (
    FOIL_ROUGHNESS,
    FOIL_ROUGHNESS_HIGH,
    has_films,
    is_foil,
    mottle_of,
    wear_of,
)
from flyaround.simulator.render.craft.viewport_fit import (
    TILE_REACH_PX,
    choose_pattern,
    fit_viewport,
    homogeneous_matrix,
    outline_px,
)
from flyaround.simulator.render.craft.visible_edges import EdgeCamera
from flyaround.simulator.render.frame_graph import Pass, Resource
from flyaround.simulator.render.gl.lens_rays import lens_values
from flyaround.simulator.render.projection import clip_from_camera
from flyaround.simulator.render.view import MODEL, SCENE, VIEW
from flyaround.simulator.scene.illumination.bands import reflectance

if TYPE_CHECKING:
    from collections.abc import Mapping

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.render.craft.resident_targets import DrawnMesh, ResidentTarget, ResidentTargets
    from flyaround.simulator.render.craft.sample_pattern import SamplePattern
    from flyaround.simulator.render.craft.viewport_fit import ViewportFit
    from flyaround.simulator.render.device import Device
    from flyaround.simulator.render.frame_graph import PassResources
    from flyaround.simulator.render.projection import PixelRect
    from flyaround.simulator.render.view import View
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.illumination.bands import Bands
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Material, Target

# Roughness below which a highlight would be narrower than the Sun's disc.
MIN_ROUGHNESS = 0.03


@dataclass(frozen=True, eq=False)
class PlacedTarget:
    """State that the target's passes share: the target on the GPU, and its viewport and samples in this frame.

    Parameters
    ----------
    resident : ResidentTarget
        Target on the GPU.
    drawn_mesh : DrawnMesh
        Its mesh, cut for the lens if necessary.
    fit : ViewportFit
        Pixels to draw and depth range.
    camera : Camera
        Camera of the scene.
    lattice : SamplePattern
        Sample lattice.
    size : tuple of int
        Width and height of the samples' framebuffer [samples].
    origin : tuple of int
        Lattice counters (s, t) of the framebuffer's first sample.
    tiles_px : (K, 2) array
        Centres of the tiles that the target may touch [px].
    """

    resident: ResidentTarget
    drawn_mesh: DrawnMesh
    fit: ViewportFit
    camera: Camera
    lattice: SamplePattern
    size: tuple[int, int]
    origin: tuple[int, int]
    tiles_px: FloatArray

    @property
    def rect(self) -> PixelRect:
        """Pixels that the target may cover."""
        return self.fit.rect

    @property
    def edge_view(self) -> EdgeCamera:
        """Camera and viewport for selecting its edges."""
        fit = self.fit
        return EdgeCamera(self.camera, fit.rect, fit.near_far_m[0], fit.camera_from_target)


TARGET: Resource[PlacedTarget] = Resource("target")
TARGET_TILES: Resource[FloatArray] = Resource("target tiles")
"""Centres (K, 2) of the tiles to shade [px]."""


class PlacementPass(Pass):
    """Fits viewport, depth range and sampling to the target, and writes its uniforms."""

    name = "target.placement"
    reads = (SCENE, MODEL, VIEW)
    writes = (TARGET, TARGET_TILES)

    def __init__(self, device: Device, targets: ResidentTargets) -> None:
        self._context, self._programs, self._blocks = device.context, device.programs, device.blocks
        self._targets = targets

    def run(self, r: PassResources) -> None:
        """Place the target; both resources are missing from the frame if it touches no pixel."""
        r[TARGET] = placed = self._place(r[SCENE], r[VIEW], r[MODEL])
        r[TARGET_TILES] = None if placed is None else placed.tiles_px

    def _place(self, scene: SceneState, view: View, target: Target) -> PlacedTarget | None:
        resident = self._targets.get(target, fine=scene.quality == "high")
        resident.interreflection.begin(scene.bands)
        mesh, camera = resident.mesh, scene.camera
        fit = fit_viewport(
            mesh, homogeneous_matrix(view.R_camera_from_target, view.t_camera_from_target_m), camera
        )
        if fit is None:
            return None
        tiles = self._targets.culling.target_tiles(fit)
        if not len(tiles):
            return None
        dense = resident.textures is not None  # the edge pass does not see edges inside textures
        lattice = choose_pattern(scene.quality, fit, outline_px(fit), fit.pixel_m(camera), dense=dense)
        size, origin = lattice.window(tiles, TILE_REACH_PX)
        drawn_mesh = resident.drawn(self._context, fit.longest_m)
        placed = PlacedTarget(resident, drawn_mesh, fit, camera, lattice, size, origin, tiles)
        self._write_blocks(placed, scene.bands, worn=scene.quality == "high")
        return placed

    def _write_blocks(self, placed: PlacedTarget, bands: Bands, *, worn: bool) -> None:
        fit, size, origin = placed.fit, placed.size, placed.origin
        buffer_from_pixel = placed.lattice.buffer_from_pixel(origin)
        clip = clip_from_camera(placed.camera, *fit.near_far_m, buffer_from_pixel, size)
        if self._programs.lens:
            self._blocks.lens.write(lens_values(placed.camera))
        else:
            clip = clip @ fit.camera_from_target
        self._blocks.target.write(
            {
                "u_pattern_clip": clip,
                "u_camera_from_target": fit.camera_from_target,
                "u_pattern": [*origin, *fit.near_far_m],
                "u_pattern_px": [*size, 0, 0],
            }
        )
        self._blocks.materials.write(material_values(placed.resident.mesh.materials, bands, worn=worn))


@lru_cache(maxsize=16)
def material_values(materials: tuple[Material, ...], bands: Bands, *, worn: bool) -> Mapping[str, FloatArray]:
    """Return the members of the uniform block ``Materials``.

    The result is cached, so that `UniformBlock.write` recognises it and does not upload it again.

    Parameters
    ----------
    materials : tuple of Material
        Materials of the target; the first has index 1.
    bands : Bands
        Spectral bands of the camera.
    worn : bool
        True to add the wear of surfaces that have flown.
    """
    color, surface, grain = np.zeros((256, 4)), np.zeros((256, 4)), np.zeros((256, 4))
    for k, material in enumerate(materials, start=1):
        albedo = reflectance(bands, np.asarray(material.base_color))
        color[k, : len(albedo)] = albedo
        color[k, 3] = material.metallic
        foil = FOIL_ROUGHNESS_HIGH if worn else FOIL_ROUGHNESS
        rough = material.roughness * (foil if is_foil(material) else 1.0)
        surface[k] = [
            max(rough, MIN_ROUGHNESS),
            material.clearcoat + float(has_films(material)),
            max(material.clearcoat_roughness, MIN_ROUGHNESS),
            material.crinkle or -((worn and wear_of(material)) or mottle_of(material)),
        ]
        if material.anisotropy > 0:
            strength = material.anisotropy * (-1 if material.turned else 1)
            length = max(float(np.linalg.norm(material.grain)), 1e-9)  # a zero vector means no grain
            grain[k] = [*(np.asarray(material.grain) / length), strength]
    return MappingProxyType(
        {"u_material_color": color, "u_material_surface": surface, "u_material_grain": grain}
    )
