"""Vertex arrays of a target's mesh, and the programs that draw them: samples, shadow maps, labels."""

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
    """A mesh in the form that one program draws."""

    @property
    def array(self) -> moderngl.VertexArray:
        """Vertex array for drawing."""

    def render(self, viewpoint: FloatArray) -> None:
        """Draw at least the triangles that may be visible from a viewpoint.

        Parameters
        ----------
        viewpoint : (4,) array
            Homogeneous viewpoint, target frame: a point (x, y, z, 1) [m] or, at infinity, a direction (x, y, z, 0).
        """

    def release(self) -> None:
        """Free the vertex array."""


class Culling(Protocol):
    """Selection of the triangles and image tiles to draw."""

    def mesh_array(
        self,
        context: moderngl.Context,
        mesh: GpuMesh,
        program: moderngl.Program,
        *more: tuple[moderngl.Buffer, str, str],
    ) -> MeshArray:
        """Return a mesh for one program; ``more`` is as in `GpuMesh.vertex_array`."""

    def target_tiles(self, fit: ViewportFit) -> FloatArray:
        """Return centres (K, 2) [px] of tiles that contain all pixels that the target may touch."""


class WholeMesh:
    """A mesh that is always drawn whole, without culling; parameters as in `Culling.mesh_array`."""

    def __init__(
        self,
        context: moderngl.Context,
        mesh: GpuMesh,
        program: moderngl.Program,
        *more: tuple[moderngl.Buffer, str, str],
    ) -> None:
        self.array = mesh.vertex_array(context, program, *more)

    def render(self, viewpoint: FloatArray) -> None:  # noqa: ARG002
        """Draw all triangles."""
        self.array.render()

    def release(self) -> None:
        """Free the vertex array."""
        self.array.release()


class NoCulling:
    """No culling, for a GPU: all triangles, and all tiles of the target's rectangle."""

    mesh_array = WholeMesh

    def target_tiles(self, fit: ViewportFit) -> FloatArray:
        """Return centres (K, 2) [px] of all the tiles of the target's rectangle."""
        return all_tiles(fit.rect)


TEXTURE_SAMPLERS = ("t_base_color", "t_metallic_roughness", "t_normal")


def normal_bits(mesh: GpuMesh) -> int:
    """Return the bits per coordinate of a stereographic normal; it shares a 32-bit word with the material's index."""
    return 13 if len(mesh.materials) < 1 << 6 else 12


def sample_program(programs: ProgramLibrary, mesh: GpuMesh) -> Program:
    """Return the program that draws a mesh's samples into the G-buffer.

    It depends on whether the mesh is closed (back faces are culled), on the bits of the normal, and on textures, which
    need two more words per sample.
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
    """Return the program that draws a mesh's depth from a light."""
    return programs.get("craft/shadow.vert", "craft/shadow.frag", {})


def label_program(programs: ProgramLibrary, *, layers: bool) -> Program:
    """Return the program that draws depth at pixel centres, and with ``layers`` normals and parts."""
    return programs.get("craft/labels.vert", "craft/labels.frag", {"LAYERS": int(layers)})


@dataclass(frozen=True, eq=False)
class LabelArrays:
    """Vertex arrays of one uploaded mesh for label rendering: depth only, or depth, normals and parts."""

    depth: CulledVertexArray
    layers: CulledVertexArray
    parts: moderngl.Buffer

    @staticmethod
    def create(
        context: moderngl.Context, programs: ProgramLibrary, target: Target, mesh: GpuMesh
    ) -> LabelArrays:
        """Create the vertex arrays of a target's mesh, cut or uncut."""
        part_numbers = np.concatenate(
            [np.full(len(target.parts[k].positions_m), k + 1, np.float32) for k in mesh.order]
        )
        parts = context.buffer(part_numbers[mesh.charts.origin][mesh.sources].tobytes())
        depth, layers = (label_program(programs, layers=layers).gl for layers in (False, True))
        return LabelArrays(
            CulledVertexArray(context, mesh, depth),
            CulledVertexArray(context, mesh, layers, (parts, "1f", "in_part")),
            parts,
        )

    def release(self) -> None:
        """Free the vertex arrays."""
        for resource in (self.depth, self.layers, self.parts):
            resource.release()
