"""Edge culling: selects the edges of a mesh that may be visible in the image and are far enough from other edges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.baking.mesh_edges import edge_gaps
from flyaround.simulator.geometry.convex_shells import BOX_SIZE, Boxes, hidden
from flyaround.simulator.render.projection import project_rays

if TYPE_CHECKING:
    from flyaround.simulator.baking.mesh_edges import MeshEdges
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.render.craft.mesh import GpuMesh
    from flyaround.simulator.render.projection import PixelRect
    from flyaround.simulator.runtime.arrays import BoolArray, FloatArray, IntArray

_SHORTEST_PX = 1.3
"""Shorter edges are skipped. A larger length leaves fewer edges to draw, a smaller one improves the coverage of pixels
along finely faceted outlines."""
_SHORTEST_EXACT_PX = 0.7  # the same where areas of parts bounded by several edges are summed
REACH_PX = 1.2
"""Largest distance between two edges that may bound one thin body."""
# An edge affects pixels whose centres are up to half a diagonal away. Two edges closer than this affect the same
# pixels in opposite directions, so neither is drawn.
_PAIR_PX = REACH_PX - 0.5 * np.sqrt(2.0)


@dataclass(frozen=True)
class EdgeCamera:
    """Camera and viewport for selecting edges.

    Parameters
    ----------
    camera : Camera
        The camera.
    rect : PixelRect
        Pixels to draw.
    nearest_m : float
        Least camera z of the mesh.
    camera_from_target : (4, 4) array
        Homogeneous transform from the target to the camera frame.
    """

    camera: Camera
    rect: PixelRect
    nearest_m: float
    camera_from_target: FloatArray


class VisibleEdges:
    """The edges of one mesh, with those far from all others first.

    Parameters
    ----------
    edges : MeshEdges
        Edges of the mesh.
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
        # column by column, which is faster than a matrix-vector product
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

    def select(self, view: EdgeCamera, *, pairs: bool) -> tuple[IntArray, tuple[int, int]]:
        """Select edges that can be visible, lie in front of the camera, touch the window and are long enough to matter.

        Parameters
        ----------
        view : EdgeCamera
            Camera and viewport.
        pairs : bool
            True to include edges closer than `_PAIR_PX` to another in the image.

        Returns
        -------
        indices : (K,) array
            Indices of the selected edges.
        outlines : tuple of int
            With ``pairs``: number of outline edges whose first face is visible, and of those whose second one is. They
            come first in ``indices``, in this order. Zeros otherwise.
        """
        R, t = view.camera_from_target[:3, :3], view.camera_from_target[:3, 3]
        viewpoint = np.append(-R.T @ t, 1.0)
        near_m = _PAIR_PX * view.nearest_m / max(view.camera.fx_px, view.camera.fy_px)
        count = len(self._nearness_m)
        if not pairs:
            count = int(np.searchsorted(self._nearness_m, -near_m, side="right"))
        first, second, outline, creases = self._classify(viewpoint, count)
        kinds = (outline & first, outline & ~first, creases)
        if pairs:
            selected = np.concatenate([np.flatnonzero(kind) for kind in kinds])
        else:
            has_neighbour = self._beside_m[:, :count] < near_m
            if self.edges.is_closed:
                has_neighbour &= first, second
            selected = np.flatnonzero((outline | creases) & ~(has_neighbour[0] | has_neighbour[1]))
        is_hidden = hidden(self._mesh.shells, self._boxes, viewpoint, self._mesh.radius_m)
        selected = selected[~is_hidden.take(self._boxes.of.take(selected))]
        selected = selected[self._in_window(selected, view, _SHORTEST_EXACT_PX if pairs else _SHORTEST_PX)]
        if not pairs:
            return selected, (0, 0)
        first_count, second_count = (int(np.count_nonzero(kind.take(selected))) for kind in kinds[:2])
        return selected, (first_count, second_count)

    def _classify(
        self, viewpoint: FloatArray, count: int
    ) -> tuple[BoolArray, BoolArray, BoolArray, BoolArray]:
        """Classify the first ``count`` edges as seen from a viewpoint.

        Return four masks (count,): first face visible; second face visible; edge on the outline of its part; edge a
        crease of a visible face.
        """
        edges = self.edges
        first, second = (self._planes @ viewpoint > 0).take(self._faces[:, :count])
        outline = (first ^ second) | (first & self._is_border[:count])
        creases = edges.is_crease[:count] & ~outline
        if edges.is_closed:
            creases &= first
        return first, second, outline, creases

    def _in_window(self, indices: IntArray, view: EdgeCamera, shortest_px: float) -> BoolArray:
        """Return a mask of edges in front of the camera, in the window, and long enough along either axis."""
        R, t = view.camera_from_target[:3, :3], view.camera_from_target[:3, 3]
        ends = self._ends_m.take(indices, axis=1).reshape(2, 3, -1)
        x, y, z = np.moveaxis(R @ ends + t[:, None], 1, 0)
        # comparisons with NaN are false, so an edge behind the camera is dropped
        scale = 1 / np.where(z > view.nearest_m, z, np.nan)
        column, row = project_rays(view.camera, x * scale, y * scale)
        rect, pieces = view.rect, self._pieces.take(indices)
        is_inside = np.ones(len(indices), bool)
        is_long = np.zeros(len(indices), bool)
        for u, low, high in (
            (column, rect.x0 - 1, rect.x1),
            (row, rect.y0 - 1, rect.y1),
        ):
            is_long |= np.abs(u[0] - u[1]) * pieces > shortest_px
            is_inside &= (np.minimum(u[0], u[1]) < high) & (np.maximum(u[0], u[1]) > low)
        return is_inside & is_long
