"""Lattices of solar cells on a mesh, which map a point to a cell and a position within it."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from flyaround.simulator.geometry.topology import components

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray, IntArray

MOST_LATTICES = 16
_LEAST_CELLS = 4  # fewer cells form no lattice
_WELD_M = 1e-5
_SAME_M = 1e-3  # largest difference along an axis between centres of one row
_LARGEST_M = 0.3  # largest pitch of a cell; larger dark glass is a window or a lens
_EVEN = 0.02  # irregularity allowed in the rows of one lattice, as a share of the pitch
# steps of a normal's components, and of a plane's distance to a metre, that tell planes apart
_PLANE = (
    50,
    200,
)


def cell_lattices(positions_m: FloatArray, triangles: IntArray) -> FloatArray:
    """Return (K, 4, 4) lattices, at most ``MOST_LATTICES``: those with the most cells.

    Rows 0 and 1 map a point (x, y, z, 1) [m] to its column and row, starting at 0; row 2 to its distance from the plane
    of the cells [m]; row 3 holds the number of columns and rows, and the two pitches [m]. The larger pitch is that of
    the columns.

    Parameters
    ----------
    positions_m : (V, 3) array
        Vertices.
    triangles : (T, 3) array
        Triangles of cells only, each cell a connected component.
    """
    welded, vertex = np.unique(
        np.rint(positions_m[triangles].reshape(-1, 3) / _WELD_M).astype(np.int64), axis=0, return_inverse=True
    )
    places, corners = welded * _WELD_M, vertex.reshape(-1, 3)
    links = np.concatenate([corners[:, :2], corners[:, 1:]])
    count, piece = components(links, len(places))
    if count < _LEAST_CELLS:
        return np.zeros((0, 4, 4))
    order = np.argsort(piece, kind="stable")
    starts = np.searchsorted(piece[order], np.arange(count))
    # centres of bounding boxes: the mean of a cell's corners is elsewhere if corners are cut
    low, high = (end.reduceat(places[order], starts) for end in (np.minimum, np.maximum))
    centre = (low + high) / 2
    off = places - centre[piece]
    spread = np.stack([np.bincount(piece, off[:, i] * off[:, j]) for i in range(3) for j in range(3)], axis=1)
    normal = np.linalg.eigh(spread.reshape(-1, 3, 3))[1][:, :, 0]
    normal *= np.sign(normal[np.arange(count), np.abs(normal).argmax(axis=1)])[:, None]
    height = np.einsum("kc,kc->k", normal, centre)
    keys = np.column_stack([np.rint(normal * _PLANE[0]), np.rint(height * _PLANE[1])])
    _, plane = np.unique(keys, axis=0, return_inverse=True)
    lattices: list[tuple[int, FloatArray]] = []
    for k in range(plane.max() + 1):
        own = np.flatnonzero(plane.ravel() == k)
        if len(own) >= _LEAST_CELLS:
            lattices += _of_plane(centre[own], normal[own[0]], places[piece == own[0]])
    lattices.sort(key=lambda one: -one[0])
    return np.array([lattice for _, lattice in lattices[:MOST_LATTICES]]).reshape(-1, 4, 4)


def _of_plane(centre: FloatArray, normal: FloatArray, cell: FloatArray) -> list[tuple[int, FloatArray]]:
    """Return (number of cells, lattice) pairs of one plane; ``cell`` holds the corners of one of its cells."""
    _, near = cKDTree(centre).query(centre[0], k=2)
    first, second = np.asarray(near, int)
    u = centre[second] - centre[first]
    u -= (u @ normal) * normal
    u /= np.linalg.norm(u)
    axes = (u, np.cross(normal, u))
    runs = [_runs(centre @ axis, float(np.ptp(cell @ axis))) for axis in axes]
    out = []
    for each in itertools.product(*runs):
        rows, inside = np.zeros((4, 4)), np.ones(len(centre), bool)
        for k, (axis, (first, pitch, number)) in enumerate(zip(axes, each, strict=True)):
            rows[k] = [*(axis / pitch), 0.5 - first / pitch]
            rows[3, [k, 2 + k]] = number, pitch
            at = centre @ rows[k, :3] + rows[k, 3]
            inside &= (at > 0) & (at < number)
        rows[2] = [*normal, -float((centre @ normal).mean())]
        if rows[3, 2] < rows[3, 3]:
            rows[:2], rows[3] = rows[1::-1].copy(), rows[3, [1, 0, 3, 2]]
        if inside.sum() >= _LEAST_CELLS and rows[3, 2:].max() < _LARGEST_M:
            out.append((int(inside.sum()), rows))
    return out


def _runs(at: FloatArray, wide_m: float) -> list[tuple[float, float, int]]:
    """Return first position, pitch and number of evenly spaced rows; the pitch of a single row is its width."""
    rows = np.sort(at)
    rows = rows[np.append(True, np.diff(rows) > _SAME_M)]
    gaps = np.diff(rows)
    if not len(gaps):
        return [(float(rows[0]), wide_m, 1)]
    pitch = float(np.median(gaps))
    ends = np.flatnonzero(np.abs(gaps - pitch) > _EVEN * pitch) + 1
    return [(float(part[0]), pitch, len(part)) for part in np.split(rows, ends)]
