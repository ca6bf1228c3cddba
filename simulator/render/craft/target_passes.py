"""The spacecraft: fits region, depth range and sampling to the target and runs its passes in order."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.baking.charts import TEXEL
from flyaround.simulator.baking.radiance_transfer import PATCH
from flyaround.simulator.render.craft.edge_pass import EdgeBuffers, EdgePass
from flyaround.simulator.render.craft.gbuffer_pass import GBufferPass, TexturedGBufferPass
from flyaround.simulator.render.craft.interreflection import Interreflection
from flyaround.simulator.render.craft.label_pass import LabelPass, Surfaces
from flyaround.simulator.render.craft.light_maps import LightMaps
from flyaround.simulator.render.craft.mesh import upload
from flyaround.simulator.render.craft.mesh_array import WholeMesh
from flyaround.simulator.render.craft.resident_targets import DrawnMesh, ResidentTarget, ResidentTargets
from flyaround.simulator.render.craft.self_shadow import SelfShadow
from flyaround.simulator.render.craft.shade_pass import ShadePass
from flyaround.simulator.render.craft.textures import Textures
from flyaround.simulator.render.craft.viewport_fit import (
    TILE_REACH_PX,
    choose_pattern,
    fit_viewport,
    outline_px,
)
from flyaround.simulator.render.craft.visible_edges import EdgeCamera, VisibleEdges
from flyaround.simulator.render.gl.lens_rays import lens_values
from flyaround.simulator.render.projection import clip_from_camera
from flyaround.simulator.scene.illumination.bands import bands_of, reflectance

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import moderngl
    from numpy.typing import ArrayLike

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.render.craft.mesh import GpuMesh
    from flyaround.simulator.render.craft.mesh_array import Culling
    from flyaround.simulator.render.craft.sample_pattern import SamplePattern
    from flyaround.simulator.render.craft.shadow_pass import ShadowChoice
    from flyaround.simulator.render.craft.viewport_fit import ViewportFit
    from flyaround.simulator.render.frame_images import FrameImages
    from flyaround.simulator.render.gl.programs import ProgramLibrary
    from flyaround.simulator.render.gl.shared_blocks import UniformBlocks
    from flyaround.simulator.render.projection import PixelRect
    from flyaround.simulator.render.view import View
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.illumination.bands import Bands
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Material, Target

# between nodes of baked light in the preset `high`, of the target's radius; and nodes along a patch that returns light
FINE_TEXEL, FINE_PATCH = 0.012, 2


@dataclass(frozen=True, eq=False)
class PlacedTarget:
    """A target on the GPU and in the image: what its passes have in common.

    Parameters
    ----------
    size, origin : of the samples' framebuffer and of its counters. tiles_px : (K, 2) centres of the tiles that the
        target may touch.
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
        """Where its edges are looked at from."""
        place = self.place
        return EdgeCamera(self.camera, place.rect, place.near_far_m[0], place.camera_from_target)


@dataclass(frozen=True, eq=False)
class TargetSamples:
    """What the samples see, by the names of the shading's samplers; ``stamp`` tells this frame's from older ones."""

    textures: dict[str, moderngl.Texture]
    stamp: int


@dataclass(frozen=True, eq=False)
class TargetShadow:
    """The target as the Sun sees it: the map, and how the shading reads it.

    Parameters
    ----------
    lights : maps of area lights. light_points : patches of each of them; 0 where none is.
    """

    map: moderngl.Texture
    choice: ShadowChoice
    lights: moderngl.Texture | None = None
    light_points: int = 0


class TargetPasses:
    """Shadow, geometry, shading and labels of the spacecraft; meshes are kept by the target's SHA-256.

    The preset `high` has its own, with nodes of baked light closer together. Labels are drawn from the other.

    A driver collects commands until the next framebuffer's first one comes, or until it is told to begin. So each of
    `draw_samples`, `draw_shadow` and `draw_edges` should be handed over at once: a software driver's threads draw one
    while the next is being prepared. The samples come first, which take longest.

    Parameters
    ----------
    culling : which triangles and tiles are drawn.
    """

    def __init__(
        self, context: moderngl.Context, programs: ProgramLibrary, blocks: UniformBlocks, culling: Culling
    ) -> None:
        self._context, self._programs, self._blocks, self._culling = context, programs, blocks, culling
        self._shadow = SelfShadow(context, programs, blocks)
        self._light_maps = LightMaps(context, programs, blocks)
        self._gbuffer = GBufferPass(context, programs)
        self._textured: TexturedGBufferPass | None = None  # made with the first mesh that has textures
        self._edges = EdgePass(context, programs)
        self._shade = ShadePass(context, programs)
        self._labels = LabelPass(context, programs, blocks)
        self._loaded = ResidentTargets(self._upload)

    def _upload(self, target: Target, fine: bool) -> ResidentTarget:  # noqa: FBT001 - called by what keeps them
        context = self._context
        mesh = upload(context, target, FINE_TEXEL if fine else TEXEL)
        textures = None
        if mesh.uv is not None:
            self._textured = self._textured or TexturedGBufferPass(context, self._programs)
            textures = Textures(context, target)
        gbuffer = self._gbuffer if mesh.uv is None or self._textured is None else self._textured
        # textures are bound by stretches of the index buffer
        geometry_array = self._culling.mesh_array if mesh.uv is None else WholeMesh

        def draw(some: GpuMesh, seen: VisibleEdges) -> DrawnMesh:
            return DrawnMesh(
                some,
                geometry_array(context, some, gbuffer.program(some).gl),
                EdgeBuffers(context, seen),
                lambda mesh: self._labels.arrays(target, mesh),
            )

        return ResidentTarget(
            mesh,
            VisibleEdges(mesh.edges, mesh),
            self._culling.mesh_array(context, mesh, self._shadow.program),
            Interreflection(context, mesh, FINE_PATCH if fine else PATCH),
            draw,
            textures,
        )

    def place(self, scene: SceneState, view: View, target: Target) -> PlacedTarget | None:
        """Fit viewport, depth range and samples to the target; `None` where it touches no pixel."""
        loaded = self._loaded.get(target, fine=scene.quality == "high")
        loaded.interreflection.begin(scene.bands)
        mesh, camera = loaded.mesh, scene.camera
        place = fit_viewport(mesh, _matrix(view.R_camera_from_target, view.t_camera_from_target_m), camera)
        if place is None:
            return None
        tiles = self._culling.target_tiles(place)
        if not len(tiles):
            return None
        dense = loaded.textures is not None  # edges inside them are not weighted
        lattice = choose_pattern(scene.quality, place, outline_px(place), place.pixel_m(camera), dense=dense)
        size, origin = lattice.window(tiles, TILE_REACH_PX)
        drawn = loaded.drawn(self._context, place.longest_m)
        placed = PlacedTarget(loaded, drawn, place, camera, lattice, size, origin, tiles)
        self._write_blocks(placed, scene.bands)
        return placed

    def _write_blocks(self, placed: PlacedTarget, bands: Bands) -> None:
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
        self._blocks.materials.write(material_values(placed.loaded.mesh.materials, bands))

    def draw_samples(self, scene: SceneState, placed: PlacedTarget) -> TargetSamples:
        """Draw what the samples of the target's pixels see."""
        loaded, drawn, place, size = placed.loaded, placed.drawn, placed.place, placed.size
        texels: dict[str, moderngl.Texture] = {}
        if self._textured is None or loaded.textures is None:
            camera_m = place.camera_target_m
            samples = self._gbuffer.run(drawn.mesh, drawn.gbuffer, size, camera_m, cut=place.is_cut)
        else:
            samples = self._textured.run_textured(
                drawn.gbuffer.array, size, drawn.mesh, loaded.textures, scene.bands, cut=place.is_cut
            )
            texels = dict(zip(self._shade.TEXTURED, samples.texels, strict=True))
        return TargetSamples(
            {"t_surface": samples.surface, "t_depth": samples.depth, **texels}, samples.stamp
        )

    def draw_shadow(self, scene: SceneState, view: View, placed: PlacedTarget) -> TargetShadow:
        """Draw the target as the Sun sees it, and as area lights do."""
        sun = self._shadow.draw(scene, view, placed.loaded, placed.place)
        if not scene.area_lights:
            return TargetShadow(*sun)
        return TargetShadow(*sun, *self._light_maps.draw(scene, placed.loaded, placed.place))

    def draw_edges(self, scene: SceneState, placed: PlacedTarget) -> moderngl.Texture:
        """Draw the slopes of the samples' weights, by which edges share out their pixels."""
        edges = self._edges.begin(placed.drawn.edges, placed.edge_view, exact=scene.quality == "high")
        return self._edges.run(edges, placed.lattice)

    def shade(
        self,
        scene: SceneState,
        placed: PlacedTarget,
        tiles_px: FloatArray,
        samples: TargetSamples,
        shadow: TargetShadow,
        textures: Mapping[str, moderngl.Texture],
        images: FrameImages,
        *,
        one_tile: bool = False,
    ) -> None:
        """Draw radiance and coverage into ``images``.

        Parameters
        ----------
        tiles_px : (K, 2) centres of the tiles to shade, pixel by pixel.
        textures : slopes and light, by the names of the shading's samplers.
        one_tile : draw the first alone, while other threads go on: a software driver compiles the program then.
        """
        mesh, exact, bands = placed.loaded.mesh, scene.quality == "high", len(bands_of(scene.bands))
        program = self._shade.program(
            placed.lattice,
            bands,
            mesh,
            shadow.choice.window,
            scene.lamp,
            exact=exact,
            light_points=shadow.light_points,
        )
        lights = {} if shadow.lights is None else {"t_light_depth": shadow.lights}
        program.set("u_stamp", samples.stamp)
        images.mark_covered(placed.rect)
        self._shade.run(
            images.target_framebuffer,
            placed.rect,
            tiles_px,
            program,
            {**samples.textures, "t_shadow": shadow.map, **lights, **textures},
            one_tile=one_tile,
        )

    def start_surfaces(self, scene: SceneState, target: Target, *, layers: bool) -> Callable[[], Surfaces]:
        """Have the driver draw what lies at each pixel's centre; the result waits for it, to be called once."""
        loaded, camera = self._loaded.get(target), scene.camera
        place = fit_viewport(loaded.mesh, _matrix_of(scene), camera)
        pending = None
        if place is not None:
            arrays = loaded.drawn(self._context, place.longest_m).labels
            pending = self._labels.begin(
                arrays, camera, place.rect, place.camera_from_target, place.near_far_m, layers=layers
            )

        def whole_image() -> Surfaces:
            shape = (camera.height_px, camera.width_px)
            depth = np.full(shape, np.nan, np.float32)
            normals = np.zeros((*shape, 3), np.float16) if layers else None
            parts = np.zeros(shape, np.uint16) if layers else None
            window = (slice(0, 0), slice(0, 0))
            if place is not None and pending is not None:
                rect, seen = place.rect, pending.read()
                window = (slice(rect.y0, rect.y1), slice(rect.x0, rect.x1))
                depth[window] = seen.depth_m
                if normals is not None and seen.normals is not None:
                    for k in range(3):  # numpy copies three at a time five times more slowly
                        normals[window][..., k] = seen.normals[..., k]
                if parts is not None and seen.parts is not None:
                    parts[window] = seen.parts
            return Surfaces(depth, normals, parts, window)

        return whole_image

    def silhouette_inside(self, scene: SceneState, target: Target) -> float:
        """Share of the whole silhouette that falls on the image; 0 where nothing is before the camera."""
        loaded, camera = self._loaded.get(target), scene.camera
        place = fit_viewport(loaded.mesh, _matrix_of(scene), camera, clip=False)
        if place is None:
            return 0.0
        arrays = loaded.drawn(self._context, place.longest_m).labels
        return self._labels.silhouette(
            arrays, camera, place.bounds_px, place.camera_from_target, place.near_far_m
        )

    def release(self) -> None:
        """Free the uploaded targets."""
        self._loaded.release()
        self._labels.release()
        self._light_maps.release()


def _matrix(R: FloatArray, t_m: ArrayLike) -> FloatArray:
    """(4, 4) of a rotation (3, 3) and a translation (3,)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = R, t_m
    return matrix


def _matrix_of(scene: SceneState) -> FloatArray:
    """(4, 4) camera from target."""
    return _matrix(scene.camera_from_target.R, scene.t_camera_from_target_m)


@lru_cache(maxsize=16)
def material_values(materials: tuple[Material, ...], bands: Bands) -> Mapping[str, FloatArray]:
    """Members of the block ``Materials``; the same object again for the same materials, which need no second upload."""
    color, surface, grain = np.zeros((256, 4)), np.zeros((256, 4)), np.zeros((256, 4))
    for k, material in enumerate(materials, start=1):
        albedo = reflectance(bands, np.asarray(material.base_color))
        color[k, : len(albedo)] = albedo
        color[k, 3] = material.metallic
        surface[k] = [
            max(material.roughness, 0.03),  # below this a highlight is narrower than the Sun's own disc
            material.clearcoat,
            max(material.clearcoat_roughness, 0.03),
            material.crinkle,
        ]
        if material.anisotropy > 0:
            strength = material.anisotropy * (-1 if material.turned else 1)
            length = max(float(np.linalg.norm(material.grain)), 1e-9)  # a grain of no direction stays none
            grain[k] = [*(np.asarray(material.grain) / length), strength]
    return MappingProxyType(
        {"u_material_color": color, "u_material_surface": surface, "u_material_grain": grain}
    )
