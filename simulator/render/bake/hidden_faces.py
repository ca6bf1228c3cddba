"""Hidden-face removal: cuts from a mesh what its own convex bodies cover from every viewpoint.

A closed convex body that touches a face covers a convex piece of it. Whatever comes from outside to that piece goes
through the body first, so the piece need not be drawn: a large hidden face takes a rasteriser as long as a seen one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from simulator.render.bake.coplanar_decals import HIGHEST
from simulator.render.bake.occluders import MARGIN

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from simulator.render.bake.occluders import ConvexShell
    from simulator.runtime.arrays import BoolArray, Float32Array, FloatArray, IntArray

_LEAST_FACE = 0.15  # of the square of the radius: the strips left over cost more than smaller faces
_LEAST_SHARE = 0.3  # of a face that must be covered
_TOUCH = 2e-6  # of the radius: nearer is upon it
_MOST_TRIANGLES = 200_000  # of a finer mesh none are looked for inside its bodies
_OPPOSED = 1 - 1e-6
_RIM = 0.002  # of a triangle's height, kept along its sides: neighbours' corners stay where they were


@dataclass(frozen=True, eq=False)
class ExposedFaces:
    """A mesh's triangles less the pieces that lie under other bodies.

    Parameters
    ----------
    kept : (K,) numbers of the triangles that are drawn as they were.
    of : (P,) triangle that each new one is a piece of. shares : (P, 3, 3) barycentric coordinates of its corners there.
    """

    kept: IntArray
    of: IntArray
    shares: FloatArray

    def extended(self, values: Float32Array, triangles: NDArray[np.integer]) -> Float32Array:
        """(V + 3 P, n) a value per vertex, those of the pieces' corners behind the mesh's own (V, n)."""
        at = np.einsum("pkc,pcn->pkn", self.shares, values[triangles[self.of]].astype(float))
        return np.concatenate([values, at.reshape(-1, values.shape[1]).astype(np.float32)])

    def sources(self, triangles: NDArray[np.integer], n_vertices: int) -> IntArray:
        """(V + 3 P,) a vertex of the mesh on the same face as each of `extended`: for what is one value to a part."""
        return np.concatenate([np.arange(n_vertices), np.repeat(triangles[self.of, 0], 3)])

    def triangles(self, triangles: NDArray[np.integer], n_vertices: int) -> NDArray[np.uint32]:
        """(K + P, 3) corners of what is drawn, by their numbers in `extended`."""
        new = n_vertices + np.arange(3 * len(self.of)).reshape(-1, 3)
        return np.concatenate([triangles[self.kept], new]).astype(np.uint32)


def remove_hidden_faces(
    corners_m: FloatArray, bodies: Sequence[ConvexShell], radius_m: float
) -> ExposedFaces:
    """Cuts from the large triangles of a closed mesh what its convex bodies cover.

    Parameters
    ----------
    corners_m : (T, 3, 3) of the mesh, target frame. bodies : of it, from `occluders.convex_bodies`.
    radius_m : of the craft's bounding sphere.
    """
    across = np.cross(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 0])
    double = np.linalg.norm(across, axis=1)
    large = np.flatnonzero(double > 2 * _LEAST_FACE * radius_m**2)
    best = {t: (_LEAST_SHARE * double[t] / 2, np.empty((0, 3))) for t in large}
    for shell in bodies:
        for t in large[_may_cover(shell, corners_m[large], across[large] / double[large, None], radius_m)]:
            covered = _covered_piece(corners_m[t], shell, radius_m)
            if (area := _area(covered @ corners_m[t])) > best[t][0]:
                best[t] = area, covered
    cut = [t for t in large if len(best[t][1])]
    pieces = [_triangulate_around(best[t][1]) for t in cut]
    kept = np.ones(len(corners_m), bool)
    kept[cut] = False
    return ExposedFaces(
        np.flatnonzero(kept),
        np.repeat(np.array(cut, int), [len(some) for some in pieces]),
        np.array([piece for some in pieces for piece in some], float).reshape(-1, 3, 3),
    )


def inside_bodies(corners_m: FloatArray, bodies: Sequence[ConvexShell], radius_m: float) -> BoolArray:
    """(T,) triangles of a closed mesh that lie in one of its convex bodies, or upon it and look into it.

    Screws' feet, the ends of struts: nobody outside sees them. Bodies thinner than `coplanar_decals.HIGHEST` hide
    nothing here: coarse shadow maps may leave them out, and need what lies under them. What reaches an edge of the
    body stays: a neighbour may meet the body along that edge, and a raster's rounding of corners opens single pixels
    between the two.

    Parameters
    ----------
    corners_m : (T, 3, 3), target frame. bodies : of the mesh. radius_m : of the craft's bounding sphere.
    """
    found = np.zeros(len(corners_m), bool)
    if len(corners_m) > _MOST_TRIANGLES:
        return found
    touch = _TOUCH * radius_m
    low, high = (np.ascontiguousarray(f(corners_m, axis=1).T) for f in (np.min, np.max))
    across = np.cross(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 0])
    for body in bodies:
        ends = body.ends_m.reshape(-1, 3)
        if -(ends @ body.planes[:, :3].T + body.planes[:, 3]).min(axis=0).max() < HIGHEST * radius_m:
            continue
        near = (low[0] > ends[:, 0].min() - touch) & (high[0] < ends[:, 0].max() + touch)
        for axis in (1, 2):
            near &= low[axis] > ends[:, axis].min() - touch
            near &= high[axis] < ends[:, axis].max() + touch
        some = np.flatnonzero(near)
        away = corners_m[some] @ body.planes[:, :3].T + body.planes[:, 3]
        # its own faces, and such as are flush with them, look the way they do
        upon = np.abs(away) < touch
        shows = upon.all(axis=1) & (across[some] @ body.planes[:, :3].T > 0)
        at_edge = (upon.sum(axis=2) > 1).any(axis=1)
        found[some] |= (away.max(axis=(1, 2)) < touch) & ~shows.any(axis=1) & ~at_edge
    return found


def _may_cover(shell: ConvexShell, corners_m: FloatArray, normals: FloatArray, radius_m: float) -> BoolArray:
    """(L,) whether a shell may cover something of triangles (L, 3, 3): some of each is inside of every face's plane.

    Or upon it and looking into the body: then it is neither the body's own face nor flush with one.
    """
    away = corners_m @ shell.planes[:, :3].T + shell.planes[:, 3]
    upon = np.abs(away).max(axis=1) < _TOUCH * radius_m
    into = normals @ shell.planes[:, :3].T < -_OPPOSED
    inside = away.min(axis=1) < -MARGIN * radius_m
    return np.asarray(np.where(upon, into, inside).all(axis=1))


def _covered_piece(corners_m: FloatArray, shell: ConvexShell, radius_m: float) -> FloatArray:
    """(N, 3) barycentric corners of what a shell covers of a triangle, none where that is nothing."""
    piece = np.eye(3)
    for k in range(3):
        piece = _clip_polygon(piece, _RIM - piece[:, k])
    for away in (corners_m @ shell.planes[:, :3].T + shell.planes[:, 3]).T:
        if np.abs(away).max() >= _TOUCH * radius_m and len(piece):
            piece = _clip_polygon(piece, piece @ away + MARGIN * radius_m)
    return piece


def _clip_polygon(polygon: FloatArray, away: FloatArray) -> FloatArray:
    """Clips a convex polygon (N, n) to where a value given at its corners is negative (Sutherland-Hodgman)."""
    out = []
    for k in range(len(polygon)):
        last, a, b = polygon[k - 1], away[k - 1], away[k]
        if (a < 0) != (b < 0):
            out.append(last + (polygon[k] - last) * (a / (a - b)))
        if b < 0:
            out.append(polygon[k])
    return np.array(out).reshape(-1, polygon.shape[1])


def _area(polygon_m: FloatArray) -> float:
    """Area of a flat polygon (N, 3); of fewer than three corners none."""
    if len(polygon_m) < 3:
        return 0.0
    fan = polygon_m[1:] - polygon_m[0]
    return float(np.linalg.norm(np.cross(fan[:-1], fan[1:]).sum(axis=0)) / 2)


def _triangulate_around(hole: FloatArray) -> list[FloatArray]:
    """Ear clipping of a triangle with a convex hole: barycentric triangles (3, 3), wound as the triangle is."""
    ring = _bridge_hole(hole)
    pieces: list[FloatArray] = []
    while len(ring) > 3:
        for k in range(len(ring)):
            ear = np.array([ring[k - 1], ring[k], ring[(k + 1) % len(ring)]])
            others = [p for j, p in enumerate(ring) if j not in {(k - 1) % len(ring), k, (k + 1) % len(ring)}]
            if np.linalg.det(ear) > 0 and not any(_point_in_ear(ear, p) for p in others):
                break
        else:
            raise AssertionError("a polygon without an ear")
        pieces.append(ear)
        del ring[k]
    pieces.append(np.array(ring))
    return pieces


def _bridge_hole(hole: FloatArray) -> list[FloatArray]:
    """The triangle and its hole as one polygon: joined by a seam between their nearest corners."""
    outer, inner = list(np.eye(3)), list(hole[::-1])
    away = np.linalg.norm(hole[::-1][None] - np.eye(3)[:, None], axis=2)
    i, j = (int(n) for n in np.unravel_index(np.argmin(away), away.shape))
    return [*outer[: i + 1], *inner[j:], *inner[: j + 1], *outer[i:]]


def _point_in_ear(ear: FloatArray, point: FloatArray) -> bool:
    """Whether a point lies strictly inside a triangle."""
    if np.abs(ear - point).max(axis=1).min() < 1e-12:
        return False
    turns = [np.linalg.det(np.array([ear[k - 1], ear[k], point])) for k in range(3)]
    return min(turns) >= 0
