"""A closed mesh without the triangles that look away: those show nowhere, and cost as much as the others."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import moderngl

    from simulator.arrays import FloatArray
    from simulator.render.mesh import Mesh

GRAZING = 0.01
"""Sine of the angle under which a triangle may look away and is drawn yet: corners rounded to 1/256 of a pixel may
turn a small one round."""


class FacingArray:
    """A vertex array of a mesh; of closed shells it draws the triangles that face a place, of others all.

    Parameters
    ----------
    program : what draws it. more : further buffers with a value per vertex, as in `Mesh.vertex_array`.
    whole : draw all triangles of closed shells too.
    """

    def __init__(
        self,
        context: moderngl.Context,
        mesh: Mesh,
        program: moderngl.Program,
        *more: tuple[moderngl.Buffer, str, str],
        whole: bool = False,
    ) -> None:
        self._mesh = mesh
        self._indices: moderngl.Buffer | None = None
        if mesh.is_closed and not whole and not (program.extra or {}).get("patches"):
            self._indices = context.buffer(reserve=mesh.indices.size, dynamic=True)
        self.array = mesh.vertex_array(context, program, *more, indices=self._indices)

    def render(self, place: FloatArray) -> None:
        """Draw what faces a place.

        Parameters
        ----------
        place : (4,) homogeneous, target frame: a point (x, y, z, 1) [m] or the direction (x, y, z, 0) of one far away.
        """
        if self._indices is None:
            self.array.render()
            return
        seen = facing(self._mesh, place)
        self._indices.orphan()
        self._indices.write(seen)
        self.array.render(vertices=seen.size)

    def release(self) -> None:
        """Free the vertex array and its indices."""
        self.array.release()
        if self._indices is not None:
            self._indices.release()


def facing(mesh: Mesh, place: FloatArray) -> np.typing.NDArray[np.uint32]:
    """(K, 3) triangles of a mesh that face a place, or hardly look away; ``place`` as in `FacingArray.render`."""
    unit = np.asarray(place / np.linalg.norm(place[:3]), np.float32)
    # by their numbers: a mask over rows takes numpy twice as long
    return mesh.triangles.take(np.flatnonzero(mesh.planes @ unit > -GRAZING), axis=0)
