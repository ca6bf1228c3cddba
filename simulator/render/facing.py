"""The triangles of a mesh that can show from a place, the nearest first: the others cost as much and show nowhere."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from simulator.render.occluders import hidden

if TYPE_CHECKING:
    import moderngl

    from simulator.arrays import FloatArray
    from simulator.render.mesh import Mesh

GRAZING = 0.01
"""Sine of the angle under which a triangle may look away and is drawn yet: corners rounded to 1/256 of a pixel may
turn a small one round."""


class FacingArray:
    """A vertex array of a mesh that draws what can show: nothing behind large bodies; of closed shells what faces.

    Parameters
    ----------
    program : what draws it. more : further buffers with a value per vertex, as in `Mesh.vertex_array`.
    whole : draw all triangles, in the mesh's order.
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
        if not whole and not (program.extra or {}).get("patches"):
            self._indices = context.buffer(reserve=mesh.indices.size, dynamic=True)
        self.array = mesh.vertex_array(context, program, *more, indices=self._indices)

    def render(self, place: FloatArray) -> None:
        """Draw what can show from a place.

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
    """(K, 3) triangles of a mesh that may show from a place, those in the nearest boxes first.

    Of closed shells those that face it, or hardly look away; ``place`` as in `FacingArray.render`.
    """
    boxes = mesh.boxes
    show = ~hidden(mesh.shells, boxes, place, mesh.radius_m)
    kept = show.take(boxes.of)
    if mesh.is_closed:
        unit = np.asarray(place / np.linalg.norm(place[:3]), np.float32)
        kept &= mesh.planes @ unit > -GRAZING
    # by their numbers: a mask over rows takes numpy twice as long
    numbers = np.flatnonzero(kept)
    order = np.argsort(boxes.ranks(place).take(boxes.of.take(numbers)), kind="stable")
    return mesh.triangles.take(numbers.take(order), axis=0)
