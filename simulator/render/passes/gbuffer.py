"""Geometry pass: which surface each lattice sample sees. Reads the mesh; writes material, normal and depth."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from simulator.render.context import release

if TYPE_CHECKING:
    import moderngl

    from simulator.render.mesh import Mesh
    from simulator.render.programs import Program, ProgramLibrary

_GRAIN_PX = 256  # buffers grow in steps of this, so that a drifting target does not reallocate every frame


def normal_bits(mesh: Mesh) -> int:
    """Bits of each of the normal's two coordinates: what the material's number leaves of 32."""
    return 13 if len(mesh.materials) < 1 << 6 else 12


class GBufferPass:
    """The supersampled target: one 32-bit word (material, normal) and a depth per sample."""

    DEFINES: ClassVar[dict[str, object]] = {}
    SAMPLERS: ClassVar[tuple[str, ...]] = ()

    def __init__(self, context: moderngl.Context, programs: ProgramLibrary) -> None:
        self._context = context
        self._programs = programs
        self._allocate(_GRAIN_PX, _GRAIN_PX)

    def program(self, mesh: Mesh) -> Program:
        """The program for a mesh: closed shells show no back faces, few materials leave bits to the normal."""
        defines = {
            "NORMAL_BITS": normal_bits(mesh),
            **({"CLOSED": ""} if mesh.is_closed else {}),
            **self.DEFINES,
        }
        return self._programs.get("target/gbuffer.vert", "target/gbuffer.frag", defines, self.SAMPLERS)

    def _allocate(self, width: int, height: int) -> None:
        self.surface = self._context.texture((width, height), 1, dtype="u4")
        self.depth = self._context.depth_texture((width, height))
        self.depth.compare_func = ""
        for texture in (self.surface, self.depth):
            texture.filter = (self._context.NEAREST, self._context.NEAREST)
        self._framebuffer = self._context.framebuffer([self.surface], self.depth)

    def reserve(self, size: tuple[int, int]) -> None:
        """Make the buffers at least this large."""
        old = self.surface.size
        if size[0] <= old[0] and size[1] <= old[1]:
            return
        self._release()
        self._allocate(
            *(max(have, -(-want // _GRAIN_PX) * _GRAIN_PX) for have, want in zip(old, size, strict=True))
        )

    def _release(self) -> None:
        release(self._context, self._framebuffer, self.surface, self.depth)

    def run(self, vertex_array: moderngl.VertexArray, size: tuple[int, int], *, closed: bool) -> None:
        """Draw the samples of one lattice window.

        Parameters
        ----------
        closed : the mesh is made of closed shells, whose back faces are never seen and need not be drawn.
        """
        self._begin(size, closed=closed)
        vertex_array.render()

    def _begin(self, size: tuple[int, int], *, closed: bool) -> None:
        self._framebuffer.use()
        self._framebuffer.clear(0.0, 0.0, 0.0, 0.0, viewport=(0, 0, *size))
        self._context.enable_only(self._context.DEPTH_TEST | (self._context.CULL_FACE if closed else 0))
        self._framebuffer.viewport = (0, 0, *size)
