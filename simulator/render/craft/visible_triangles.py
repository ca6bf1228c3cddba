"""The triangles of a mesh that can show from a place: the others cost as much and show nowhere."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.geometry.convex_shells import hidden

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.render.craft.mesh import GpuMesh
    from flyaround.simulator.runtime.arrays import FloatArray

GRAZING = 0.01
"""Sine of the angle under which a triangle may look away and is drawn yet: corners rounded to 1/256 of a pixel may
turn a small one round."""


class CulledVertexArray:
    """A vertex array of a mesh that draws what can show: nothing behind large bodies; of closed shells what faces.

    Parameters
    ----------
    more : as in `GpuMesh.vertex_array`.
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

    def render(self, place: FloatArray) -> None:
        """Draw what can show from a place; as of `MeshArray.render`."""
        seen = visible_triangles(self._mesh, place)
        self._indices.orphan()
        self._indices.write(seen)
        self.array.render(vertices=seen.size)

    def release(self) -> None:
        """Free the vertex array and its indices."""
        self.array.release()
        self._indices.release()


def visible_triangles(mesh: GpuMesh, place: FloatArray) -> np.typing.NDArray[np.uint32]:
    """(K, 3) triangles of a mesh that may show from a place.

    Of closed shells those that face it, or hardly look away; ``place`` as of `MeshArray.render`.
    """
    show = ~hidden(mesh.shells, mesh.boxes, place, mesh.radius_m)
    kept = show.take(mesh.boxes.of)
    if mesh.is_closed:
        unit = np.asarray(place / np.linalg.norm(place[:3]), np.float32)
        kept &= unit @ mesh.plane_rows > -GRAZING
    # by their numbers: a mask over rows takes numpy twice as long
    return mesh.triangles.take(np.flatnonzero(kept), axis=0)
