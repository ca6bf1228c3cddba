"""A mesh projected once for many visibility queries from a viewpoint or along a direction.

Nearness is the inverse depth from a viewpoint, or the distance towards a light at infinity. It is linear along
triangles and edges on the plane of projection. A grid of cells lists the triangles that touch each cell, so that a
query tests few of them.

References
----------
Franklin (1980), A linear time exact hidden surface algorithm: the uniform grid on the screen.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.geometry.directions import view_basis
from flyaround.simulator.geometry.plane_grid import PlaneGrid

if TYPE_CHECKING:
    from flyaround.simulator.geometry.mesh import TriangleMesh
    from flyaround.simulator.runtime.arrays import BoolArray, FloatArray, IntArray

NEAR_M = 1e-3  # near plane: points closer than this, or behind the camera, have no projection
# Twice the projected area below which a triangle is edge-on and hides nothing: on the plane z = 1, and for a light at
# infinity [m2].
EDGE_ON_AREA, EDGE_ON_AREA_M2 = 1e-15, 1e-12
MIN_INTERVAL = 1e-6  # shortest visible interval, as a share of the edge; shorter ones are due to rounding


@dataclass(frozen=True, eq=False)
class ProjectedMesh:
    """The triangles of a mesh on a plane of projection, with their nearness.

    Parameters
    ----------
    x : (3, M) array
        x of the triangles' corners on the plane of projection.
    y : (3, M) array
        y of the corners.
    near : (3, M) array
        Nearness of the corners.
    edge_on_area : float
        Twice the area below which a triangle counts as edge-on.
    """

    x: FloatArray
    y: FloatArray
    near: FloatArray
    edge_on_area: float

    @cached_property
    def _bounds(self) -> FloatArray:
        """(4, M) low x, low y, high x, high y of each triangle."""
        return np.stack([_smallest(self.x), _smallest(self.y), _largest(self.x), _largest(self.y)])

    @cached_property
    def _nearest(self) -> FloatArray:
        return _largest(self.near)

    @cached_property
    def _discs(self) -> FloatArray:
        """(3, M) centre x, y and radius of each triangle's bounding disc."""
        low, high = self._bounds[:2], self._bounds[2:]
        return np.concatenate([(low + high) / 2, np.hypot(*(high - low))[None] / 2])

    @cached_property
    def _planes(self) -> FloatArray:
        return _planes(self.x, self.y, self.near, self.edge_on_area)

    @cached_property
    def _grid(self) -> PlaneGrid:
        return PlaneGrid.over(self._bounds)

    def hides(self, points: FloatArray, near: FloatArray) -> BoolArray:
        """Return True for the points (K, 2) that triangles hide; ``near`` (K,) is the nearness of the points.

        Returns
        -------
        (K,) array of bool
            True where a triangle covers a point and is nearer there; edge-on triangles hide nothing.
        """
        point, triangle = self._grid.at(points)
        planes = _planes(self.x[:, triangle], self.y[:, triangle], self.near[:, triangle], self.edge_on_area)
        a, b, c = planes.transpose(1, 0, 2)
        nearness, *sides = a * points[point, 0] + b * points[point, 1] + c
        hidden = np.zeros(len(points), bool)
        hidden[point[(nearness > near[point]) & (np.min(sides, axis=0) >= 0)]] = True
        return hidden

    def visible_intervals(self, ends: FloatArray, near: FloatArray) -> list[tuple[tuple[float, float], ...]]:
        """Return the visible intervals of 0..1 of each edge, in order.

        Parameters
        ----------
        ends : (E, 2, 2) array
            End points.
        near : (E, 2) array
            Nearness of the ends.

        Returns
        -------
        list of tuple
            Pairs of start and end, 0 to 1, for each edge.
        """
        if len(ends) == 0:
            return []
        edge, triangle = self._grid.along(ends)
        edge, triangle = self._cull_pairs(edge, triangle, ends, near.min(axis=1))
        first, last = np.zeros(len(edge)), np.ones(len(edge))
        way, rise = ends[:, 1] - ends[:, 0], near[:, 1] - near[:, 0]
        start, along = ends[edge, 0].T, way[edge].T
        for k in range(4):
            a, b, c = (coefficient[triangle] for coefficient in self._planes[k])
            value, slope = a * start[0] + b * start[1] + c, a * along[0] + b * along[1]
            if k == 0:
                value, slope = value - near[edge, 0], slope - rise[edge]
            _clip_interval(first, last, value, slope)
            nonempty = np.flatnonzero(last > first)
            edge, triangle, first, last = edge[nonempty], triangle[nonempty], first[nonempty], last[nonempty]
            start, along = start[:, nonempty], along[:, nonempty]
        return _uncovered_intervals(len(ends), edge, first, last)

    def _cull_pairs(
        self, edge: IntArray, triangle: IntArray, ends: FloatArray, farthest: FloatArray
    ) -> tuple[IntArray, IntArray]:
        """Return the pairs whose triangle may cross the edge's line and be nearer than ``farthest`` (E,)."""
        direction = ends[:, 1] - ends[:, 0]
        normal = np.stack([-direction[:, 1], direction[:, 0]]) / np.maximum(np.hypot(*direction.T), 1e-300)
        offset = (normal * ends[:, 0].T).sum(axis=0)
        x, y, radius = (values[triangle] for values in self._discs)
        distance = np.abs(normal[0][edge] * x + normal[1][edge] * y - offset[edge])
        candidates = np.flatnonzero((distance <= radius + 1e-12) & (self._nearest[triangle] > farthest[edge]))
        return edge[candidates], triangle[candidates]


def project_to_pinhole(mesh: TriangleMesh, R: FloatArray, t: FloatArray) -> ProjectedMesh:
    """Project a mesh on the plane z = 1 of a pinhole camera. Nearness is the inverse of depth [m-1].

    Back faces of closed shells are omitted unless the mesh reaches the camera's plane, because then a ray may leave a
    shell that it did not enter in front of the camera.

    Parameters
    ----------
    mesh : TriangleMesh
        Mesh of the target.
    R : (3, 3) array
        Rotation from the mesh's frame to the camera frame.
    t : (3,) array
        Translation from the mesh's frame to the camera frame [m].

    Returns
    -------
    ProjectedMesh
        Triangles in the plane z = 1.
    """
    ends = R[2] @ mesh.box_m + t[2]
    corners = mesh.corners_m
    if ends.min() > NEAR_M:
        corners = corners[:, :, mesh.facing(np.append(-R.T @ t, 1.0))]
    x, y, z = (R @ corners.reshape(3, -1)).reshape(corners.shape) + t[:, None, None]
    if ends.min() <= NEAR_M:
        x, y, z = _clip_to_near_plane(np.stack([x, y, z]))
    near = 1 / z
    return ProjectedMesh(x * near, y * near, near, EDGE_ON_AREA)


def project_along(mesh: TriangleMesh, direction: tuple[float, float, float]) -> ProjectedMesh:
    """Project a mesh orthographically along a unit vector.

    Returns
    -------
    ProjectedMesh
        Triangles in the axes of `view_basis` without the back faces of closed shells; nearness is the distance along
        the vector [m].
    """
    corners = mesh.corners_m[:, :, mesh.facing(np.append(direction, 0.0))]
    x, y, near = (view_basis(direction) @ corners.reshape(3, -1)).reshape(corners.shape)
    return ProjectedMesh(x, y, near, EDGE_ON_AREA_M2)


def _clip_to_near_plane(corners: FloatArray) -> FloatArray:
    """Clip triangles (3, 3, M), indexed by axis and corner, against z = NEAR_M; a clipped one yields one or two."""
    ahead = corners[2] > NEAR_M
    count = ahead.sum(axis=0)
    pieces = [corners[:, :, count == 3]]
    for is_single, n in ((True, 1), (False, 2)):
        selected = np.flatnonzero(count == n)
        # rotate the corners so that the single corner on one side of the plane is first
        order = (np.argmax(ahead[:, selected] == is_single, axis=0) + np.arange(3)[:, None]) % 3
        a, b, c = corners[:, order, selected].transpose(1, 0, 2)
        ab, ac = (a + (NEAR_M - a[2]) / (other[2] - a[2]) * (other - a) for other in (b, c))
        clipped = [(a, ab, ac)] if is_single else [(ab, b, c), (ab, c, ac)]
        pieces += [np.stack(triangle, axis=1) for triangle in clipped]
    return np.concatenate(pieces, axis=2)


def _smallest(corners: FloatArray) -> FloatArray:
    return np.asarray(np.minimum(np.minimum(corners[0], corners[1]), corners[2]))


def _largest(corners: FloatArray) -> FloatArray:
    return np.asarray(np.maximum(np.maximum(corners[0], corners[1]), corners[2]))


def _planes(x: FloatArray, y: FloatArray, near: FloatArray, edge_on_area: float) -> FloatArray:
    """Return (4, 3, M) coefficients of a x + b y + c: nearness, then scaled distance from each side, positive inside.

    Nearness is minus infinity for edge-on triangles.
    """
    area = (x[1] - x[0]) * (y[2] - y[0]) - (y[1] - y[0]) * (x[2] - x[0])
    edge_on = np.abs(area) <= edge_on_area
    scale = 1 / np.where(edge_on, 1.0, area)
    planes = np.empty((4, 3, len(area)))
    d1, d2 = (near[1] - near[0]) * scale, (near[2] - near[0]) * scale
    planes[0, 0] = d1 * (y[2] - y[0]) - d2 * (y[1] - y[0])
    planes[0, 1] = d2 * (x[1] - x[0]) - d1 * (x[2] - x[0])
    planes[0, 2] = near[0] - planes[0, 0] * x[0] - planes[0, 1] * y[0]
    planes[0, 2, edge_on] = -np.inf
    turn = np.sign(area)
    for k in range(3):
        j = (k + 1) % 3
        planes[1 + k, 0] = turn * (y[k] - y[j])
        planes[1 + k, 1] = turn * (x[j] - x[k])
        planes[1 + k, 2] = -planes[1 + k, 0] * x[k] - planes[1 + k, 1] * y[k]
    return planes


def _clip_interval(first: FloatArray, last: FloatArray, value: FloatArray, slope: FloatArray) -> None:
    """Shrink [first, last] in place to where ``value + s slope >= 0``."""
    with np.errstate(divide="ignore", invalid="ignore"):
        root = -value / slope
    np.maximum(first, root, out=first, where=slope > 0)
    np.minimum(last, root, out=last, where=slope < 0)
    last[((slope == 0) & (value < 0)) | (value == -np.inf)] = -1.0


def _uncovered_intervals(
    n_edges: int, edge: IntArray, first: FloatArray, last: FloatArray
) -> list[tuple[tuple[float, float], ...]]:
    """Return, for each edge, [0, 1] minus the union of its intervals ``first`` to ``last`` (N,)."""
    # an empty interval at 1 closes each edge
    edge, ones = np.concatenate([edge, np.arange(n_edges)]), np.ones(n_edges)
    first, last = np.concatenate([first, ones]), np.concatenate([last, ones])
    order = np.lexsort((first, edge))
    edge, first, last = edge[order], first[order], last[order]
    # running maximum of the interval ends, by rank so that edges stay apart
    by_value = np.argsort(last, kind="stable")
    rank = np.empty(len(last), np.int64)
    rank[by_value] = np.arange(len(last))
    farthest = np.maximum.accumulate(edge * len(last) + rank)
    covered_to = np.concatenate([[0.0], last[by_value[farthest - edge * len(last)]][:-1]])
    covered_to[np.flatnonzero(np.diff(edge, prepend=-1))] = 0.0
    gaps = np.flatnonzero(first - covered_to > MIN_INTERVAL)
    visible: list[list[tuple[float, float]]] = [[] for _ in range(n_edges)]
    for k, a, b in zip(edge[gaps].tolist(), covered_to[gaps].tolist(), first[gaps].tolist(), strict=True):
        visible[k].append((a, b))
    return [tuple(intervals) for intervals in visible]
