"""Free-form bodies: creased normals, slabs, and plates wrapped on a body of revolution."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.targets.importing.repair.normals import CREASE_RAD
from tools.craft.shapes.mesh import Mesh, unit

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike

    from flyaround.simulator.runtime.arrays import FloatArray, IntArray


def creased(points_m: ArrayLike, triangles: ArrayLike, crease_rad: float = float(CREASE_RAD)) -> Mesh:
    """Return a mesh from welded triangles: every corner takes the mean normal of its smooth neighbours.

    Parameters
    ----------
    points_m : (N, 3) array
        Each corner once.
    triangles : (M, 3) array
        Counter-clockwise from outside.
    crease_rad : float, optional
        Faces that meet at more than this angle keep a sharp edge. Means are weighted by area.
    """
    p, t = np.asarray(points_m, float), np.asarray(triangles, np.int64)
    area = np.cross(p[t[:, 1]] - p[t[:, 0]], p[t[:, 2]] - p[t[:, 0]])
    flat = unit(area)
    vertex, face = t.reshape(-1), np.repeat(np.arange(len(t)), 3)
    order = np.argsort(vertex, kind="stable")
    vertex, face = vertex[order], face[order]
    start = np.searchsorted(vertex, vertex)
    count = np.searchsorted(vertex, vertex, side="right") - start
    # every pair of corners that share a vertex
    own = np.repeat(np.arange(len(vertex)), count)
    other = np.arange(len(own)) - np.repeat(np.cumsum(count) - count, count) + np.repeat(start, count)
    smooth = (flat[face[own]] * flat[face[other]]).sum(axis=1) > np.cos(crease_rad)
    total = np.zeros((len(vertex), 3))
    np.add.at(total, own[smooth], area[face[other[smooth]]])
    normals = np.empty_like(total)
    normals[order] = unit(total)
    corners = t.reshape(-1)
    key = np.column_stack([corners, np.round(normals * 1e7)]).astype(np.int64)
    _, first, index = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return Mesh(p[corners[first]], normals[first], index.reshape(-1, 3))


def slab(top_m: FloatArray, bottom_m: FloatArray) -> Mesh:
    """Return a closed body between two grids (I, J, 3); ``top_m`` is seen from outside with I x J right-handed."""
    rows, columns = top_m.shape[:2]
    k = np.arange(rows * columns).reshape(rows, columns)
    cap = _quads(k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:])
    rim = np.concatenate([k[:, 0], k[-1, 1:], k[-2::-1, -1], k[0, -2:0:-1]])
    after = np.roll(rim, -1)
    below = rows * columns
    walls = _quads(rim + below, after + below, after, rim)
    triangles = np.concatenate([cap, cap[:, ::-1] + below, walls])
    return creased(np.concatenate([top_m.reshape(-1, 3), bottom_m.reshape(-1, 3)]), triangles)


def _quads(a: IntArray, b: IntArray, c: IntArray, d: IntArray) -> IntArray:
    a, b, c, d = (np.ravel(x) for x in (a, b, c, d))
    return np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def copies(mesh: Mesh, rotations: ArrayLike, offsets_m: ArrayLike) -> Mesh:
    """Return the copies of a mesh, the k-th turned by ``rotations[k]`` (3, 3) and then moved by ``offsets_m[k]``."""
    R, d = np.asarray(rotations, float), np.asarray(offsets_m, float)
    n, size = len(d), len(mesh.positions_m)
    R = np.broadcast_to(R, (n, 3, 3))
    positions = np.einsum("kij,vj->kvi", R, mesh.positions_m) + d[:, None]
    normals = np.einsum("kij,vj->kvi", R, mesh.normals)
    triangles = mesh.triangles[None] + (size * np.arange(n))[:, None, None]
    return Mesh(positions.reshape(-1, 3), normals.reshape(-1, 3), triangles.reshape(-1, 3))


@dataclass(frozen=True, eq=False)
class Revolved:
    """The outer side of a body of revolution about z.

    Parameters
    ----------
    profile : (K, 2) array
        Radius and height [m], height growing strictly. Azimuths count from x towards y [rad].
    """

    profile: FloatArray

    @classmethod
    def from_profile(cls, profile: ArrayLike) -> Revolved:
        """Return the surface of a profile, a sequence of pairs (radius, height) [m]."""
        return cls(np.asarray(profile, float))

    def radius(self, z_m: ArrayLike) -> FloatArray:
        """Return the radius at heights ``z_m`` [m]."""
        return np.interp(np.asarray(z_m, float), self.profile[:, 1], self.profile[:, 0])

    def slope(self, z_m: ArrayLike) -> FloatArray:
        """Return the growth of the radius with height [1], by differences over 2 cm."""
        z = np.asarray(z_m, float)
        lo, hi = self.profile[0, 1], self.profile[-1, 1]
        a, b = np.clip(z - 0.01, lo, hi), np.clip(z + 0.01, lo, hi)
        return np.asarray((self.radius(b) - self.radius(a)) / (b - a))

    def point(self, azimuth_rad: ArrayLike, z_m: ArrayLike, lift_m: ArrayLike = 0.0) -> FloatArray:
        """Return the (..., 3) points ``lift_m`` above the surface, along its normal."""
        az, z = np.broadcast_arrays(np.asarray(azimuth_rad, float), np.asarray(z_m, float))
        r = self.radius(z)
        on = np.stack([r * np.cos(az), r * np.sin(az), z], axis=-1)
        return np.asarray(on + np.asarray(lift_m, float)[..., None] * self.normal(az, z))

    def normal(self, azimuth_rad: ArrayLike, z_m: ArrayLike) -> FloatArray:
        """Return the (..., 3) outward unit normals."""
        az, z = np.broadcast_arrays(np.asarray(azimuth_rad, float), np.asarray(z_m, float))
        return unit(np.stack([np.cos(az), np.sin(az), -self.slope(z)], axis=-1))

    def axes(self, azimuth_rad: float, z_m: float) -> FloatArray:
        """Return the (3, 3) rotation whose columns are eastward, up along the surface, and outward."""
        w = self.normal(azimuth_rad, z_m)
        u = np.array([-np.sin(azimuth_rad), np.cos(azimuth_rad), 0.0])
        return np.column_stack([u, np.cross(w, u), w])


def sector(
    surface: Revolved,
    azimuths_rad: tuple[float, float],
    heights_m: ArrayLike,
    lift_m: float,
    sink_m: float,
    columns: int,
) -> Mesh:
    """Return a plate over a range of azimuths, from ``sink_m`` below the surface to ``lift_m`` above it.

    ``heights_m`` are the rows of vertices, growing; ``columns`` facets lie across the azimuths.
    """
    az = np.linspace(*azimuths_rad, columns + 1)[:, None]
    z = np.asarray(heights_m, float)[None, :]
    return slab(surface.point(az, z, lift_m), surface.point(az, z, -sink_m))


def pad(
    surface: Revolved,
    azimuth_rad: float,
    z_m: float,
    half_m: tuple[float, float],
    *,
    lift_m: float = 0.005,
    sink_m: float = 0.01,
    dome_m: float = 0.0,
    exponent: float = 2.0,
    turn_rad: float = 0.0,
    relief: Callable[[FloatArray], FloatArray] | None = None,
    segments: int = 36,
    rings: int = 3,
) -> Mesh:
    """Return a rounded plate on the surface: windows, hatches, fairings.

    Parameters
    ----------
    surface : Revolved
        Surface on which the plate lies.
    azimuth_rad : float
        Azimuth of the plate's middle.
    z_m : float
        Height of the plate's middle.
    half_m : tuple of float
        Half extent round the axis and half extent along the surface.
    lift_m : float, optional
        Height of the rim.
    sink_m : float, optional
        Depth of the plate's base below the surface.
    dome_m : float, optional
        Additional height of the middle.
    exponent : float, optional
        2 an ellipse, 5 and more a rectangle with rounded corners.
    turn_rad : float, optional
        Turn on the surface.
    relief : callable, optional
        Height of what the plate lies on, above the surface, at points (N, 2) round the plate's middle.
    segments : int, optional
        Number of segments of the rim.
    rings : int, optional
        Number of rings between middle and rim.
    """
    edge = _superellipse(half_m, exponent, segments)
    rho = np.arange(1, rings + 1) / rings
    flat = (rho[:, None, None] * edge).reshape(-1, 2)
    flat = np.concatenate([[(0.0, 0.0)], flat])
    rise = lift_m + dome_m * (1 - np.concatenate([[0.0], np.repeat(rho, segments)]) ** 2)
    turn = np.array([[np.cos(turn_rad), np.sin(turn_rad)], [-np.sin(turn_rad), np.cos(turn_rad)]])
    flat = flat @ turn
    if relief is not None:
        rise = rise + relief(flat)
    z = z_m + flat[:, 1] / np.hypot(1.0, float(surface.slope(z_m)))
    az = azimuth_rad + flat[:, 0] / surface.radius(z)
    top, low = surface.point(az, z, rise), surface.point(az, z, -sink_m)
    i = np.arange(segments)
    j = (i + 1) % segments
    cap = [np.column_stack([np.zeros_like(i), 1 + i, 1 + j])]
    for k in range(rings - 1):
        a, b = 1 + k * segments, 1 + (k + 1) * segments
        cap += [np.column_stack([a + i, b + i, b + j]), np.column_stack([a + i, b + j, a + j])]
    caps = np.concatenate(cap)
    n, last = len(top), 1 + (rings - 1) * segments
    walls = [
        np.column_stack([n + last + i, n + last + j, last + j]),
        np.column_stack([n + last + i, last + j, last + i]),
    ]
    return creased(np.concatenate([top, low]), np.concatenate([caps, caps[:, ::-1] + n, *walls]))


def _superellipse(half_m: tuple[float, float], exponent: float, count: int) -> FloatArray:
    """Return the (count, 2) points of a superellipse, evenly spaced along it, none on its axes."""
    t = np.linspace(0, 2 * np.pi, 24 * count + 1)
    c, s = np.cos(t), np.sin(t)
    power = 2 / exponent
    fine = np.column_stack([np.sign(c) * np.abs(c) ** power, np.sign(s) * np.abs(s) ** power]) * half_m
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(fine, axis=0), axis=1))])
    positions = (np.arange(count) + 0.5) / count * along[-1]
    return np.column_stack([np.interp(positions, along, fine[:, k]) for k in (0, 1)])


def tiled(
    surface: Revolved, azimuths_rad: ArrayLike, heights_m: ArrayLike, tile: Mesh, lift_m: float
) -> Mesh:
    """Return the copies of a flat tile (its z outward) at every crossing of azimuths and heights, touching the
    surface.
    """
    az, z = (a.ravel() for a in np.meshgrid(np.asarray(azimuths_rad, float), np.asarray(heights_m, float)))
    w = surface.normal(az, z)
    u = np.stack([-np.sin(az), np.cos(az), np.zeros_like(az)], axis=-1)
    return copies(tile, np.stack([u, np.cross(w, u), w], axis=-1), surface.point(az, z, lift_m))
