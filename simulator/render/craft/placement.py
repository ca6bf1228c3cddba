"""Placement pass: the target's place in the image and its sampling density. Reads the mesh; writes uniforms."""

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
    matrix_of,
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


@dataclass(frozen=True, eq=False)
class PlacedTarget:
    """A target on the GPU and in the image: state that its passes share.

    Parameters
    ----------
    size : tuple of int
        Size of the samples' framebuffer.
    origin : tuple of int
        Origin of its lattice counters.
    tiles_px : (K, 2) array
        Centres of the tiles that the target may touch.
    """

    loaded: ResidentTarget
    drawn: DrawnMesh
    place: ViewportFit
    camera: Camera
    lattice: SamplePattern
    size: tuple[int, int]
    origin: tuple[int, int]
    tiles_px: FloatArray

    @property
    def rect(self) -> PixelRect:
        """Pixels that the target may cover."""
        return self.place.rect

    @property
    def edge_view(self) -> EdgeCamera:
        """Camera and viewport for its edges."""
        place = self.place
        return EdgeCamera(self.camera, place.rect, place.near_far_m[0], place.camera_from_target)


TARGET: Resource[PlacedTarget] = Resource("target")
TARGET_TILES: Resource[FloatArray] = Resource("target tiles")
"""Centres (K, 2) of the tiles to be shaded pixel by pixel."""


class PlacementPass(Pass):
    """Fits viewport, depth range and sampling to the target, and writes its uniforms."""

    name = "target.placement"
    reads = (SCENE, MODEL, VIEW)
    writes = (TARGET, TARGET_TILES)

    def __init__(self, device: Device, targets: ResidentTargets) -> None:
        self._context, self._programs, self._blocks = device.context, device.programs, device.blocks
        self._targets = targets

    def run(self, r: PassResources) -> None:
        """Place the target; the resource is missing if the target touches no pixel."""
        r[TARGET] = placed = self._place(r[SCENE], r[VIEW], r[MODEL])
        r[TARGET_TILES] = None if placed is None else placed.tiles_px

    def _place(self, scene: SceneState, view: View, target: Target) -> PlacedTarget | None:
        loaded = self._targets.get(target, fine=scene.quality == "high")
        loaded.interreflection.begin(scene.bands)
        mesh, camera = loaded.mesh, scene.camera
        place = fit_viewport(mesh, matrix_of(view.R_camera_from_target, view.t_camera_from_target_m), camera)
        if place is None:
            return None
        tiles = self._targets.culling.target_tiles(place)
        if not len(tiles):
            return None
        dense = loaded.textures is not None  # edges inside textures are not weighted
        lattice = choose_pattern(scene.quality, place, outline_px(place), place.pixel_m(camera), dense=dense)
        size, origin = lattice.window(tiles, TILE_REACH_PX)
        drawn = loaded.drawn(self._context, place.longest_m)
        placed = PlacedTarget(loaded, drawn, place, camera, lattice, size, origin, tiles)
        self._write_blocks(placed, scene.bands, worn=scene.quality == "high")
        return placed

    def _write_blocks(self, placed: PlacedTarget, bands: Bands, *, worn: bool) -> None:
        place, size, origin = placed.place, placed.size, placed.origin
        to_buffer = placed.lattice.buffer_from_pixel(origin)
        clip = clip_from_camera(placed.camera, *place.near_far_m, to_buffer, size)
        if self._programs.lens:
            self._blocks.lens.write(lens_values(placed.camera))
        else:
            clip = clip @ place.camera_from_target
        self._blocks.target.write(
            {
                "u_pattern_clip": clip,
                "u_camera_from_target": place.camera_from_target,
                "u_pattern": [*origin, *place.near_far_m],
                "u_pattern_px": [*size, 0, 0],
            }
        )
        self._blocks.materials.write(material_values(placed.loaded.mesh.materials, bands, worn=worn))


@lru_cache(maxsize=16)
def material_values(materials: tuple[Material, ...], bands: Bands, *, worn: bool) -> Mapping[str, FloatArray]:
    """Return the members of the block ``Materials``, cached, so that the same object is not uploaded again.

    Parameters
    ----------
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
            max(rough, 0.03),  # below this a highlight would be narrower than the Sun's disc
            material.clearcoat + float(has_films(material)),
            max(material.clearcoat_roughness, 0.03),
            material.crinkle or -((worn and wear_of(material)) or mottle_of(material)),
        ]
        if material.anisotropy > 0:
            strength = material.anisotropy * (-1 if material.turned else 1)
            length = max(float(np.linalg.norm(material.grain)), 1e-9)  # a zero vector means no grain
            grain[k] = [*(np.asarray(material.grain) / length), strength]
    return MappingProxyType(
        {"u_material_color": color, "u_material_surface": surface, "u_material_grain": grain}
    )
