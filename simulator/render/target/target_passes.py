"""The spacecraft: fits region, depth range and sampling to the target and runs its passes in order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from simulator.render.bake.charts import TEXEL
from simulator.render.bake.radiance_transfer import PATCH
from simulator.render.gl.fences import flush
from simulator.render.projection import PixelRect, clip_from_camera
from simulator.render.software.back_face_culling import CulledVertexArray
from simulator.render.software.coverage_mask import whole
from simulator.render.software.smooth_shading import SmoothShadingPass, is_curved, is_smooth, split_tiles
from simulator.render.target.edge_pass import EdgeBuffers, EdgePass
from simulator.render.target.gbuffer_pass import GBufferPass, TexturedGBufferPass
from simulator.render.target.interreflection import ReturnedLight
from simulator.render.target.label_pass import LabelPass, Surfaces
from simulator.render.target.materials import material_values
from simulator.render.target.mesh import upload
from simulator.render.target.resident_targets import Loaded, LoadedTargets
from simulator.render.target.self_shadow import SelfShadow
from simulator.render.target.shade_pass import ShadePass
from simulator.render.target.textures import Textures
from simulator.render.target.viewport_fit import (
    TILE_REACH_PX,
    choose_lattice,
    locate,
    outline_px,
    target_tiles,
)
from simulator.render.target.visible_edges import EdgeView
from simulator.render.uniform_values import lens_values
from simulator.scene.illumination.bands import bands_of

if TYPE_CHECKING:
    from collections.abc import Callable

    import moderngl
    from numpy.typing import ArrayLike

    from simulator.render.frame_images import FrameImages
    from simulator.render.gl.programs import Program, ProgramLibrary
    from simulator.render.gl.shared_blocks import Blocks
    from simulator.render.gl.timing import StageClock
    from simulator.render.view import View
    from simulator.runtime.arrays import FloatArray
    from simulator.scene.state import Bands, SceneState
    from simulator.targets.model import Target

# between nodes of baked light in the preset `high`, of the target's radius; and nodes along a patch that returns light
FINE_TEXEL, FINE_PATCH = 0.012, 2


@dataclass(frozen=True, eq=False)
class Sampled:
    """The target's samples, ready to be shaded.

    Parameters
    ----------
    rect : pixels that the target may cover. tiles_px : (K, 2) centres of the tiles of those.
    edged_px, edgeless_px : the same, those that edges come near and those that none does.
    program, textures : of the shading. smooth_program : of the tiles without edges. stamp : of the samples' image.
    returned : light from other parts; that of the frame is worked out last, when what comes from Earth and Moon is
        known.
    """

    rect: PixelRect
    tiles_px: FloatArray
    edged_px: FloatArray
    edgeless_px: FloatArray
    program: Program
    smooth_program: Program | None
    textures: dict[str, moderngl.Texture]
    stamp: int
    returned: ReturnedLight


class TargetPasses:
    """Shadow, geometry, shading and labels of the spacecraft; meshes are kept by the target's SHA-256.

    The preset `high` has its own, with nodes of baked light closer together. Labels are drawn from the other.

    Parameters
    ----------
    thrifty : as of `simulator.render.renderer.Renderer`.
    """

    def __init__(
        self, context: moderngl.Context, programs: ProgramLibrary, blocks: Blocks, *, thrifty: bool
    ) -> None:
        self._thrifty = thrifty
        self._context, self._programs, self._blocks = context, programs, blocks
        self._shadow = SelfShadow(context, programs, blocks)
        self._gbuffer = GBufferPass(context, programs)
        self._textured: TexturedGBufferPass | None = None  # made with the first mesh that has textures
        self._edges = EdgePass(context, programs)
        self._shade = ShadePass(context, programs)
        self._smooth = SmoothShadingPass(context, programs)
        self._labels = LabelPass(context, programs, blocks)
        self._loaded = LoadedTargets(self._upload, self._labels.forget)

    def _upload(self, target: Target, fine: bool) -> Loaded:  # noqa: FBT001 - called by what keeps them
        context = self._context
        mesh = upload(context, target, FINE_TEXEL if fine else TEXEL)
        textures = None
        if mesh.uv is not None:
            self._textured = self._textured or TexturedGBufferPass(context, self._programs)
            textures = Textures(context, target)
        gbuffer = self._gbuffer if mesh.uv is None or self._textured is None else self._textured
        return Loaded(
            mesh,
            CulledVertexArray(context, mesh, self._shadow.program, whole=not self._thrifty),
            # textures are bound by stretches of the index buffer
            CulledVertexArray(
                context, mesh, gbuffer.program(mesh).gl, whole=mesh.uv is not None or not self._thrifty
            ),
            EdgeBuffers(context, mesh.edges, mesh),
            ReturnedLight(context, mesh, FINE_PATCH if fine else PATCH),
            is_smooth(target),
            is_curved(target),
            textures,
        )

    def sample(self, scene: SceneState, view: View, target: Target, clock: StageClock) -> Sampled | None:
        """Draw what the samples of the target's pixels see, and its shadows; nothing where it touches no pixel.

        The order keeps a software driver's threads busy: they draw one thing while the next is being prepared. The
        samples come first, which take longest. A driver collects commands until the next framebuffer's first one comes,
        or until it is told to begin: it is told to, or its threads would rest while that pass is worked out.
        """
        loaded = self._loaded.get(target, fine=scene.quality == "high")
        loaded.returned.begin(scene.bands)
        mesh, camera = loaded.mesh, scene.camera
        place = locate(mesh, _matrix(view.R_camera_from_target, view.t_camera_from_target_m), camera)
        if place is None:
            return None
        bent = self._programs.lens  # edges are curves then, and not weighted
        tiles = target_tiles(mesh, place) if self._thrifty else whole(place.rect)
        if not len(tiles):
            return None
        # nearly always the same lattice whoever draws: the whole rectangle, which a GPU is given, has more samples
        extent = tiles if self._thrifty else outline_px(place)
        pixel_m = place.pixel_m(camera)
        lattice = choose_lattice(
            scene.quality, place, extent, pixel_m, dense=bent or loaded.textures is not None
        )
        size, origin = lattice.window(tiles, TILE_REACH_PX)
        lattice_clip = clip_from_camera(camera, *place.near_far_m, lattice.buffer_from_pixel(origin), size)
        if bent:
            self._blocks.lens.write(lens_values(camera, lattice_clip, place.camera_from_target))
        self._blocks.target.write(
            {
                "u_lattice_clip_from_target": lattice_clip @ place.camera_from_target,
                "u_camera_from_target": place.camera_from_target,
                "u_lattice": [*origin, *place.near_far_m],
                "u_lattice_px": [*size, 0, 0],
            }
        )
        self._blocks.materials.write(material_values(mesh.materials, scene.bands))
        clock.lap("target.setup")
        texels: dict[str, moderngl.Texture] = {}
        if self._textured is None or loaded.textures is None:
            samples = self._gbuffer.run(mesh, loaded.gbuffer, size, place.camera_target_m, cut=place.is_cut)
        else:
            samples = self._textured.run_textured(
                loaded.gbuffer.array, size, mesh, loaded.textures, scene.bands, cut=place.is_cut
            )
            texels = dict(zip(self._shade.TEXTURED, samples.texels, strict=True))
        flush(self._context)
        clock.lap("target.geometry")
        shadow_map, choice = self._shadow.draw(scene, view, loaded, place)
        flush(self._context)
        clock.lap("target.shadow")
        exact = scene.quality == "high"
        edge_view = EdgeView(camera, place.rect, place.near_far_m[0], place.camera_from_target)
        edges = self._edges.begin(None if bent else loaded.edges, edge_view, exact=exact)
        slope = self._edges.run(edges, lattice)
        flush(self._context)
        edged, edgeless, even = tiles, tiles[:0], None
        bands = len(bands_of(scene.bands))
        if (
            self._thrifty
            and not exact
            and place.hull_px is not None
            and loaded.is_smooth
            and scene.lamp is None
        ):
            edged, edgeless = split_tiles(tiles, loaded.edges.seen, edge_view)
            if len(edgeless):
                even = self._shade.smooth_program(lattice, bands, mesh, choice.window, bent=loaded.is_curved)
        clock.lap("target.edges")
        return Sampled(
            place.rect,
            tiles,
            edged,
            edgeless,
            self._shade.program(lattice, bands, mesh, choice.window, scene.lamp, exact=exact),
            even,
            {
                "t_surface": samples.surface,
                "t_depth": samples.depth,
                "t_shadow": shadow_map,
                "t_slope": slope,
                **texels,
            },
            samples.stamp,
            loaded.returned,
        )

    def compile_ahead(self, sampled: Sampled, bands: Bands, images: FrameImages) -> None:
        """Have the driver compile the shading while light is baked; what it draws is to be cleared."""
        textures = sampled.textures | sampled.returned.stand_ins(bands)
        tiles, program = sampled.edged_px[:1], sampled.program
        if len(tiles):
            self._shade.run(images.target_framebuffer, sampled.rect, tiles, program, textures, ahead=True)

    def shade(self, sampled: Sampled, view: View, bands: Bands, images: FrameImages) -> None:
        """Have the driver draw radiance and coverage into ``images``, in the light of ``view``."""
        light = sampled.returned.update(bands, view)
        textures = {**sampled.textures, "t_open": light.visibility, "t_returned": light.returned}
        sampled.program.set("u_stamp", sampled.stamp)
        program, tiles, even = sampled.smooth_program, sampled.edged_px, None
        if program is not None:
            program.set("u_stamp", sampled.stamp)
            looked_up = {name: textures[name] for name in self._shade.SMOOTH_SAMPLERS}
            even = self._smooth.shade_corners(sampled.edgeless_px, program, looked_up, len(bands_of(bands)))
            tiles = np.concatenate([tiles, even.others_px])
        self._shade.run(images.target_framebuffer, sampled.rect, tiles, sampled.program, textures)
        if even is not None:
            self._smooth.fill(even, sampled.rect, len(bands_of(bands)))
        flush(self._context)

    def begin_surfaces(self, scene: SceneState, target: Target, *, layers: bool) -> Callable[[], Surfaces]:
        """Have the driver draw what lies at each pixel's centre; the result waits for it, to be called once."""
        mesh, camera = self._loaded.get(target).mesh, scene.camera
        place = locate(mesh, _matrix_of(scene), camera)
        pending = None
        if place is not None:
            pending = self._labels.begin(
                target, mesh, camera, place.rect, place.camera_from_target, place.near_far_m, layers=layers
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
        mesh, camera = self._loaded.get(target).mesh, scene.camera
        place = locate(mesh, _matrix_of(scene), camera, clip=False)
        if place is None:
            return 0.0
        return self._labels.silhouette(
            target, mesh, camera, place.bounds_px, place.camera_from_target, place.near_far_m
        )

    def release(self) -> None:
        """Free the uploaded targets."""
        self._loaded.release()
        self._labels.release()


def _matrix(R: FloatArray, t_m: ArrayLike) -> FloatArray:
    """(4, 4) of a rotation (3, 3) and a translation (3,)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = R, t_m
    return matrix


def _matrix_of(scene: SceneState) -> FloatArray:
    """(4, 4) camera from target."""
    return _matrix(scene.camera_from_target.R, scene.t_camera_from_target_m)
