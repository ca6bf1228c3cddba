"""Shading pass: gathers each pixel's samples, shades each distinct surface once, writes radiance and coverage."""

from __future__ import annotations

from typing import TYPE_CHECKING, get_args

import numpy as np

from flyaround.simulator.baking.creases import crease_levels
from flyaround.simulator.baking.radiance_transfer import LARGEST_SLOPE
from flyaround.simulator.render.craft.edge_pass import EDGE_SLOPES, edge_defines
from flyaround.simulator.render.craft.finishes import finish_defines
from flyaround.simulator.render.craft.gbuffer_pass import SAMPLES, TEXEL_SAMPLERS
from flyaround.simulator.render.craft.mesh_array import normal_bits
from flyaround.simulator.render.craft.placement import TARGET, TARGET_TILES
from flyaround.simulator.render.craft.sample_pattern import pattern_defines
from flyaround.simulator.render.craft.shadow_pass import SHADOW
from flyaround.simulator.render.craft.viewport_fit import TILE_PX
from flyaround.simulator.render.frame_graph import Pass, Resource
from flyaround.simulator.render.frame_images import IMAGES, RADIANCE
from flyaround.simulator.render.gl.fences import draw_to
from flyaround.simulator.render.gl.mipmaps import texture_of_levels
from flyaround.simulator.render.view import SCENE, VIEW
from flyaround.simulator.scene.illumination.bands import bands_of
from flyaround.simulator.scene.illumination.lamp import Profile

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.render.craft.interreflection import AtlasTextures
    from flyaround.simulator.render.craft.mesh import GpuMesh
    from flyaround.simulator.render.craft.placement import PlacedTarget
    from flyaround.simulator.render.craft.shadow_pass import TargetShadow
    from flyaround.simulator.render.device import Device
    from flyaround.simulator.render.frame_graph import PassResources
    from flyaround.simulator.render.gl.programs import Program
    from flyaround.simulator.scene.state import SceneState

# Distinct (material, normal) groups shaded per pixel, without and with exact areas. The last one takes the weight of
# the samples of further groups. No study supports the limits; they bound the shading time of a pixel.
MAX_SURFACES, MAX_SURFACES_EXACT = 4, 17
# A pixel of a distant craft holds dozens of groups. With a small limit the last group would get too large an area, and
# pixels would flicker where it faces the Sun.
MAX_SURFACES_FAR, FAR_SAMPLES = 12, 32
_SAMPLERS = ("t_surface", "t_depth", "t_shadow", "t_slope", "t_sky_visibility", "t_interreflection")


TARGET_LIGHT: Resource[AtlasTextures] = Resource("target light")
"""Light that the target's parts reflect on each other, on the atlas of its charts."""


class LightPass(Pass):
    """Pass of the light that the target's parts reflect on each other."""

    name = "target.light"
    reads = (SCENE, VIEW, TARGET)
    writes = (TARGET_LIGHT,)

    def run(self, r: PassResources) -> None:
        """Update the atlas. The first frame waits until it is baked."""
        r[TARGET_LIGHT] = r[TARGET].resident.interreflection.update(r[SCENE].bands, r[VIEW])


class ShadePass(Pass):
    """Shading pass of the target's pixels: writes radiance, multiplied by coverage, and coverage."""

    name = "target.shading"
    reads = (SCENE, TARGET, TARGET_TILES, SAMPLES, SHADOW, EDGE_SLOPES, TARGET_LIGHT, *IMAGES)
    writes = IMAGES
    submits = True

    def __init__(self, device: Device) -> None:
        self._context, self._programs = device.context, device.programs
        self._arrays: dict[Program, moderngl.VertexArray] = {}
        self._tiles = self._context.buffer(reserve=8, dynamic=True)
        self._creases: moderngl.Texture | None = None

    def run(self, r: PassResources) -> None:
        """Shade the pixels of the target's tiles."""
        rect, images, samples, shadow, light = (
            r[TARGET].rect,
            r[RADIANCE],
            r[SAMPLES],
            r[SHADOW],
            r[TARGET_LIGHT],
        )
        program = self._program(r[SCENE], r[TARGET], shadow)
        textures = {
            **samples.textures,
            "t_shadow": shadow.map,
            "t_slope": r[EDGE_SLOPES],
            "t_sky_visibility": light.visibility,
            "t_interreflection": light.interreflection,
            **({} if shadow.lights is None else {"t_light_depth": shadow.lights}),
        }
        if program.reads("t_creases"):
            if self._creases is None:
                self._creases = texture_of_levels(self._context, crease_levels())
            textures["t_creases"] = self._creases
        program.set("u_stamp", samples.stamp)
        program.set("u_cells", _cells_in_camera(r[TARGET]))
        images.mark_covered(rect)
        draw_to(images.target_framebuffer)
        # whole tiles, beyond the image's edge too: a point whose centre is outside would be dropped
        width, height = (-(-side // TILE_PX) * TILE_PX for side in (rect.width, rect.height))
        window = (rect.x0, rect.y0, width, height)
        images.target_framebuffer.viewport = window
        self._context.enable_only(self._context.PROGRAM_POINT_SIZE)
        program.bind_textures(**textures)
        if program not in self._arrays:
            self._arrays[program] = self._context.vertex_array(
                program.gl, [(self._tiles, "2f", "in_pixel")], mode=self._context.POINTS
            )
        tiles = r[TARGET_TILES].astype(np.float32)
        self._tiles.orphan(tiles.nbytes)
        self._tiles.write(tiles)
        program.set("u_window", window)
        for name, image in (("u_texel", "t_surface"), ("u_slope_texel", "t_slope")):
            columns, rows = textures[image].size
            program.set(name, (1 / columns, 1 / rows))
        self._arrays[program].render(vertices=len(tiles))

    def _program(self, scene: SceneState, placed: PlacedTarget, shadow: TargetShadow) -> Program:
        """Return the program for a lattice, a number of bands and the features of the mesh's materials."""
        mesh, lattice, lamp = placed.resident.mesh, placed.lattice, scene.lamp
        exact, light_points = scene.quality == "high", shadow.light_points
        max_surfaces = MAX_SURFACES_FAR if lattice.samples > FAR_SAMPLES else MAX_SURFACES
        defines = {
            **_light_defines(len(bands_of(scene.bands)), mesh, shadow.choice.window),
            **finish_defines(mesh.materials, scene.bands, scene.quality, len(mesh.cell_lattices)),
            **pattern_defines(lattice),
            **edge_defines(exact=exact),
            "MAX_SURFACES": MAX_SURFACES_EXACT if exact else max_surfaces,
            "TILE_PX": TILE_PX,
            **({} if lamp is None else {"LAMP": 1 + get_args(Profile).index(lamp.profile)}),
            **({"LIGHT_POINTS": light_points} if light_points else {}),
        }
        texels = TEXEL_SAMPLERS if mesh.uv is not None else ()
        light_sampler = ("t_light_depth",) if light_points else ()
        creases = ("t_creases",) if "CRINKLE" in defines else ()
        return self._programs.get(
            "craft/tiles.vert", "craft/shade.frag", defines, (*_SAMPLERS, *texels, *light_sampler, *creases)
        )


def _cells_in_camera(placed: PlacedTarget) -> tuple[tuple[float, ...], ...]:
    """Return the rows of the cell lattices, for points in the camera frame."""
    rows = placed.resident.mesh.cell_lattices.copy()
    rows[:, :3] = rows[:, :3] @ np.linalg.inv(placed.fit.camera_from_target)
    return tuple(map(tuple, rows.reshape(-1, 4).tolist()))


def _light_defines(bands: int, mesh: GpuMesh, shadow_window: int) -> dict[str, object]:
    """Return the defines of a mesh's lighting, for the features of its materials."""
    switches = {
        "TEXTURED": mesh.uv is not None,
        "CLOSED": mesh.is_closed,
        "BRUSHED": any(m.anisotropy > 0 for m in mesh.materials),
    }
    return {
        "BANDS": bands,
        "NORMAL_BITS": normal_bits(mesh),
        "LARGEST_SLOPE": LARGEST_SLOPE,
        **{name: "" for name, is_used in switches.items() if is_used},
        **_shadow_defines(shadow_window),
    }


def _shadow_defines(window: int) -> dict[str, object]:
    """Return the defines of the shadow filter over ``window`` x ``window`` texels; ``window`` is even.

    The texels are read in blocks of four, one gather each.
    """
    starts = [(i, j) for j in range(0, window, 2) for i in range(0, window, 2)]
    all_blocks = " ".join(f"F({k}, {i}, {j})" for k, (i, j) in enumerate(starts))
    return {"SHADOW_WINDOW": window, "FOR_EACH_SHADOW_BLOCK(F)": all_blocks}
