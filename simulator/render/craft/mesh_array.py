"""What of a target a driver is asked to draw: all of it, or what the CPU found that can show."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from flyaround.simulator.render.craft.viewport_fit import all_tiles

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.render.craft.mesh import GpuMesh
    from flyaround.simulator.render.craft.viewport_fit import ViewportFit
    from flyaround.simulator.runtime.arrays import FloatArray


class MeshArray(Protocol):
    """A mesh as one program draws it."""

    @property
    def array(self) -> moderngl.VertexArray:
        """The vertex array that draws it."""

    def render(self, place: FloatArray) -> None:
        """Draw at least what can show from a place.

        Parameters
        ----------
        place : (4,) homogeneous, target frame: a point (x, y, z, 1) [m] or the direction (x, y, z, 0) of one far away.
        """

    def release(self) -> None:
        """Free it."""


class Culling(Protocol):
    """Which triangles and which tiles of the image are drawn."""

    def mesh_array(
        self,
        context: moderngl.Context,
        mesh: GpuMesh,
        program: moderngl.Program,
        *more: tuple[moderngl.Buffer, str, str],
    ) -> MeshArray:
        """A mesh for one program; ``more`` as in `GpuMesh.vertex_array`."""

    def target_tiles(self, place: ViewportFit) -> FloatArray:
        """Centres (K, 2) [px] of tiles that hold all that the target may touch."""


class WholeMesh:
    """A mesh that is drawn as a whole; parameters as of `Culling.mesh_array`."""

    def __init__(
        self,
        context: moderngl.Context,
        mesh: GpuMesh,
        program: moderngl.Program,
        *more: tuple[moderngl.Buffer, str, str],
    ) -> None:
        self.array = mesh.vertex_array(context, program, *more)

    def render(self, place: FloatArray) -> None:  # noqa: ARG002
        """Draw all triangles, in the mesh's order."""
        self.array.render()

    def release(self) -> None:
        """Free the vertex array."""
        self.array.release()


class NoCulling:
    """All triangles, and all tiles of the rectangle around the target: what a GPU is given."""

    mesh_array = WholeMesh

    def target_tiles(self, place: ViewportFit) -> FloatArray:
        """Centres (K, 2) [px] of all the tiles of the target's rectangle."""
        return all_tiles(place.rect)
