"""G-buffer pass: material, normal, chart coordinates and depth of the surface at each sample."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.render.craft.mesh_array import sample_program
from flyaround.simulator.render.craft.placement import TARGET
from flyaround.simulator.render.frame_graph import Pass, Resource
from flyaround.simulator.render.gl.buffer_pool import BufferPool
from flyaround.simulator.render.gl.context import release
from flyaround.simulator.render.gl.depth_buffer import DepthBuffer
from flyaround.simulator.render.view import SCENE
from flyaround.simulator.scene.illumination.bands import bands_of, reflectance

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.render.craft.mesh import GpuMesh
    from flyaround.simulator.render.craft.textures import Textures
    from flyaround.simulator.render.device import Device
    from flyaround.simulator.render.frame_graph import PassResources
    from flyaround.simulator.render.gl.programs import Program
    from flyaround.simulator.scene.illumination.bands import Bands

STAMP_SHIFT = 28
"""Position of the frame's stamp in a 32-bit word."""
TEXEL_SAMPLERS = ("t_texel", "t_detail")
"""Samplers of the shading pass for textured materials."""
MAX_POOL_BYTES = 320 << 20
"""Memory limit of pooled images: two full frames of an untextured craft, or one of a textured one."""
_PLAIN_BYTES, _TEXEL_BYTES = 12, 16  # per sample


class SampleImages:
    """Images with a 32-bit word (material, normal), chart coordinates and depth per sample, and textured values.

    Parameters
    ----------
    context : Context
        OpenGL context.
    width : int
        Width of the images [samples].
    height : int
        Height of the images [samples].
    texels : bool, optional
        True to store reflectance and metalness, and normal and roughness, of each sample.
    """

    def __init__(self, context: moderngl.Context, width: int, height: int, *, texels: bool = False) -> None:
        self._context = context
        self.surface = context.texture((width, height), 2, dtype="u4")
        self._depth = DepthBuffer(context, (width, height))
        self.depth = self._depth.texture
        self.texels = [context.texture((width, height), 4, dtype="f2") for _ in range(2 * texels)]
        for texture in (self.surface, *self.texels):
            texture.filter = (context.NEAREST, context.NEAREST)
            texture.repeat_x = texture.repeat_y = False
        self.framebuffer = context.framebuffer([self.surface, *self.texels], self.depth)

    @property
    def stamp(self) -> int:
        """Mark of the current frame's samples: ``u_stamp`` of shaders/craft/packed_samples.glsl.

        It is the index of their depth range, at most 15 to fit four bits; a cleared image has 0.
        """
        return self._depth.number << STAMP_SHIFT

    def begin(self, *, clear: bool) -> None:
        """Make the images current and invalidate their samples, by a new stamp or by clearing.

        Clearing takes a software driver as long as drawing two fifths of the samples, so it is avoided.
        """
        self._depth.begin(self.framebuffer, clear=clear)

    def end(self) -> None:
        """Restore the full depth range for other passes."""
        self._depth.end()

    def release(self) -> None:
        """Free the images."""
        release(self._context, self.framebuffer, self.surface, self.depth, *self.texels)


@dataclass(frozen=True, eq=False)
class TargetSamples:
    """Textures of the G-buffer by sampler name; ``stamp`` marks this frame's samples among older ones."""

    textures: dict[str, moderngl.Texture]
    stamp: int


SAMPLES: Resource[TargetSamples] = Resource("samples")


class GBufferPass(Pass):
    """Draws the supersampled target. It runs first, because it takes longest."""

    name = "target.samples"
    reads = (SCENE, TARGET)
    writes = (SAMPLES,)
    submits = True

    def __init__(self, device: Device) -> None:
        self._context, self._programs = device.context, device.programs
        self._plain, self._textured = self._pool(texels=False), self._pool(texels=True)

    def _pool(self, *, texels: bool) -> BufferPool[SampleImages]:
        max_samples = MAX_POOL_BYTES / (_PLAIN_BYTES + _TEXEL_BYTES * texels)
        return BufferPool(lambda w, h: SampleImages(self._context, w, h, texels=texels), max_samples)

    def run(self, r: PassResources) -> None:
        """Draw the target's samples."""
        placed = r[TARGET]
        mesh, array, textures = placed.drawn_mesh.mesh, placed.drawn_mesh.gbuffer, placed.resident.textures
        images = (self._plain if textures is None else self._textured).at_least(*placed.size)
        # if the target may cross the near plane, depth does not distinguish this frame's samples from older ones
        images.begin(clear=placed.fit.is_cut)
        program = sample_program(self._programs, mesh)
        program.set("u_stamp", images.stamp)
        # back faces of closed shells are never visible
        culled = self._context.CULL_FACE if mesh.is_closed else 0
        self._context.enable_only(self._context.DEPTH_TEST | culled)
        images.framebuffer.viewport = (0, 0, *placed.size)
        if textures is None:
            array.render(np.append(placed.fit.camera_target_m, 1.0))
        else:
            program.set("u_band_from_rgb", _band_from_rgb(r[SCENE].bands))
            _draw_textured(array.array, mesh, program, textures)
        images.end()
        texels = dict(zip(TEXEL_SAMPLERS, images.texels, strict=True)) if images.texels else {}
        r[SAMPLES] = TargetSamples(
            {"t_surface": images.surface, "t_depth": images.depth, **texels}, images.stamp
        )


def _draw_textured(array: moderngl.VertexArray, mesh: GpuMesh, program: Program, textures: Textures) -> None:
    """Draw a mesh, one set of textures at a time."""
    for draw in mesh.draws:
        color, data, normal = textures.for_material(draw.material)
        program.bind_textures(t_base_color=color, t_metallic_roughness=data, t_normal=normal)
        material = draw.material
        program.set("u_base_factor", (0.0,) * 4 if material is None else (*material.base_color, 1.0))
        program.set("u_normal_mapped", float(material is not None and material.normal_texture != ""))
        array.render(vertices=draw.count, first=draw.first)


def _band_from_rgb(bands: Bands) -> tuple[float, ...]:
    """Return the columns of the (3, 3) matrix from linear RGB to reflectances per band; unused rows are zero."""
    matrix = np.zeros((3, 3))
    matrix[: len(bands_of(bands))] = reflectance(bands, np.eye(3)).T
    return tuple(matrix.T.ravel().tolist())
