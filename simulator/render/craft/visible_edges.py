"""Edge culling: the edges of a mesh that may be visible, reach the window and are not one of a close pair."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.baking.mesh_edges import edge_gaps
from flyaround.simulator.geometry.convex_shells import BOX_SIZE, Boxes, hidden
from flyaround.simulator.render.projection import image_of

if TYPE_CHECKING:
    from flyaround.simulator.baking.mesh_edges import MeshEdges
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.render.craft.mesh import GpuMesh
    from flyaround.simulator.render.projection import PixelRect
    from flyaround.simulator.runtime.arrays import BoolArray, FloatArray, IntArray

_SHORTEST_PX = 1.3
"""Shorter edges are skipped. Half as many remain as with 0.7 px, and coverage is as accurate."""
_SHORTEST_EXACT_PX = 0.7  # the same where areas of parts bounded by several edges are summed
REACH_PX = 1.2
"""Largest distance between two edges that may bound one thin body."""
# an edge affects pixels whose centres are up to half a diagonal away: an edge this close to another reaches all the
# same pixels and leaves their sample weights equal, so neither is drawn
_PAIR_PX = REACH_PX - 0.5 * np.sqrt(2.0)


@dataclass(frozen=True)
class EdgeCamera:
    """Camera and viewport for selecting edges.

    Parameters
    ----------
    rect : PixelRect
        Pixels to draw.
    nearest_m : float
        Least camera z of the mesh.
    camera_from_target : (4, 4) array
        Matrix.
    """

    camera: Camera
    rect: PixelRect
    nearest_m: float
    camera_from_target: FloatArray


class VisibleEdges:
    """The edges of one mesh, with those far from all others first.

    Parameters
    ----------
    mesh : GpuMesh
        Mesh whose large bodies hide edges.
    beside_m : (2, E) array, optional
        Result of `edge_gaps`, for edges already in order.
    pieces : (E,) array, optional
        Number of pieces that each original edge was cut into.
    """

    def __init__(
        self,
        edges: MeshEdges,
        mesh: GpuMesh,
        beside_m: FloatArray | None = None,
        pieces: IntArray | None = None,
    ) -> None:
        if beside_m is None:
            beside = edge_gaps(edges)
            order = np.argsort(-beside.max(axis=1), kind="stable")
            edges, beside_m = edges.take(order), np.ascontiguousarray(beside[order].T)
        self.edges, self._beside_m, self._mesh = edges, beside_m, mesh
        self._pieces = np.ones(len(edges.ends), int) if pieces is None else pieces
        self._nearness_m = -self._beside_m.max(axis=0)
        # column by column: a matrix-vector product takes three times as long
        self._planes = np.asfortranarray(self.edges.planes)
        self._faces = np.ascontiguousarray(self.edges.faces.T)
        self._is_border = self._faces[0] == self._faces[1]
        ends = self.edges.vertices_m[self.edges.ends]
        self._ends_m = np.ascontiguousarray(np.moveaxis(ends, 0, 2).reshape(6, -1))
        self._boxes = Boxes.about(ends, BOX_SIZE * mesh.radius_m)

    def cut(self, longest_m: float) -> VisibleEdges:
        """Return the same edges in pieces no longer than ``longest_m``."""
        if not np.isfinite(longest_m):
            return self
        pieces, origin = self.edges.cut(longest_m)
        return VisibleEdges(pieces, self._mesh, self._beside_m[:, origin], np.bincount(origin)[origin])

    def numbers(self, view: EdgeCamera, *, pairs: bool) -> tuple[IntArray, tuple[int, int]]:
        """Select edges that can be visible, lie in front of the camera, touch the window and are long enough to matter.

        Parameters
        ----------
        pairs : bool
            True to include edges closer than `_PAIR_PX` to another in the image.

        Returns
        -------
        tuple
            Their indices, and with ``pairs`` the number of those, first in order, that bound their part and show their
            first face, and of those, next in order, that show the second.
        """
        R, t = view.camera_from_target[:3, :3], view.camera_from_target[:3, 3]
        place = np.append(-R.T @ t, 1.0)
        near_m = _PAIR_PX * view.nearest_m / max(view.camera.fx_px, view.camera.fy_px)
        count = len(self._nearness_m)
        if not pairs:
            count = int(np.searchsorted(self._nearness_m, -near_m, side="right"))
        first, second, ends, creases = self._showing(place, count)
        kinds = (ends & first, ends & ~first, creases)
        if pairs:
            numbers = np.concatenate([np.flatnonzero(kind) for kind in kinds])
        else:
            is_near = self._beside_m[:, :count] < near_m
            if self.edges.is_closed:
                is_near &= first, second
            numbers = np.flatnonzero((ends | creases) & ~(is_near[0] | is_near[1]))
        behind = hidden(self._mesh.shells, self._boxes, place, self._mesh.radius_m)
        numbers = numbers[~behind.take(self._boxes.of.take(numbers))]
        numbers = numbers[self._on(numbers, view, _SHORTEST_EXACT_PX if pairs else _SHORTEST_PX)]
        if not pairs:
            return numbers, (0, 0)
        of_first, of_second = (int(np.count_nonzero(kind.take(numbers))) for kind in kinds[:2])
        return numbers, (of_first, of_second)

    def _showing(self, place: FloatArray, count: int) -> tuple[BoolArray, BoolArray, BoolArray, BoolArray]:
        """Classify the first ``count`` edges from a viewpoint.

        Return four masks: the first face is towards it, the second is, the edge is a boundary of its part, it is a
        crease on a visible face.
        """
        edges = self.edges
        first, second = (self._planes @ place > 0).take(self._faces[:, :count])
        ends = (first ^ second) | (first & self._is_border[:count])
        creases = edges.is_crease[:count] & ~ends
        if edges.is_closed:
            creases &= first
        return first, second, ends, creases

    def _on(self, numbers: IntArray, view: EdgeCamera, shortest_px: float) -> BoolArray:
        """Return a mask of edges in front of the camera, in the window, and long enough along either axis."""
        R, t = view.camera_from_target[:3, :3], view.camera_from_target[:3, 3]
        ends = self._ends_m.take(numbers, axis=1).reshape(2, 3, -1)
        x, y, z = np.moveaxis(R @ ends + t[:, None], 1, 0)
        # comparisons with NaN are false, so an edge behind the camera is dropped
        scale = 1 / np.where(z > view.nearest_m, z, np.nan)
        column, row = image_of(view.camera, x * scale, y * scale)
        rect, pieces = view.rect, self._pieces.take(numbers)
        selected = np.ones(len(numbers), bool)
        long = np.zeros(len(numbers), bool)
        for u, low, high in (
            (column, rect.x0 - 1, rect.x1),
            (row, rect.y0 - 1, rect.y1),
        ):
            long |= np.abs(u[0] - u[1]) * pieces > shortest_px
            selected &= (np.minimum(u[0], u[1]) < high) & (np.maximum(u[0], u[1]) > low)
        return selected & long
