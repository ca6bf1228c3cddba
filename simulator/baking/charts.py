"""Charts of a mesh: the flat faces of a craft, laid out in one texture atlas for baked light.

A chart is the part of a surface that lies in one plane. Its nodes form a rectangle in the atlas that includes the
borders, so interpolation never mixes neighbouring charts. A face smaller than half a texel is a single node.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from flyaround.simulator.baking.chart_cuts import cut_charts
from flyaround.simulator.geometry.plane_grid import PlaneGrid
from flyaround.simulator.geometry.triangles import face_vectors

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import BoolArray, Float32Array, FloatArray, IntArray

TEXEL = 0.032
"""Distance of the nodes, over the craft's radius."""
MAX_NODES = 250_000
"""Largest number of nodes of an atlas (64 MB of baked light per band). The distance is increased to stay below it."""
_MIN_FLAT_COSINE = 0.9999  # a chart is flat if its corner normals are this close to the face's normal
_CANDIDATES = 8  # nearest triangles that are tested for a node outside all triangles
_PAIRS_AT_ONCE = 500_000  # pairs of a node and a triangle that are tested together, in 0.1 GB
_BORDER_INSET = 0.1  # distance [texels] from the border at which border nodes are sampled


@dataclass(frozen=True, eq=False)
class Charts:
    """A mesh cut along the borders of its charts, and the nodes of its atlas.

    Parameters
    ----------
    origin : (V,) array
        Original vertex of each vertex.
    triangles : (T, 3) array
        Vertex indices.
    uv : (V, 2) array
        Atlas coordinates, 0..1.
    size_px : tuple of int
        Width and height of the atlas.
    of_triangle : (T,) array
        Chart of each triangle.
    axes : (C, 2, 3) array
        Unit vectors along a chart's nodes.
    low_m : (C, 2) array
        First node along both axes [m].
    step_m : (C, 2) array
        Spacing of the nodes along both axes [m].
    counts : (C, 2) array
        Nodes along each axis.
    first : (C,) array
        Index of the first node; the others follow, row by row.
    chart : (N,) array
        Chart of each node.
    atlas_index : (N,) array
        Index of each node in the atlas, row by row.
    places_m : (N, 3) array
        Positions of the texels [m].
    normals : (N, 3) array
        Unit normals of the texels.
    face_normals : (C, 3) array
        Normal of each chart.
    triangle : (N,) array
        Triangle that each node lies on.
    """

    origin: IntArray
    triangles: np.typing.NDArray[np.uint32]
    uv: Float32Array
    size_px: tuple[int, int]
    of_triangle: IntArray
    axes: FloatArray
    low_m: FloatArray
    step_m: FloatArray
    counts: IntArray
    first: IntArray
    chart: IntArray
    atlas_index: IntArray
    places_m: FloatArray
    normals: FloatArray
    face_normals: FloatArray
    triangle: IntArray

    def node_at(self, triangles: np.typing.NDArray[np.integer], places_m: FloatArray) -> IntArray:
        """Return (K,) nodes nearest to points (K, 3) on triangles (K,)."""
        chart = self.of_triangle[triangles]
        steps = self._steps.take(chart, axis=0)
        x, y, z = np.asarray(places_m, np.float32).T
        i, j = (
            np.rint(steps[:, k] * x + steps[:, k + 1] * y + steps[:, k + 2] * z + steps[:, k + 3])
            for k in (0, 4)
        )
        last = (self.counts - 1).astype(np.float32).take(chart, axis=0)
        i, j = np.clip(i, 0, last[:, 0]), np.clip(j, 0, last[:, 1])
        return self.first[chart] + (j * (last[:, 0] + 1) + i).astype(np.int64)

    @cached_property
    def _steps(self) -> Float32Array:
        """(C, 8) for each axis of a chart: its vector over the step, and the offset in steps."""
        affine = np.concatenate([self.axes, -self.low_m[..., None]], axis=2) / self.step_m[..., None]
        return affine.reshape(-1, 8).astype(np.float32)


def make_charts(
    positions_m: FloatArray, normals: FloatArray, groups: FloatArray, triangles: IntArray, texel_m: float
) -> Charts:
    """Cut a mesh into charts.

    Parameters
    ----------
    positions_m : (V, 3) array
        Positions of the vertices [m].
    normals : (V, 3) array
        Unit normals of the vertices.
    groups : (V,) array
        Group numbers, never mixed in one chart.
    triangles : (T, 3) array
        Vertex indices.
    texel_m : float
        Largest node spacing.
    """
    corners = positions_m[triangles]
    scaled_normals = face_vectors(corners)
    area = np.linalg.norm(scaled_normals, axis=1)
    normal = scaled_normals / np.maximum(area, 1e-30)[:, None]
    for attempt in range(20):
        chart, border = cut_charts(positions_m, groups, triangles, normal, texel_m, touching=attempt == 0)
        face, axes, low, extent, counts = _lay_out(
            corners, normals[triangles], chart, border, scaled_normals, texel_m
        )
        if int(counts.prod(axis=1).sum()) <= MAX_NODES:
            break
        texel_m *= 1.0 if attempt == 0 else 1.4
    count = len(counts)
    step = np.where(counts > 1, extent / np.maximum(counts - 1, 1), np.maximum(extent, 1e-9))
    size_px, corner = _pack_shelves(counts)
    pairs, vertex_index = np.unique(triangles.astype(np.int64) * count + chart[:, None], return_inverse=True)
    origin, owner = pairs // count, pairs % count
    offset = np.einsum("vac,vc->va", axes[owner], positions_m[origin]) - low[owner]
    node = np.where(counts[owner] > 1, offset / step[owner], 0.0)
    nodes = counts.prod(axis=1)
    first = np.concatenate([[0], np.cumsum(nodes)[:-1]])
    chart_of_node = np.repeat(np.arange(count), nodes)
    index = np.arange(nodes.sum()) - first[chart_of_node]
    i, j = index % counts[chart_of_node, 0], index // counts[chart_of_node, 0]
    atlas_index = (corner[chart_of_node, 1] + j) * size_px[0] + corner[chart_of_node, 0] + i
    inset = np.minimum(_BORDER_INSET * texel_m, 0.25 * extent)[chart_of_node]
    steps = np.stack([i, j], axis=1)
    node_uv = np.where(counts[chart_of_node] > 1, steps * step[chart_of_node], 0.5 * extent[chart_of_node])
    node_uv = low[chart_of_node] + np.clip(node_uv, inset, np.maximum(extent[chart_of_node] - inset, inset))
    # coordinates in which charts do not overlap
    shift = corner * texel_m - low
    xy = np.einsum("tac,tkc->tka", axes[chart], corners) + shift[chart, None]
    triangle, barycentric = _nearest_on_charts(
        node_uv + shift[chart_of_node], chart_of_node, xy, chart, nodes, area
    )
    smooth = np.einsum("nk,nkc->nc", barycentric, normals[triangles[triangle]])
    return Charts(
        origin=origin,
        triangles=vertex_index.reshape(triangles.shape).astype(np.uint32),
        uv=((corner[owner] + 0.5 + node) / size_px).astype(np.float32),
        size_px=size_px,
        of_triangle=chart,
        axes=axes,
        low_m=low,
        step_m=step,
        counts=counts,
        first=first,
        chart=chart_of_node,
        atlas_index=atlas_index,
        places_m=np.einsum("nk,nkc->nc", barycentric, corners[triangle]),
        normals=smooth / np.maximum(np.linalg.norm(smooth, axis=1, keepdims=True), 1e-9),
        face_normals=face,
        triangle=triangle,
    )


def _lay_out(
    corners_m: FloatArray,
    corner_normals: FloatArray,
    chart: IntArray,
    border: BoolArray,
    scaled_normals: FloatArray,
    texel_m: float,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, IntArray]:
    """Choose axes, extent and number of nodes of each chart.

    Parameters
    ----------
    corners_m : (T, 3, 3) array
        Corners of the triangles [m].
    corner_normals : (T, 3, 3) array
        Unit normals at the corners.
    chart : (T,) array
        Chart of each triangle.
    border : (T, 3) array
        True for an edge on the border of its chart.
    scaled_normals : (T, 3) array
        Normals of the triangles, whose lengths are twice the areas.
    texel_m : float
        Largest distance of nodes.

    Returns
    -------
    tuple of array
        Normal (C, 3), axes (C, 2, 3), lowest coordinates (C, 2) [m], extent (C, 2) [m] and node counts (C, 2).
    """
    count = int(chart.max()) + 1
    face: FloatArray = np.stack([np.bincount(chart, v, count) for v in scaled_normals.T], axis=1).astype(
        float
    )
    is_degenerate = np.linalg.norm(face, axis=1) < 1e-20  # slivers
    np.add.at(face, chart[is_degenerate[chart]], corner_normals[is_degenerate[chart], 0])
    face /= np.maximum(np.linalg.norm(face, axis=1, keepdims=True), 1e-30)
    axes = _axes(corners_m, border, chart, face)
    is_bent = np.any(np.einsum("tkc,tc->tk", corner_normals, face[chart]) < _MIN_FLAT_COSINE, axis=1)
    xy = np.einsum("tac,tkc->tka", axes[chart], corners_m)
    order = np.argsort(chart, kind="stable")
    start = np.searchsorted(chart[order], np.arange(count))
    low = np.minimum.reduceat(xy.min(axis=1)[order], start)
    extent = np.maximum.reduceat(xy.max(axis=1)[order], start) - low
    min_extent = np.where(np.bincount(chart, is_bent, count) > 0, 0.15, 0.5)[:, None] * texel_m
    counts = np.where(extent > min_extent, np.ceil(extent / texel_m).astype(int) + 1, 1)
    return face, axes, low, extent, counts


def _axes(corners_m: FloatArray, border: BoolArray, chart: IntArray, face: FloatArray) -> FloatArray:
    """Return the axes (C, 2, 3) of each chart, the first one along the longest edge of its border."""
    edges = np.roll(corners_m, -1, axis=1) - corners_m
    length = np.linalg.norm(edges, axis=2) * border
    longest = np.argmax(length, axis=1)
    rows = np.arange(len(corners_m))
    order = np.lexsort((length[rows, longest], chart))
    last = np.searchsorted(chart[order], np.arange(len(face)), side="right") - 1
    first = edges[rows, longest][order[last]]
    first = first - np.einsum("cx,cx->c", first, face)[:, None] * face
    first += 1e-12 * np.roll(face, 1, axis=1)
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-30)
    return np.stack([first, np.cross(face, first)], axis=1)


def _pack_shelves(counts: IntArray) -> tuple[tuple[int, int], IntArray]:
    """Pack the charts' rectangles in shelves, tallest first; return the atlas's size and the corners (C, 2)."""
    width = max(64, int(counts[:, 0].max()), int(np.sqrt(1.05 * counts.prod(axis=1).sum())))
    width = -(-width // 16) * 16
    corner = np.zeros_like(counts)
    x = y = shelf = 0
    for k in np.lexsort((-counts[:, 0], -counts[:, 1])):
        columns, rows = counts[k]
        if x + columns > width:
            x, y = 0, y + shelf
            shelf = 0
        corner[k] = x, y
        x, shelf = x + columns, max(shelf, int(rows))
    return (width, y + shelf), corner


def _nearest_on_charts(
    node_xy: FloatArray, of_node: IntArray, xy: FloatArray, chart: IntArray, nodes: IntArray, area: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Find the point of its chart that is nearest to each node: triangle (N,) and barycentric coordinates (N, 3).

    Parameters
    ----------
    node_xy : (N, 2) array
        Node coordinates.
    of_node : (N,) array
        Their charts.
    xy : (T, 3, 2) array
        Corners of the triangles.
    chart : (T,) array
        Chart of each triangle.
    nodes : (C,) array
        Number of nodes of each chart.
    area : (T,) array
        Areas of the triangles.
    """
    order = np.lexsort((-area, chart))
    largest = order[np.searchsorted(chart[order], np.arange(len(nodes)))]
    # a small chart is sampled at the centroid of its largest triangle
    triangle, barycentric = largest[of_node], np.full((len(node_xy), 3), 1 / 3)
    candidates = np.flatnonzero((nodes[chart] > 1) & (area > 1e-14))
    on_faces = np.flatnonzero((nodes > 1)[of_node] & (area[largest] > 1e-14)[of_node])
    if not len(on_faces):
        return triangle, barycentric
    corners = xy[candidates]
    grid = PlaneGrid.over(np.concatenate([corners.min(axis=1), corners.max(axis=1)], axis=1).T)
    pieces = np.searchsorted(np.cumsum(grid.counts(node_xy[on_faces])), np.arange(1, 1000) * _PAIRS_AT_ONCE)
    is_on_face = np.zeros(len(on_faces), bool)
    for piece in np.split(np.arange(len(on_faces)), np.unique(pieces)):
        node, hit = grid.at(node_xy[on_faces[piece]])
        node = piece[node]
        is_same_chart = chart[candidates[hit]] == of_node[on_faces[node]]
        node, hit = node[is_same_chart], hit[is_same_chart]
        w = _barycentric(node_xy[on_faces[node]], corners[hit])
        is_inside = w.min(axis=1) >= 0
        atlas_index = on_faces[node[is_inside]]
        triangle[atlas_index], barycentric[atlas_index], is_on_face[node[is_inside]] = (
            candidates[hit[is_inside]],
            w[is_inside],
            True,
        )
    # nodes of the rectangle that lie outside the face
    outside = on_faces[~is_on_face]
    if len(outside):
        far = 1e3 * float(np.abs(xy).max())
        middles = np.column_stack([corners.mean(axis=1), far * chart[candidates]])
        _, nearest = cKDTree(middles).query(
            np.column_stack([node_xy[outside], far * of_node[outside]]), k=_CANDIDATES
        )
        nearest = np.minimum(nearest, len(candidates) - 1)
        is_same_chart = chart[candidates[nearest]] == of_node[outside, None]
        w = _barycentric(np.repeat(node_xy[outside], _CANDIDATES, axis=0), corners[nearest.ravel()]).reshape(
            -1, _CANDIDATES, 3
        )
        best = np.argmax(np.where(is_same_chart, w.min(axis=2), -np.inf), axis=1)
        row = np.arange(len(outside))
        w = np.clip(w[row, best], 0, None)
        triangle[outside], barycentric[outside] = (
            candidates[nearest[row, best]],
            w / w.sum(axis=1, keepdims=True),
        )
    return triangle, barycentric


def _barycentric(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the (K, 3) barycentric coordinates of points (K, 2) in triangles (K, 3, 2)."""
    a, b, c = (corners[:, k] - points for k in range(3))
    w = np.stack([_cross_2d(b, c), _cross_2d(c, a), _cross_2d(a, b)], axis=1)
    return np.asarray(w / w.sum(axis=1, keepdims=True))


def _cross_2d(p: FloatArray, q: FloatArray) -> FloatArray:
    return np.asarray(p[..., 0] * q[..., 1] - p[..., 1] * q[..., 0])
