"""Plates: a polygon with holes, triangulated by ear clipping and extruded to a closed prism."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.targets.importing.repair.normals import CREASE_RAD
from tools.craft.shapes.mesh import Mesh, cross, following, merge, preceding, unit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from flyaround.simulator.runtime.arrays import FloatArray, IntArray


def circle(centre: ArrayLike, radius: float, segments: int = 24) -> FloatArray:
    """Return the (segments, 2) points of a circle, counter-clockwise."""
    t = 2 * np.pi * np.arange(segments) / segments
    return np.asarray(centre, float) + radius * np.column_stack([np.cos(t), np.sin(t)])


def rectangle(lo: ArrayLike, hi: ArrayLike) -> FloatArray:
    """Return the (4, 2) corners of an axis-aligned rectangle, counter-clockwise."""
    (x0, y0), (x1, y1) = np.asarray(lo, float), np.asarray(hi, float)
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def signed_area(polygon: FloatArray) -> float:
    """Return the area of a polygon (K, 2), positive when counter-clockwise."""
    x, y = polygon.T
    return float(0.5 * np.sum(x * following(y) - y * following(x)))


def triangulate(outline: FloatArray, holes: Sequence[FloatArray] = ()) -> IntArray:
    """Return the triangles of a polygon with holes, as indices into outline and holes stacked in order.

    Parameters
    ----------
    outline : (K, 2) array
        Counter-clockwise.
    holes : sequence of (L, 2) array, optional
        Each, clockwise.

    Raises
    ------
    ValueError
        If the outlines cross each other.

    References
    ----------
    Eberly (2002), Triangulation by ear clipping: holes are joined to the outline by bridges.
    """
    points = np.concatenate([outline, *holes])
    loop = list(range(len(outline)))
    starts = np.cumsum([len(outline)] + [len(h) for h in holes])
    rings = [list(range(starts[k], starts[k] + len(h))) for k, h in enumerate(holes)]
    # the hole that reaches furthest right is bridged first, so that bridges never cross
    for ring in sorted(rings, key=lambda r: -points[r, 0].max()):
        first = int(np.argmax(points[ring, 0]))
        turned = ring[first:] + ring[:first]
        bridge = _bridge(points, loop, turned[0], rings)
        loop = [*loop[: bridge + 1], *turned, turned[0], *loop[bridge:]]
    triangles = _clip_ears(points, loop)
    area = _turn(*(points[triangles[:, k]] for k in range(3))) / 2
    expected = signed_area(outline) + sum(signed_area(h) for h in holes)
    if area.min() <= 0 or abs(area.sum() - expected) > 1e-9 * expected:
        raise ValueError("the outline of the plate crosses itself or its holes")
    return triangles


def _bridge(points: FloatArray, loop: list[int], start: int, rings: list[list[int]]) -> int:
    """Return the position in ``loop`` of the nearest vertex that ``start`` sees."""
    edges = [(a, b) for a, b in zip(loop, loop[1:] + loop[:1], strict=True)]
    for ring in rings:
        edges += list(zip(ring, ring[1:] + ring[:1], strict=True))
    a, b = (points[[e[k] for e in edges]] for k in (0, 1))
    p = points[start]
    for candidate in np.argsort(np.linalg.norm(points[loop] - p, axis=1)):
        q = points[loop[candidate]]
        crossing = (_turn(p, q, a) * _turn(p, q, b) < 0) & (_turn(a, b, p) * _turn(a, b, q) < 0)
        before, after = points[loop[candidate - 1]], points[loop[(candidate + 1) % len(loop)]]
        if not crossing.any() and _in_wedge(before, q, after, p):
            return int(candidate)
    raise ValueError("a hole of the plate cannot be joined to its outline: do they cross?")


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return twice the signed area of triangle ``a b c``."""
    return np.asarray(
        (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])
    )


def _in_wedge(before: FloatArray, corner: FloatArray, after: FloatArray, p: FloatArray) -> bool:
    """Return True if ``p`` lies in the inner angle of the corner ``before at after``."""
    is_left, is_right = _turn(before, corner, p) >= 0, _turn(corner, after, p) >= 0
    return bool(is_left and is_right) if _turn(before, corner, after) >= 0 else bool(is_left or is_right)


def _clip_ears(points: FloatArray, loop: list[int]) -> IntArray:
    scale, places = float(np.ptp(points, axis=0).max()) ** 2, points.tolist()
    triangles = []
    while len(loop) > 3:
        corners = points[loop]
        a, c = preceding(corners), following(corners)
        area = _turn(a, corners, c)
        sides = [((p - q) ** 2).sum(axis=1) for p, q in ((a, corners), (corners, c), (c, a))]
        # fat ears first: slivers shade badly
        quality = np.where(area > 1e-12 * scale, area / np.maximum.reduce(sides), 0.0)
        best = next((k for k in np.argsort(-quality, kind="stable") if _is_ear(places, loop, k)), -1)
        if best < 0 or quality[best] <= 0:
            raise ValueError("the outline of the plate crosses itself")
        triangles.append((loop[best - 1], loop[best], loop[(best + 1) % len(loop)]))
        loop = loop[:best] + loop[best + 1 :]
    triangles.append((loop[0], loop[1], loop[2]))
    return np.asarray(triangles, np.int64)


def _is_ear(places: list[list[float]], loop: list[int], k: int) -> bool:
    """Return True if no other corner of a loop lies in the triangle of its corner k and both neighbours.

    Parameters
    ----------
    places : list of list of float
        (x, y) of each point: a few numbers at a time are quicker as they are than as arrays.
    loop : list of int
        Indices of the points of the polygon, in order.
    k : int
        Index of the corner in ``loop``.
    """
    ear = (loop[k - 1], loop[k], loop[(k + 1) % len(loop)])
    corners = [places[n] for n in ear]
    sides = [(*a, b[0] - a[0], b[1] - a[1]) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
    for n in loop:
        if n in ear or places[n] in corners:  # a bridge has its ends twice
            continue
        px, py = places[n]
        if all(dx * (py - y) - dy * (px - x) >= 0 for x, y, dx, dy in sides):
            return False
    return True


def prism(
    outline: ArrayLike,
    thickness_m: float,
    *,
    holes: Sequence[ArrayLike] = (),
    origin_m: ArrayLike = (0, 0, 0),
    u: ArrayLike = (1, 0, 0),
    v: ArrayLike = (0, 1, 0),
) -> Mesh:
    """Return a closed plate: a polygon in the plane ``origin + a u + b v``, thickened along ``u x v``.

    Parameters
    ----------
    outline : (K, 2) array
        Polygon in plane coordinates [m], of either orientation.
    thickness_m : float
        Distance between the two caps; the first cap lies in the plane.
    holes : sequence of (L, 2) array, optional
        Polygons inside the outline [m].
    origin_m : (3,) array, optional
        Origin of the plane coordinates.
    u : (3,) array, optional
        First axis of the plane, of unit length.
    v : (3,) array, optional
        Second axis of the plane, of unit length, perpendicular to ``u``.
    """
    rim = _oriented(outline, 1.0)
    inner = [_oriented(h, -1.0) for h in holes]
    flat = np.concatenate([rim, *inner])
    cut = triangulate(rim, inner)
    axes = np.stack([np.asarray(u, float), np.asarray(v, float)])
    n = cross(axes[0], axes[1])
    low = np.asarray(origin_m, float) + flat @ axes
    high = low + n * thickness_m
    caps = [Mesh(high, np.tile(n, (len(flat), 1)), cut), Mesh(low, np.tile(-n, (len(flat), 1)), cut[:, ::-1])]
    walls, start = [], 0
    for ring in (rim, *inner):
        rows = slice(start, start + len(ring))
        walls.append(_wall(low[rows], high[rows], ring, axes))
        start += len(ring)
    return merge([*caps, *walls])


def _oriented(polygon: ArrayLike, sign: float) -> FloatArray:
    p = np.asarray(polygon, float)
    return p if signed_area(p) * sign > 0 else p[::-1]


def _wall(low: FloatArray, high: FloatArray, ring: FloatArray, axes: FloatArray) -> Mesh:
    side = following(ring) - ring
    flat = unit(np.column_stack([side[:, 1], -side[:, 0], np.zeros(len(side))]))[:, :2]
    smooth = (flat * preceding(flat)).sum(axis=1) > np.cos(CREASE_RAD)
    joined = flat + preceding(flat)
    # at a smooth corner k the walls k-1 and k share a normal
    corner = np.where(smooth[:, None], joined / np.maximum(np.linalg.norm(joined, axis=1), 1e-9)[:, None], 0)
    start = np.where(smooth[:, None], corner, flat)
    end = np.where(following(smooth)[:, None], following(corner), flat)
    k = len(ring)
    positions = np.concatenate([low, following(low), following(high), high])
    normals = np.concatenate([start, end, end, start]) @ axes
    i = np.arange(k)
    triangles = np.concatenate(
        [np.column_stack([i, i + k, i + 2 * k]), np.column_stack([i, i + 2 * k, i + 3 * k])]
    )
    return Mesh(positions, normals, triangles)


def clipped_rectangle(width_m: float, height_m: float, clip_m: float, clipped: str) -> FloatArray:
    """Return the corners of a rectangle about the origin with two or four of its corners cut at 45 degrees.

    Parameters
    ----------
    width_m : float
        Size along x.
    height_m : float
        Size along y.
    clip_m : float
        Length of a cut along each side.
    clipped : str
        ``"top"``, ``"bottom"`` (a half wafer) or ``"all"``.
    """
    x, y = width_m / 2, height_m / 2
    low = [(-x, -y + clip_m), (-x + clip_m, -y), (x - clip_m, -y), (x, -y + clip_m)]
    high = [(x, y - clip_m), (x - clip_m, y), (-x + clip_m, y), (-x, y - clip_m)]
    if clipped == "top":
        low = [(-x, -y), (x, -y)]
    elif clipped == "bottom":
        high = [(x, y), (-x, y)]
    return np.array(low + high)


def cell_grid(
    centres_x_m: ArrayLike, centres_y_m: ArrayLike, outline: ArrayLike, z_m: float, thickness_m: float
) -> Mesh:
    """Return the tiles of one outline (K, 2) at every crossing of the two lists of centres, lying at ``z_m``."""
    tile = prism(outline, thickness_m)
    xs, ys = np.asarray(centres_x_m, float), np.asarray(centres_y_m, float)
    return merge([tile.moved((x, y, z_m)) for y in ys for x in xs])
