"""Coarse convex bodies that represent the craft in visibility tests and as its silhouette.

Each connected piece starts as one convex hull. The hull with the largest empty area is split by the plane for which the
hulls of both halves are smallest; this is repeated. The outline must be close to the craft's, because background inside
it would make a correct pose seem wrong.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from flyaround.simulator.geometry.directions import sphere_directions
from flyaround.simulator.geometry.topology import MeshBody
from flyaround.simulator.runtime.arrays import FloatArray, IntArray
from flyaround.simulator.targets.importing.propose.surface_points import surface_points
from flyaround.simulator.targets.model import Occluders

POINTS = 120_000  # surface points
HULL_POINTS = 1500
"""Number of points of a hull during the search for splits."""
MAX_PIECES = 40
MAX_TRIANGLES = 600
"""Largest number of bodies and of their triangles. The estimator tests rays against all of them: more follow
the outline better, and take proportionally longer."""
MIN_PIECE_SHARE = 0.0015
"""Share of the mean silhouette of the craft's convex hull below which a piece is dropped."""
HULL_TOLERANCE = 0.01
"""Empty area of a piece's hull, as a share of the summed silhouettes of all pieces, below which no hull is split."""
CUT_POSITIONS = (0.15, 0.3, 0.4, 0.5, 0.6, 0.7, 0.85)
"""Positions of a cut along a piece, as shares of its length."""
SIDE_PX = 48
VIEWS = sphere_directions(14)[:7]
"""Largest number of cells along the grid that measures how much of its hull a piece fills, and directions of the views:
half of the sphere, because a silhouette from behind is the same."""
HULL_DIRECTIONS = (64, 40, 26, 14, 10)
"""Directions of a hull's vertices; the largest set within the triangle budget is used."""
ENCLOSED_SHARE, ENCLOSED_DISTANCE = 0.97, 0.008
"""Share of a piece's points that lie within a larger hull, up to a distance of this share of the craft, if it is
dropped: cells on a panel, fittings on a plate."""
MAX_EMPTY_SHARE = 0.15
"""Empty share of a hull's silhouette up to which the hull stands for its piece when smaller ones are dropped."""
LINE_WIDTH, SHEET_THICKNESS = 1e-3, 2e-3
"""Second extent below which points are a line, without a silhouette, and thickness given to flat sheets [extents]."""
MAX_CUT_RATIO = 1.3
"""Silhouette of both halves over that of the whole: with more, a cut goes through the middle of a body. Two halves of a
cube have 1.33."""
OCCLUDER_SCALE = 0.99
"""Scale of occluders, slightly below 1 so that they do not hide edges on their own surface."""


@dataclass(frozen=True, eq=False)
class _Leaf:
    """A set of surface points and its convex hull's silhouette.

    Attributes
    ----------
    points : (N, 3) array
        Surface points [m].
    shadow : float
        Area of the hull's silhouette, averaged over directions [m2].
    excess : float
        Part of that area that the points leave empty [m2].
    """

    points: FloatArray
    shadow: float
    excess: float


def propose_occluders(bodies: list[MeshBody], extent: float) -> Occluders:
    """Propose convex bodies of at most `MAX_TRIANGLES` triangles in total whose outline approximates the craft's."""
    surface = surface_points(bodies, POINTS)
    order = np.argsort(surface.piece, kind="stable")
    ends = np.searchsorted(surface.piece[order], np.arange(surface.pieces + 1))
    hull_silhouette = _mean_silhouette(surface.points_m)
    leaves = [
        leaf
        for a, b in itertools.pairwise(ends.tolist())
        if (leaf := _leaf(surface.points_m[order[a:b]], extent, MIN_PIECE_SHARE * hull_silhouette))
        is not None
    ]
    leaves = _drop_enclosed(sorted(leaves, key=lambda x: -x.shadow), extent)[: 2 * MAX_PIECES]
    total = sum(x.shadow for x in leaves)
    while leaves and len(leaves) < MAX_PIECES:
        largest = max(leaves, key=lambda x: x.excess)
        if largest.excess < HULL_TOLERANCE * total:
            break
        leaves.remove(largest)
        halves = _cut(largest, extent)
        # a piece that cannot be cut is not tried again
        leaves += halves if len(halves) == 2 else [_Leaf(largest.points, largest.shadow, 0.0)]
    leaves = sorted(leaves, key=lambda x: -x.shadow)[:MAX_PIECES]
    return _join(leaves)


def _join(leaves: list[_Leaf]) -> Occluders:
    """Join the leaves' hulls; their number of vertices is the largest within the triangle budget."""
    for fineness in HULL_DIRECTIONS:
        directions = sphere_directions(fineness)
        hulls = [h for leaf in leaves if (h := _hull(_extremes(leaf.points, directions))) is not None]
        if sum(len(h.simplices) for h in hulls) <= MAX_TRIANGLES:
            break
    vertices: list[FloatArray] = []
    triangles: list[IntArray] = []
    count = 0
    for hull in hulls:
        v, t = _outward(hull)
        if count + len(t) > MAX_TRIANGLES:
            continue
        middle = (v.min(axis=0) + v.max(axis=0)) / 2
        triangles.append(t + sum(len(x) for x in vertices))
        vertices.append(middle + OCCLUDER_SCALE * (v - middle))
        count += len(t)
    if not vertices:
        return Occluders()
    return Occluders(vertices_m=np.concatenate(vertices), triangles=np.concatenate(triangles))


def _extremes(points: FloatArray, directions: FloatArray) -> FloatArray:
    """Return the extreme points in each direction and towards the corners of the box, so that boxes keep corners."""
    corners = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    size = np.maximum(np.ptp(points, axis=0), 1e-9)
    # directions are scaled by the bounding box, so that a plate is sampled like a cube
    reach = (points / size) @ np.concatenate([corners, directions]).T
    return points[np.unique(np.argmax(reach, axis=0))]


def _leaf(points: FloatArray, extent: float, smallest: float = 0.0) -> _Leaf | None:
    """Return a set of points with the silhouette of its hull; None for lines and points. Sheets are thickened."""
    if len(points) < 4:
        return None
    hull = _hull(points)
    if hull is None:
        low, high = points.min(axis=0), points.max(axis=0)
        if np.sort(high - low)[1] < LINE_WIDTH * extent:
            return None
        points = _thicken(points, SHEET_THICKNESS * extent)
        hull = _hull(points)
        if hull is None:
            return None
    # Cauchy: the mean silhouette of a convex body is a quarter of its surface
    shadow = float(hull.area) / 4
    if shadow <= smallest:
        return None
    return _Leaf(points, shadow, shadow * (1 - _filled_share(points, hull)))


def _thicken(points: FloatArray, thickness: float) -> FloatArray:
    """Return a flat sheet's points offset to both sides."""
    normal = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][2]
    return np.concatenate([points + normal * thickness / 2, points - normal * thickness / 2])


def _filled_share(points: FloatArray, hull: ConvexHull) -> float:
    """Return the share of its hull's silhouette that a set of points fills, averaged over views."""
    n_occupied = n_inside = 0
    for view in VIEWS:
        helper = np.eye(3)[int(np.argmin(np.abs(view)))]
        x = np.cross(helper, view)
        axes = np.stack([x / np.linalg.norm(x), np.cross(view, x / np.linalg.norm(x))])
        projected = points @ axes.T
        low, size = projected.min(axis=0), max(float(np.ptp(projected, axis=0).max()), 1e-12)
        # so coarse that the points leave no gaps
        side = int(np.clip(np.sqrt(len(points)) / 3, 4, SIDE_PX))
        cells = np.unique(np.minimum(((projected - low) / size * side).astype(int), side - 1) @ (side, 1))
        grid = np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), -1).reshape(-1, 2)
        outline = _hull(projected[hull.vertices])
        if outline is None:
            continue
        cell_positions = low + (grid + 0.5) / side * size
        is_inside = (
            cell_positions @ outline.equations[:, :2].T + outline.equations[:, 2] <= 0.5 * size / side
        ).all(axis=1)
        n_occupied += np.isin(grid[is_inside] @ (side, 1), cells).sum()
        n_inside += is_inside.sum()
    return float(n_occupied / max(n_inside, 1))


def _cut(leaf: _Leaf, extent: float) -> list[_Leaf]:
    """Split the leaf by the axis-aligned plane for which both hulls together are smallest."""
    p = leaf.points
    step = max(1, len(p) // HULL_POINTS)
    sample = p[::step]
    best, choice = np.inf, (0, 0.0)
    low, high = p.min(axis=0), p.max(axis=0)
    for axis in range(3):
        for share in CUT_POSITIONS:
            level = low[axis] + share * (high[axis] - low[axis])
            area = 0.0
            for side in (sample[sample[:, axis] <= level], sample[sample[:, axis] > level]):
                hull = _hull(side)
                area += np.inf if hull is None else float(hull.area)
            if area < best:
                best, choice = area, (axis, level)
    # Cauchy: the mean silhouette of a convex body is a quarter of its surface
    if not np.isfinite(best) or best / 4 > leaf.shadow * MAX_CUT_RATIO:
        return []
    axis, level = choice
    halves = [_leaf(p[p[:, axis] <= level], extent), _leaf(p[p[:, axis] > level], extent)]
    return [h for h in halves if h is not None]


def _drop_enclosed(leaves: list[_Leaf], extent: float) -> list[_Leaf]:
    """Drop the leaves within the hull of a larger one: cells on a panel, fittings on a plate."""
    kept: list[_Leaf] = []
    planes: list[FloatArray] = []
    for leaf in leaves:
        sample = leaf.points[:: max(1, len(leaf.points) // 60)]
        is_enclosed = any(
            ((sample @ e[:, :3].T + e[:, 3]).max(axis=1) < ENCLOSED_DISTANCE * extent).mean() > ENCLOSED_SHARE
            for e in planes
        )
        if is_enclosed:
            continue
        kept.append(leaf)
        hull = _hull(leaf.points)
        # only a leaf that fills its hull hides others
        if hull is not None and leaf.excess < MAX_EMPTY_SHARE * leaf.shadow:
            planes.append(hull.equations)
    return kept


def _mean_silhouette(points: FloatArray) -> float:
    hull = _hull(points)
    return 0.0 if hull is None else float(hull.area) / 4


def _hull(points: FloatArray) -> ConvexHull | None:
    """Return the convex hull, or None if the points are coplanar or collinear."""
    if len(points) <= points.shape[1]:
        return None
    try:
        return ConvexHull(points)
    except (QhullError, ValueError):
        return None


def _outward(hull: ConvexHull) -> tuple[FloatArray, IntArray]:
    vertices, index = np.unique(hull.simplices, return_inverse=True)
    vertices_m, triangles = np.asarray(hull.points[vertices]), index.reshape(-1, 3)
    normals = np.cross(
        vertices_m[triangles[:, 1]] - vertices_m[triangles[:, 0]],
        vertices_m[triangles[:, 2]] - vertices_m[triangles[:, 0]],
    )
    is_inverted = np.einsum("ij,ij->i", normals, hull.equations[:, :3]) < 0
    triangles[is_inverted] = triangles[is_inverted][:, ::-1]
    return vertices_m, triangles.astype(np.int64)
