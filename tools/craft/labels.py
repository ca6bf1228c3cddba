"""Wireframe and occluders of craft made of round bodies and plates.

A rim where a round body has a sharp edge is a polyline of straight edges between the mesh's vertices, each with the
normals of the two surfaces that meet there. Silhouettes of smooth bodies depend on the view and are not stored.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.runtime.arrays import Vec3, vec3
from flyaround.simulator.targets.importing.propose.keypoints import view_axes
from flyaround.simulator.targets.importing.repair.normals import CREASE_RAD
from flyaround.simulator.targets.model import Edge, Occluders
from tools.craft.shapes.mesh import Mesh, unit
from tools.craft.shapes.prism import signed_area

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import ArrayLike


QUARTERS = (("px", 0.0), ("py", 90.0), ("nx", 180.0), ("ny", 270.0))
"""Names and azimuths [deg] of the points of a rim that are keypoints."""
RIM_SEGMENTS = 72
"""Facets of large round bodies at full detail: a chord leaves a circle of 2 m radius by 1.9 mm at most."""


def rim_edges(
    name: str,
    z_m: float,
    radius_m: float,
    sides: Sequence[tuple[float, float]],
    *,
    segments: int = RIM_SEGMENTS,
) -> list[Edge]:
    """Return a circle about z as chords; ``sides`` are the (radial, axial) normals of the surfaces that meet there."""
    t = 2 * np.pi * np.arange(segments + 1) / segments
    p = np.column_stack([radius_m * np.cos(t), radius_m * np.sin(t), np.full(len(t), z_m)])
    p[-1] = p[0]
    pairs = unit(np.array([(*s, 0.0) for s in sides]))[:, :2]
    edges = []
    for k in range(segments):
        mid = (t[k] + t[k + 1]) / 2
        normals = tuple((float(r * np.cos(mid)), float(r * np.sin(mid)), float(a)) for r, a in pairs)
        edges.append(Edge(name=f"{name}_{k:02d}", a_m=vec3(p[k]), b_m=vec3(p[k + 1]), normals=normals))
    return edges


def box_edges(name: str, lo: Vec3, hi: Vec3) -> list[Edge]:
    """Return the twelve edges of an axis-aligned box, each with the normals of its two faces."""
    corner = np.array([lo, hi], float)
    edges = []
    for axis in range(3):
        other_axes = [k for k in range(3) if k != axis]
        for sides in itertools.product((0, 1), repeat=2):
            a, b = np.zeros(3), np.zeros(3)
            normals, label = [], ""
            for k, side in zip(other_axes, sides, strict=True):
                a[k] = b[k] = corner[side, k]
                n = np.zeros(3)
                n[k] = 2 * side - 1
                normals.append(vec3(n))
                label += ("n", "p")[side] + "xyz"[k]
            a[axis], b[axis] = corner[:, axis]
            edges.append(Edge(name=f"{name}_{label}", a_m=vec3(a), b_m=vec3(b), normals=tuple(normals)))
    return edges


def moved_edges(edges: Iterable[Edge], R: ArrayLike, offset_m: ArrayLike, prefix: str = "") -> list[Edge]:
    """Return the edges rotated by ``R`` (3, 3), which may be a reflection, then moved by ``offset_m``."""
    rotation, offset = np.asarray(R, float), np.asarray(offset_m, float)

    def place(p: Vec3) -> Vec3:
        return vec3(rotation @ np.asarray(p) + offset)

    return [
        Edge(
            name=prefix + e.name,
            a_m=place(e.a_m),
            b_m=place(e.b_m),
            normals=tuple(vec3(rotation @ np.asarray(n)) for n in e.normals),
            radius_m=e.radius_m,
        )
        for e in edges
    ]


def welded(mesh: Mesh) -> Occluders:
    """Return the mesh with each corner once and no normals."""
    vertices, index = np.unique(np.round(mesh.positions_m, 9), axis=0, return_inverse=True)
    return Occluders(vertices_m=vertices, triangles=index.reshape(-1)[mesh.triangles])


def polar(radius_m: float, azimuth_deg: float, z_m: float) -> Vec3:
    """Return a point in cylinder coordinates about z."""
    a = np.deg2rad(azimuth_deg)
    return (float(radius_m * np.cos(a)), float(radius_m * np.sin(a)), float(z_m))


def prism_edges(
    name: str,
    outline: ArrayLike,
    thickness_m: float,
    *,
    origin_m: ArrayLike = (0, 0, 0),
    u: ArrayLike = (1, 0, 0),
    v: ArrayLike = (0, 1, 0),
    crease_rad: float = float(CREASE_RAD),
) -> list[Edge]:
    """Return the edges of `prism` with the same arguments; uprights where walls meet at more than ``crease_rad``."""
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
        edges.append(edge(f"{name}_low_{k}", low[k], low[j], walls[k], -n))
        edges.append(edge(f"{name}_top_{k}", high[k], high[j], walls[k], n))
        if walls[k - 1] @ walls[k] < np.cos(crease_rad):
            edges.append(edge(f"{name}_up_{k}", low[k], high[k], walls[k - 1], walls[k]))
    return edges


def face_edges(name: str, corners_m: ArrayLike, normal: ArrayLike) -> list[Edge]:
    """Return the outline (K, 3) of a marking on a face: seen from the face's outside only."""
    p = np.asarray(corners_m, float)
    return [edge(f"{name}_{k}", p[k], p[(k + 1) % len(p)], np.asarray(normal, float)) for k in range(len(p))]


def ring_edges(
    name: str, centre_m: ArrayLike, axis: ArrayLike, radius_m: float, segments: int, *, inside: bool = False
) -> list[Edge]:
    """Return the rim of a lathe's flat end that looks along ``axis``, in the lathe's own facets.

    Parameters
    ----------
    name : str
        Common part of the edges' names.
    centre_m : (3,) array
        Centre of the rim.
    axis : (3,) array
        Outward normal of the flat end.
    radius_m : float
        Radius of the rim.
    segments : int
        Facets of the lathe at full detail.
    inside : bool, optional
        The rim of a bore, whose wall looks towards the axis.
    """
    u, v, w = view_axes(axis)
    t = 2 * np.pi * np.arange(segments + 1) / segments
    rim = np.asarray(centre_m, float) + radius_m * (np.cos(t)[:, None] * u + np.sin(t)[:, None] * v)
    middle = t[:-1] + np.pi / segments
    wall = (-1.0 if inside else 1.0) * (np.cos(middle)[:, None] * u + np.sin(middle)[:, None] * v)
    return [edge(f"{name}_{k}", rim[k], rim[k + 1], wall[k], w) for k in range(segments)]


def axis_edge(name: str, a_m: ArrayLike, b_m: ArrayLike, radius_m: float) -> Edge:
    """Return a thin rod by its axis."""
    return Edge(
        name=name, a_m=vec3(np.asarray(a_m, float)), b_m=vec3(np.asarray(b_m, float)), radius_m=radius_m
    )


def rim_point(centre_m: ArrayLike, axis: ArrayLike, radius_m: float, quarter: int) -> Vec3:
    """Return the point of a lathe's ring at a multiple of 90 degrees: a vertex at every level of detail."""
    u, v, _ = view_axes(axis)
    side = (u, v, -u, -v)[quarter % 4]
    return vec3(np.asarray(centre_m, float) + radius_m * side)


def edge(name: str, a_m: ArrayLike, b_m: ArrayLike, *normals: ArrayLike) -> Edge:
    """Return an edge between two points (3,), with the outward normals of the faces that meet there."""
    a, b = np.asarray(a_m, float), np.asarray(b_m, float)
    return Edge(
        name=name, a_m=vec3(a), b_m=vec3(b), normals=tuple(vec3(np.asarray(n, float)) for n in normals)
    )
