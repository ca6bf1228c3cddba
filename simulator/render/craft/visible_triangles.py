"""Triangle culling: the triangles of a mesh that may be visible from a viewpoint."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.geometry.convex_shells import hidden

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.render.craft.mesh import GpuMesh
    from flyaround.simulator.runtime.arrays import FloatArray

GRAZING = 0.01
"""Sine of the angle by which a triangle may face away and still be drawn. Drivers round corners to 1/256 px, which may
turn a small triangle towards the camera."""


class CulledVertexArray:
    """A vertex array that skips triangles behind large bodies, and back faces of closed shells.

    Parameters
    ----------
    context : Context
        OpenGL context.
    mesh : GpuMesh
        The mesh.
    program : Program
        Program that draws it.
    more : tuple
        Further per-vertex buffers, as in `GpuMesh.vertex_array`.
    """

    def __init__(
        self,
        context: moderngl.Context,
        mesh: GpuMesh,
        program: moderngl.Program,
        *more: tuple[moderngl.Buffer, str, str],
    ) -> None:
        self._mesh = mesh
        self._indices = context.buffer(reserve=mesh.triangles.nbytes, dynamic=True)
        self.array = mesh.vertex_array(context, program, *more, indices=self._indices)

    def render(self, viewpoint: FloatArray) -> None:
        """Draw the triangles that may be visible; see `MeshArray.render`."""
        indices = visible_triangles(self._mesh, viewpoint)
        self._indices.orphan()
        self._indices.write(indices)
        self.array.render(vertices=indices.size)

    def release(self) -> None:
        """Free the vertex array and its indices."""
        self.array.release()
        self._indices.release()


def visible_triangles(mesh: GpuMesh, viewpoint: FloatArray) -> np.typing.NDArray[np.uint32]:
    """Return (K, 3) triangles of a mesh that may be visible from a viewpoint.

    Back faces of closed shells are left out, except those seen at a grazing angle.

    Parameters
    ----------
    mesh : GpuMesh
        Mesh on the GPU.
    viewpoint : (4,) array
        Homogeneous viewpoint, target frame, as in `MeshArray.render`.
    """
    is_box_visible = ~hidden(mesh.shells, mesh.boxes, viewpoint, mesh.radius_m)
    is_selected = is_box_visible.take(mesh.boxes.of)
    if mesh.is_closed:
        unit = np.asarray(viewpoint / np.linalg.norm(viewpoint[:3]), np.float32)
        is_selected &= unit @ mesh.plane_rows > -GRAZING
    # by indices, because NumPy applies a mask over rows more slowly
    return mesh.triangles.take(np.flatnonzero(is_selected), axis=0)
