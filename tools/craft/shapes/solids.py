"""Boxes, rods and bodies of revolution."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.targets.importing.propose.keypoints import view_axes
from flyaround.simulator.targets.importing.repair.normals import CREASE_RAD
from tools.craft.shapes.mesh import Mesh, convex_solid, cross, following, merge, unit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike


def box(lo_m: ArrayLike, hi_m: ArrayLike, bevel_m: float = 0.0) -> Mesh:
    """Return an axis-aligned box, its edges chamfered at 45 degrees when ``bevel_m`` is positive.

    Parameters
    ----------
    lo_m : (3,) array
        Corner of minimum coordinates.
    hi_m : (3,) array
        Corner of maximum coordinates.
    bevel_m : float, optional
        Length that the chamfer takes from each face.
    """
    lo, hi = np.asarray(lo_m, float), np.asarray(hi_m, float)
    centre, half = (lo + hi) / 2, (hi - lo) / 2
    signs = np.array(list(itertools.product([-1.0, 1.0], repeat=3)))

    def corner(sign: ArrayLike, kept: int) -> np.ndarray:
        # the vertex of a corner that is on the face across axis `kept`
        inset = np.full(3, bevel_m)
        inset[kept] = 0.0
        return centre + np.asarray(sign) * (half - inset)

    faces = []
    for axis, side in itertools.product(range(3), [-1.0, 1.0]):
        ring = [s for s in signs if s[axis] == side]
        order = [ring[0], ring[1], ring[3], ring[2]]
        faces.append(np.array([corner(s, axis) for s in order]))
    if bevel_m > 0:
        for s, axis in itertools.product(signs, range(3)):
            if s[axis] < 0:
                e = s.copy()
                e[axis] = 1.0
                a, b = (k for k in range(3) if k != axis)
                faces.append(np.array([corner(s, a), corner(e, a), corner(e, b), corner(s, b)]))
        faces += [np.array([corner(s, k) for k in range(3)]) for s in signs]
    return convex_solid(faces)


def bar(a_m: ArrayLike, b_m: ArrayLike, width_m: float, depth_m: float, up: ArrayLike) -> Mesh:
    """Return a straight bar of rectangular section from ``a_m`` to ``b_m``.

    Parameters
    ----------
    a_m : (3,) array
        Centre of one end.
    b_m : (3,) array
        Centre of the other end.
    width_m : float
        Section across ``up``.
    depth_m : float
        Section along ``up`` (made perpendicular to the bar).
    up : (3,) array
        Direction of the section's depth.
    """
    a, b = np.asarray(a_m, float), np.asarray(b_m, float)
    w = unit(b - a)
    side = unit(cross(w, np.asarray(up, float)))
    rise = cross(side, w)
    ring = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    low, high = (
        np.array([p + i * side * width_m / 2 + j * rise * depth_m / 2 for i, j in ring]) for p in (a, b)
    )
    sides = [np.array([low[k], low[(k + 1) % 4], high[(k + 1) % 4], high[k]]) for k in range(4)]
    return convex_solid([low, high, *sides])


def lathe(profile: ArrayLike, origin_m: ArrayLike, axis: ArrayLike, segments: int = 24) -> Mesh:
    """Return a body of revolution: smooth round the axis, creased where the profile turns sharply.

    Parameters
    ----------
    profile : (K, 2) array
        Radius and height along the axis, walked so that the material is on the left (a closed body starts on the axis
        at the bottom and ends on it at the top).
    origin_m : (3,) array
        Point of height zero.
    axis : (3,) array
        Direction of growing height.
    segments : int, optional
        Facets round the axis.
    """
    p = np.asarray(profile, float)
    u, v, w = view_axes(axis)
    angle = 2 * np.pi * np.arange(segments) / segments
    radial = np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * v
    step = np.diff(p, axis=0)
    slope = unit(np.column_stack([step[:, 1], -step[:, 0], np.zeros(len(step))]))[:, :2]
    bands = []
    for k in range(len(step)):
        normal = [slope[k], slope[k]]
        for end, neighbour in ((0, k - 1), (1, k + 1)):
            if 0 <= neighbour < len(step):
                neighbour_slope = slope[neighbour]
            elif p[k + end, 0] == 0:
                # across the axis the surface continues as its own mirror image
                neighbour_slope = slope[k] * (-1, 1)
            else:
                continue
            if slope[k] @ neighbour_slope > np.cos(CREASE_RAD):
                blend = slope[k] + neighbour_slope
                normal[end] = blend / np.linalg.norm(blend)
        bands.append(_band(p[k], p[k + 1], normal, radial, w))
    return merge(bands).moved(origin_m)


def _band(
    low: np.ndarray, high: np.ndarray, normal: list[np.ndarray], radial: np.ndarray, w: np.ndarray
) -> Mesh:
    """Return the ring between two points of a lathe's profile."""
    n = len(radial)
    rings = [r * radial + h * w for r, h in (low, high)]
    normals = [a * radial + b * w for a, b in normal]
    i = np.arange(n)
    j = (i + 1) % n
    if low[0] == 0:
        triangles = np.column_stack([i, n + j, n + i])
        normals[0] = unit(normals[1] + following(normals[1])) if normal[0][0] else normals[0]
    elif high[0] == 0:
        triangles = np.column_stack([i, j, n + i])
        normals[1] = unit(normals[0] + following(normals[0])) if normal[1][0] else normals[1]
    else:
        triangles = np.concatenate([np.column_stack([i, j, n + j]), np.column_stack([i, n + j, n + i])])
    return Mesh(np.concatenate(rings), np.concatenate(normals), triangles)


def cone(a_m: ArrayLike, b_m: ArrayLike, radius_a_m: float, radius_b_m: float, segments: int = 24) -> Mesh:
    """Return a closed cone frustum from ``a_m`` to ``b_m``; a cylinder when the radii agree."""
    a, b = np.asarray(a_m, float), np.asarray(b_m, float)
    length = float(np.linalg.norm(b - a))
    return lathe([(0, 0), (radius_a_m, 0), (radius_b_m, length), (0, length)], a, b - a, segments)


def rod(a_m: ArrayLike, b_m: ArrayLike, radius_m: float, segments: int = 8) -> Mesh:
    """Return a closed cylinder from ``a_m`` to ``b_m``."""
    return cone(a_m, b_m, radius_m, radius_m, segments)


def dome(
    origin_m: ArrayLike, axis: ArrayLike, radius_m: float, height_m: float, segments: int = 32, rings: int = 8
) -> Mesh:
    """Return a closed cap of an ellipsoid of revolution on a flat base at ``origin_m``."""
    t = np.linspace(0, np.pi / 2, rings + 1)
    arc = [(radius_m * np.cos(x), height_m * np.sin(x)) for x in t[:-1]]
    return lathe([(0, 0), *arc, (0, height_m)], origin_m, axis, segments)


def truss(nodes_m: ArrayLike, members: Sequence[tuple[int, int]], radius_m: float, segments: int = 8) -> Mesh:
    """Return the rods between nodes (N, 3), with a ball of 1.35 radii on every node that a member reaches.

    Each rod ends inside its balls, every one at its own depth, so that no two caps share an edge.
    """
    nodes = np.asarray(nodes_m, float)
    rods = []
    for k, (i, j) in enumerate(members):
        trim = unit(nodes[j] - nodes[i]) * radius_m * (0.1 + 0.4 * k / len(members))
        rods.append(rod(nodes[i] + trim, nodes[j] - trim, radius_m, segments))
    ball = 1.35 * radius_m
    t = np.linspace(-np.pi / 2, np.pi / 2, 5)[1:-1]
    profile = [(0, -ball), *[(ball * np.cos(x), ball * np.sin(x)) for x in t], (0, ball)]
    used = sorted({k for pair in members for k in pair})
    return merge(rods + [lathe(profile, nodes[k], (0, 0, 1), segments) for k in used])
