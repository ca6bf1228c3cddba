"""Subdivision of a mesh into triangles with short edges, whose projections approximate lens distortion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray

_IndexArray = np.typing.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Subdivision:
    """The triangles of a subdivided mesh, and the added vertices.

    Parameters
    ----------
    parents : tuple of (K, 2) arrays
        Vertex pairs of each round of subdivision; each new vertex is the midpoint of a pair.
    triangles : (T, 3) array
        Triangles of the subdivided mesh, ordered by their original triangle.
    of : (T,) array
        Index of the original triangle.
    first : (T0 + 1,) array
        Index of the first piece of each original triangle.
    """

    parents: tuple[_IndexArray, ...]
    triangles: _IndexArray
    of: _IndexArray
    first: _IndexArray

    def extended(self, values: FloatArray | Float32Array) -> Float32Array:
        """Return values (V, n) at all vertices; a new vertex gets the mean of its two parents."""
        for pairs in self.parents:
            values = np.concatenate([values, (values[pairs[:, 0]] + values[pairs[:, 1]]) * 0.5])
        return np.asarray(values, np.float32)

    def inherited(self, values: _IndexArray) -> _IndexArray:
        """Return values (V,) at all vertices; a new vertex gets one parent's value."""
        for pairs in self.parents:
            values = np.concatenate([values, values[pairs[:, 0]]])
        return values


def subdivide(positions_m: FloatArray, triangles: _IndexArray, longest_m: float) -> Subdivision:
    """Halve edges until none is longer than ``longest_m``.

    The mesh stays watertight, because the decision depends on the edge only and is the same for both of its triangles.

    Returns
    -------
    Subdivision
        Triangles and the parents of new vertices, which follow the given ones; new positions are not kept, but
        `Subdivision.extended` makes them.
    """
    p = np.asarray(positions_m, float)
    tri = np.asarray(triangles, np.int64)
    origin = np.arange(len(tri))
    rounds: list[_IndexArray] = []
    while True:
        edges = np.stack([tri, np.roll(tri, -1, axis=1)], axis=-1)  # (T, 3, 2): edge k leaves corner k
        long = np.linalg.norm(p[edges[..., 0]] - p[edges[..., 1]], axis=-1) > longest_m
        if not long.any():
            break
        pairs, pair_index = np.unique(np.sort(edges[long], axis=-1), axis=0, return_inverse=True)
        middle = np.full(long.shape, -1)
        middle[long] = len(p) + pair_index.ravel()
        p = np.concatenate([p, (p[pairs[:, 0]] + p[pairs[:, 1]]) * 0.5])
        rounds.append(pairs)
        tri, origin = _split_edges(tri, origin, middle, long.sum(axis=1))
    order = np.argsort(origin, kind="stable")
    first = np.searchsorted(origin[order], np.arange(len(triangles) + 1))
    return Subdivision(tuple(rounds), tri[order], origin[order], first)


def _split_edges(
    tri: _IndexArray, origin: _IndexArray, middle: _IndexArray, count: _IndexArray
) -> tuple[_IndexArray, _IndexArray]:
    """Split triangles at the midpoints of one, two or three of their edges."""
    # rotate the corners so that the only split edge, or the only unsplit one, is edge 0
    turn = np.where(
        count == 1, np.argmax(middle >= 0, axis=1), np.where(count == 2, np.argmax(middle < 0, axis=1), 0)
    )
    corner_order = (turn[:, None] + np.arange(3)) % 3
    (a, b, c), (ab, bc, ca) = (
        np.take_along_axis(tri, corner_order, 1).T,
        np.take_along_axis(middle, corner_order, 1).T,
    )
    patterns = {
        0: [(a, b, c)],
        1: [(a, ab, c), (ab, b, c)],
        2: [(a, b, bc), (a, bc, ca), (ca, bc, c)],
        3: [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)],
    }
    out, owners = [], []
    for n, pieces in patterns.items():
        group = count == n
        for piece in pieces:
            out.append(np.stack([corner[group] for corner in piece], axis=1))
            owners.append(origin[group])
    return np.concatenate(out), np.concatenate(owners)
