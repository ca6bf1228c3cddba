"""Meshes and points put on a craft: a plane's axes, mirror images, rings of copies."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.runtime.arrays import FloatArray, Vec3, vec3

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from tools.craft.assemble import Piece
    from tools.craft.shapes.mesh import Mesh

X: Vec3 = (1.0, 0.0, 0.0)
Y: Vec3 = (0.0, 1.0, 0.0)
Z: Vec3 = (0.0, 0.0, 1.0)


def placed(mesh: Mesh, origin_m: ArrayLike, u: ArrayLike, v: ArrayLike) -> Mesh:
    """Return the mesh with its x axis along ``u``, its y along ``v`` (orthonormal) and its origin at ``origin_m``."""
    return mesh.rotated(_columns(u, v)).moved(origin_m)


def placed_pieces(pieces: Sequence[Piece], origin_m: ArrayLike, u: ArrayLike, v: ArrayLike) -> list[Piece]:
    """Return all pieces of an assembly, placed together."""
    return [replace(p, mesh=placed(p.mesh, origin_m, u, v)) for p in pieces]


def placed_point(point_m: ArrayLike, origin_m: ArrayLike, u: ArrayLike, v: ArrayLike) -> Vec3:
    """Return a point of an assembly (3,), in the frame in which the assembly was placed."""
    return vec3(_columns(u, v) @ np.asarray(point_m, float) + np.asarray(origin_m, float))


def turn_z(angle_rad: float) -> FloatArray:
    """Return the (3, 3) rotation about z."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def both_sides(mesh: Mesh, axis: int) -> list[Mesh]:
    """Return the mesh and its mirror image across ``axis``."""
    return [mesh, mesh.mirrored(axis)]


def _columns(u: ArrayLike, v: ArrayLike) -> FloatArray:
    a, b = np.asarray(u, float), np.asarray(v, float)
    return np.column_stack([a, b, np.cross(a, b)])
