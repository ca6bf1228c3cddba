"""G-buffer pass: which surface each sample sees. Reads the mesh; writes material, normal, chart and depth."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from flyaround.simulator.render.gl.buffer_pool import BufferPool
from flyaround.simulator.render.gl.context import release
from flyaround.simulator.render.gl.depth_buffer import DepthBuffer
from flyaround.simulator.scene.illumination.bands import bands_of, reflectance

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.render.craft.mesh import GpuMesh
    from flyaround.simulator.render.craft.mesh_array import MeshArray
    from flyaround.simulator.render.craft.textures import Textures
    from flyaround.simulator.render.gl.programs import Program, ProgramLibrary
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.illumination.bands import Bands

STAMP_SHIFT = 28
KEPT_BYTES = 320 << 20
"""Of all sizes at hand: two frames filled by a craft of plain materials, or one of textures."""
_PLAIN_BYTES, _TEXEL_BYTES = 12, 16  # a sample


def normal_bits(mesh: GpuMesh) -> int:
    """Bits of each of the normal's two coordinates: what the material's number leaves of 32."""
    return 13 if len(mesh.materials) < 1 << 6 else 12


class SampleImages:
    """One 32-bit word (material, normal), a place in the charts' atlas and a depth per sample, and what textures add.

    Parameters
    ----------
    texels : also reflectance and metalness, and normal and roughness, of each sample.
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
        """What marks the samples of the frame being drawn, as ``u_stamp`` of shaders/craft/packed_samples.glsl.

        It is the number of their range of depths, at most 15 to fit four bits; 0 is of a cleared image.
        """
        return self._depth.number << STAMP_SHIFT

    def begin(self, *, clear: bool) -> None:
        """Make the images current, and empty by a new stamp, or by clearing.

        Clearing takes a software driver as long as drawing two fifths of the samples.
        """
        self._depth.begin(self.framebuffer, clear=clear)

    def end(self) -> None:
        """Let other passes have the whole range of depths."""
        self._depth.end()

    def release(self) -> None:
        """Free the images."""
        release(self._context, self.framebuffer, self.surface, self.depth, *self.texels)


class GBufferPass:
    """The supersampled target."""

    DEFINES: ClassVar[dict[str, object]] = {}
    SAMPLERS: ClassVar[tuple[str, ...]] = ()
    TEXELS: ClassVar[bool] = False

    def __init__(self, context: moderngl.Context, programs: ProgramLibrary) -> None:
        self._context = context
        self._programs = programs
        most = KEPT_BYTES / (_PLAIN_BYTES + _TEXEL_BYTES * self.TEXELS)
        self._images = BufferPool(lambda w, h: SampleImages(context, w, h, texels=self.TEXELS), most)

    def program(self, mesh: GpuMesh) -> Program:
        """The program for a mesh: closed shells show no back faces, few materials leave bits to the normal."""
        defines = {
            "NORMAL_BITS": normal_bits(mesh),
            **({"CLOSED": ""} if mesh.is_closed else {}),
            **self.DEFINES,
        }
        return self._programs.get("craft/gbuffer.vert", "craft/gbuffer.frag", defines, self.SAMPLERS)

    def run(
        self, mesh: GpuMesh, array: MeshArray, size: tuple[int, int], camera_m: FloatArray, *, cut: bool
    ) -> SampleImages:
        """Draw the samples of one lattice window.

        Parameters
        ----------
        array : of ``mesh``. camera_m : (3,) place of the camera, target frame. cut : some of the target may be nearer
            than the near plane.
        """
        images = self._begin(mesh, size, cut=cut)
        array.render(np.append(camera_m, 1.0))
        images.end()
        return images

    def _begin(self, mesh: GpuMesh, size: tuple[int, int], *, cut: bool) -> SampleImages:
        images = self._images.at_least(*size)
        images.begin(clear=cut)
        self.program(mesh).set("u_stamp", images.stamp)
        # back faces of closed shells are never seen and need not be drawn
        culled = self._context.CULL_FACE if mesh.is_closed else 0
        self._context.enable_only(self._context.DEPTH_TEST | culled)
        images.framebuffer.viewport = (0, 0, *size)
        return images


class TexturedGBufferPass(GBufferPass):
    """The supersampled target with two more words per sample; meshes without textures never meet it."""

    DEFINES: ClassVar[dict[str, object]] = {"TEXTURED": ""}
    SAMPLERS: ClassVar[tuple[str, ...]] = ("t_base_color", "t_metallic_roughness", "t_normal")
    TEXELS: ClassVar[bool] = True

    def run_textured(
        self,
        vertex_array: moderngl.VertexArray,
        size: tuple[int, int],
        mesh: GpuMesh,
        textures: Textures,
        bands: Bands,
        *,
        cut: bool,
    ) -> SampleImages:
        """Draw the samples of one lattice window, one set of textures after the other; parameters as in `run`."""
        images = self._begin(mesh, size, cut=cut)
        program = self.program(mesh)
        program.set("u_band_from_rgb", _band_from_rgb(bands))
        for draw in mesh.draws:
            color, data, normal = textures.of(draw.material)
            program.bind_textures(t_base_color=color, t_metallic_roughness=data, t_normal=normal)
            material = draw.material
            program.set("u_base_factor", (0.0,) * 4 if material is None else (*material.base_color, 1.0))
            program.set("u_normal_mapped", float(material is not None and material.normal_texture != ""))
            vertex_array.render(vertices=draw.count, first=draw.first)
        images.end()
        return images


def _band_from_rgb(bands: Bands) -> tuple[float, ...]:
    """Columns of the (3, 3) matrix that takes linear RGB to reflectances of the bands; unused rows are zero."""
    matrix = np.zeros((3, 3))
    matrix[: len(bands_of(bands))] = reflectance(bands, np.eye(3)).T
    return tuple(matrix.T.ravel().tolist())
