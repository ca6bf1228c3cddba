"""Lattices of solar cells on a mesh: each maps a point to the column and row of its cell."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from flyaround.simulator.geometry.topology import components

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray, IntArray

MAX_LATTICES = (
    16  # each takes four vectors of uniforms, and a test of every pixel in shaders/craft/cells.glsl
)

_MIN_CELLS = 4  # fewer cells form no lattice
_WELD_M = 1e-5  # vertices closer than this are one
_ROW_TOLERANCE_M = 1e-3  # largest difference along an axis between centres of one row
_MAX_PITCH_M = 0.3  # larger pieces of dark glass are windows or lenses
_PITCH_TOLERANCE = 0.02  # largest deviation from an even pitch, as a share of the pitch
# cells share a plane if normal and distance [m], times these factors, round to the same integers
_PLANE_STEPS = (
    50,
    200,
)


def cell_lattices(positions_m: FloatArray, triangles: IntArray) -> FloatArray:
    """Find lattices of solar cells, at most ``MAX_LATTICES``: those with the most cells.

    Parameters
    ----------
    positions_m : (V, 3) array
        Vertices [m].
    triangles : (T, 3) array
        Triangles of cells only; each cell is a connected component.

    Returns
    -------
    (K, 4, 4) array
        Rows 0 and 1 map a point (x, y, z, 1) [m] to its column and row, starting at 0. Row 2 maps it to its distance
        from the plane of the cells [m]. Row 3 holds the number of columns, the number of rows and the two pitches [m];
        the pitch of the columns is the larger one.
    """
    welded, vertex = np.unique(
        np.rint(positions_m[triangles].reshape(-1, 3) / _WELD_M).astype(np.int64), axis=0, return_inverse=True
    )
    points, corners = welded * _WELD_M, vertex.reshape(-1, 3)
    links = np.concatenate([corners[:, :2], corners[:, 1:]])
    count, component = components(links, len(points))
    if count < _MIN_CELLS:
        return np.zeros((0, 4, 4))
    order = np.argsort(component, kind="stable")
    starts = np.searchsorted(component[order], np.arange(count))
    # centres of bounding boxes, because cells with cropped corners have another mean
    lowest, highest = (end.reduceat(points[order], starts) for end in (np.minimum, np.maximum))
    centre = (lowest + highest) / 2
    offset = points - centre[component]
    spread = np.stack(
        [np.bincount(component, offset[:, i] * offset[:, j]) for i in range(3) for j in range(3)], axis=1
    )
    normal = np.linalg.eigh(spread.reshape(-1, 3, 3))[1][:, :, 0]
    normal *= np.sign(normal[np.arange(count), np.abs(normal).argmax(axis=1)])[:, None]
    distance = np.einsum("kc,kc->k", normal, centre)
    keys = np.column_stack([np.rint(normal * _PLANE_STEPS[0]), np.rint(distance * _PLANE_STEPS[1])])
    _, plane = np.unique(keys, axis=0, return_inverse=True)
    lattices: list[tuple[int, FloatArray]] = []
    for k in range(plane.max() + 1):
        members = np.flatnonzero(plane.ravel() == k)
        if len(members) >= _MIN_CELLS:
            lattices += _lattices_in_plane(
                centre[members], normal[members[0]], points[component == members[0]]
            )
    lattices.sort(key=lambda one: -one[0])
    return np.array([lattice for _, lattice in lattices[:MAX_LATTICES]]).reshape(-1, 4, 4)


def _lattices_in_plane(
    centre: FloatArray, normal: FloatArray, cell: FloatArray
) -> list[tuple[int, FloatArray]]:
    """Find the lattices of one plane.

    Parameters
    ----------
    centre : (K, 3) array
        Centres of the plane's cells [m].
    normal : (3,) array
        Unit normal of the plane.
    cell : (C, 3) array
        Corners of one of the cells [m].

    Returns
    -------
    list of tuple
        Number of cells and (4, 4) lattice of each.
    """
    _, nearest = cKDTree(centre).query(centre[0], k=2)
    first, second = np.asarray(nearest, int)
    u = centre[second] - centre[first]
    u -= (u @ normal) * normal
    u /= np.linalg.norm(u)
    axes = (u, np.cross(normal, u))
    runs = [_even_runs(centre @ axis, float(np.ptp(cell @ axis))) for axis in axes]
    lattices = []
    for run_pair in itertools.product(*runs):
        lattice, inside = np.zeros((4, 4)), np.ones(len(centre), bool)
        for k, (axis, (first, pitch, number)) in enumerate(zip(axes, run_pair, strict=True)):
            lattice[k] = [*(axis / pitch), 0.5 - first / pitch]
            lattice[3, [k, 2 + k]] = number, pitch
            index = centre @ lattice[k, :3] + lattice[k, 3]
            inside &= (index > 0) & (index < number)
        lattice[2] = [*normal, -float((centre @ normal).mean())]
        if lattice[3, 2] < lattice[3, 3]:
            lattice[:2], lattice[3] = lattice[1::-1].copy(), lattice[3, [1, 0, 3, 2]]
        if inside.sum() >= _MIN_CELLS and lattice[3, 2:].max() < _MAX_PITCH_M:
            lattices.append((int(inside.sum()), lattice))
    return lattices


def _even_runs(positions: FloatArray, width_m: float) -> list[tuple[float, float, int]]:
    """Split positions along an axis into runs of even pitch.

    Return first position, pitch and number of rows of each run. The pitch of a single row is ``width_m``.
    """
    rows = np.sort(positions)
    rows = rows[np.append(True, np.diff(rows) > _ROW_TOLERANCE_M)]
    gaps = np.diff(rows)
    if not len(gaps):
        return [(float(rows[0]), width_m, 1)]
    pitch = float(np.median(gaps))
    ends = np.flatnonzero(np.abs(gaps - pitch) > _PITCH_TOLERANCE * pitch) + 1
    return [(float(part[0]), pitch, len(part)) for part in np.split(rows, ends)]
