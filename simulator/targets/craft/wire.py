"""Wireframes of common bodies: edges with the outward normals of the faces that meet there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.runtime.arrays import Vec3, vec3
from flyaround.simulator.targets.builders.mesh import across, unit
from flyaround.simulator.targets.builders.prism import signed_area
from flyaround.simulator.targets.builders.solids import CREASE_RAD
from flyaround.simulator.targets.model import Edge

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flyaround.simulator.runtime.arrays import FloatArray


def prism_edges(
    name: str,
    outline: ArrayLike,
    thickness_m: float,
    *,
    origin_m: ArrayLike = (0, 0, 0),
    u: ArrayLike = (1, 0, 0),
    v: ArrayLike = (0, 1, 0),
) -> list[Edge]:
    """Edges of `builders.prism.prism` with the same arguments; uprights only where the outline has a crease."""
    flat = np.asarray(outline, float)
    flat = flat if signed_area(flat) > 0 else flat[::-1]
    axes = np.stack([np.asarray(u, float), np.asarray(v, float)])
    n = np.cross(axes[0], axes[1])
    low = np.asarray(origin_m, float) + flat @ axes
    high = low + n * thickness_m
    side = np.roll(flat, -1, axis=0) - flat
    walls = unit(np.column_stack([side[:, 1], -side[:, 0]])) @ axes
    edges = []
    for k in range(len(flat)):
        j = (k + 1) % len(flat)
        edges.append(_edge(f"{name}_low_{k}", low[k], low[j], walls[k], -n))
        edges.append(_edge(f"{name}_top_{k}", high[k], high[j], walls[k], n))
        if walls[k - 1] @ walls[k] < np.cos(CREASE_RAD):
            edges.append(_edge(f"{name}_up_{k}", low[k], high[k], walls[k - 1], walls[k]))
    return edges


def face_edges(name: str, corners_m: ArrayLike, normal: ArrayLike) -> list[Edge]:
    """Outline (K, 3) of a marking on a face: seen from the face's outside only."""
    p = np.asarray(corners_m, float)
    return [_edge(f"{name}_{k}", p[k], p[(k + 1) % len(p)], np.asarray(normal, float)) for k in range(len(p))]


def ring_edges(
    name: str, centre_m: ArrayLike, axis: ArrayLike, radius_m: float, segments: int, *, inside: bool = False
) -> list[Edge]:
    """Rim of a lathe's flat end that looks along ``axis``, in the lathe's own facets.

    Parameters
    ----------
    segments : those of the lathe at full detail.
    inside : the rim of a bore, whose wall looks towards the axis.
    """
    u, v, w = across(axis)
    t = 2 * np.pi * np.arange(segments + 1) / segments
    rim = np.asarray(centre_m, float) + radius_m * (np.cos(t)[:, None] * u + np.sin(t)[:, None] * v)
    middle = t[:-1] + np.pi / segments
    wall = (-1.0 if inside else 1.0) * (np.cos(middle)[:, None] * u + np.sin(middle)[:, None] * v)
    return [_edge(f"{name}_{k}", rim[k], rim[k + 1], wall[k], w) for k in range(segments)]


def axis_edge(name: str, a_m: ArrayLike, b_m: ArrayLike, radius_m: float) -> Edge:
    """A thin rod by its axis."""
    return Edge(
        name=name, a_m=vec3(np.asarray(a_m, float)), b_m=vec3(np.asarray(b_m, float)), radius_m=radius_m
    )


def rim_point(centre_m: ArrayLike, axis: ArrayLike, radius_m: float, quarter: int) -> Vec3:
    """The point of a lathe's ring at a multiple of 90 degrees: a vertex at every level of detail."""
    u, v, _ = across(axis)
    side = (u, v, -u, -v)[quarter % 4]
    return vec3(np.asarray(centre_m, float) + radius_m * side)


def _edge(name: str, a: FloatArray, b: FloatArray, *normals: FloatArray) -> Edge:
    return Edge(name=name, a_m=vec3(a), b_m=vec3(b), normals=tuple(vec3(n) for n in normals))
