"""Vertex arrays of a target's mesh, and the programs that they are made for: samples, shadow maps, labels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from flyaround.simulator.render.craft.viewport_fit import all_tiles
from flyaround.simulator.render.craft.visible_triangles import CulledVertexArray

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.render.craft.mesh import GpuMesh
    from flyaround.simulator.render.craft.viewport_fit import ViewportFit
    from flyaround.simulator.render.gl.programs import Program, ProgramLibrary
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.targets.model import Target


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
    """The triangles and the tiles of the image that are drawn."""

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


TEXTURE_SAMPLERS = ("t_base_color", "t_metallic_roughness", "t_normal")


def normal_bits(mesh: GpuMesh) -> int:
    """Bits of each of the normal's two coordinates: what the material's number leaves of 32."""
    return 13 if len(mesh.materials) < 1 << 6 else 12


def sample_program(programs: ProgramLibrary, mesh: GpuMesh) -> Program:
    """Return the program that draws a mesh's samples.

    Closed shells show no back faces, few materials leave bits to the normal, and textures add two words per sample.
    """
    textured = mesh.uv is not None
    defines = {
        "NORMAL_BITS": normal_bits(mesh),
        **({"CLOSED": ""} if mesh.is_closed else {}),
        **({"TEXTURED": ""} if textured else {}),
    }
    return programs.get(
        "craft/gbuffer.vert", "craft/gbuffer.frag", defines, TEXTURE_SAMPLERS if textured else ()
    )


def shadow_program(programs: ProgramLibrary) -> Program:
    """Return the program that draws a mesh's depth as a light sees it."""
    return programs.get("craft/shadow.vert", "craft/shadow.frag", {})


def label_program(programs: ProgramLibrary, *, layers: bool) -> Program:
    """Return the program that draws depth at the pixels' centres, and with ``layers`` normals and parts."""
    return programs.get("craft/labels.vert", "craft/labels.frag", {"LAYERS": int(layers)})


@dataclass(frozen=True, eq=False)
class LabelArrays:
    """Vertex arrays of one uploaded mesh: for depth alone, and for all layers."""

    depth: CulledVertexArray
    layers: CulledVertexArray
    parts: moderngl.Buffer

    @staticmethod
    def of(context: moderngl.Context, programs: ProgramLibrary, target: Target, mesh: GpuMesh) -> LabelArrays:
        """Make the arrays of a target's mesh, as it is or cut."""
        numbers = np.concatenate(
            [np.full(len(target.parts[k].positions_m), k + 1, np.float32) for k in mesh.order]
        )
        parts = context.buffer(numbers[mesh.charts.origin][mesh.sources].tobytes())
        depth, layers = (label_program(programs, layers=layers).gl for layers in (False, True))
        return LabelArrays(
            CulledVertexArray(context, mesh, depth),
            CulledVertexArray(context, mesh, layers, (parts, "1f", "in_part")),
            parts,
        )

    def release(self) -> None:
        """Free them."""
        for resource in (self.depth, self.layers, self.parts):
            resource.release()
