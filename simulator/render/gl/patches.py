"""A mesh cut in advance into small triangles and drawn in small lots, for lenses that bend it.

Two limits ask for it. A tessellator cuts an edge into 64 pieces at most. And Mesa's software driver counts the corners
that one draw call makes in 16 bits (version 22.3: more come out as torn surfaces), so no call may make too many.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import moderngl
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from simulator.runtime.arrays import Float32Array, FloatArray

MOST_PIECES = 16
"""Pieces of an edge that the GPU makes at most; so many corners a triangle as 256 of them stay below 2^16."""
LOT = 256
EDGE_SHARE = 1 / 16
"""Longest edge after the cut, over the radius of the mesh."""

_IndexArray = np.typing.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Cut:
    """How a mesh was cut.

    Parameters
    ----------
    parents : per round, (K, 2) vertices whose middle each new vertex is. triangles : (T, 3) of the cut mesh, in the
        order of the triangles that they come from. first : (T0 + 1,) where the pieces of each of those begin.
    """

    parents: tuple[_IndexArray, ...]
    triangles: _IndexArray
    first: _IndexArray

    def extended(self, values: FloatArray | Float32Array) -> Float32Array:
        """Values (V, n) at the vertices, with those at the new ones: the mean of their two parents."""
        for pairs in self.parents:
            values = np.concatenate([values, (values[pairs[:, 0]] + values[pairs[:, 1]]) * 0.5])
        return np.asarray(values, np.float32)


def cut(positions_m: FloatArray, triangles: _IndexArray, longest_m: float) -> Cut:
    """Halve every edge longer than ``longest_m`` until there is none; neighbours stay joined.

    Whether an edge is halved depends on the edge alone, and the middle of two points is the same from either side.
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
        pairs, which = np.unique(np.sort(edges[long], axis=-1), axis=0, return_inverse=True)
        middle = np.full(long.shape, -1)
        middle[long] = len(p) + which.ravel()
        p = np.concatenate([p, (p[pairs[:, 0]] + p[pairs[:, 1]]) * 0.5])
        rounds.append(pairs)
        tri, origin = _halved(tri, origin, middle, long.sum(axis=1))
    order = np.argsort(origin, kind="stable")
    first = np.searchsorted(origin[order], np.arange(len(triangles) + 1))
    return Cut(tuple(rounds), tri[order], first)


def _halved(
    tri: _IndexArray, origin: _IndexArray, middle: _IndexArray, count: _IndexArray
) -> tuple[_IndexArray, _IndexArray]:
    """Triangles with the middles of one, two or three of their edges put in."""
    # turned so that a lone halved edge, or a lone whole one, is edge 0
    turn = np.where(
        count == 1, np.argmax(middle >= 0, axis=1), np.where(count == 2, np.argmax(middle < 0, axis=1), 0)
    )
    at = (turn[:, None] + np.arange(3)) % 3
    (a, b, c), (ab, bc, ca) = np.take_along_axis(tri, at, 1).T, np.take_along_axis(middle, at, 1).T
    patterns = {
        0: [(a, b, c)],
        1: [(a, ab, c), (ab, b, c)],
        2: [(a, b, bc), (a, bc, ca), (ca, bc, c)],
        3: [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)],
    }
    out, owners = [], []
    for n, pieces in patterns.items():
        chosen = count == n
        for piece in pieces:
            out.append(np.stack([corner[chosen] for corner in piece], axis=1))
            owners.append(origin[chosen])
    return np.concatenate(out), np.concatenate(owners)


class PatchArray:
    """A vertex array of a cut mesh that is drawn like the one of the mesh itself, lot by lot.

    Parameters
    ----------
    buffers : that the array reads and nothing else does.
    """

    def __init__(self, array: moderngl.VertexArray, made: Cut, buffers: Sequence[moderngl.Buffer]) -> None:
        self._array, self._cut, self._buffers = array, made, tuple(buffers)

    def render(self, mode: int | None = None, vertices: int = -1, *, first: int = 0) -> None:
        """Draw; ``first`` and ``vertices`` count indices of the mesh before it was cut."""
        last = len(self._cut.first) - 1 if vertices < 0 else (first + vertices) // 3
        begin, end = int(self._cut.first[first // 3]), int(self._cut.first[last])
        for start in range(begin, end, LOT):
            count = min(LOT, end - start)
            self._array.render(
                moderngl.PATCHES if mode is None else mode, vertices=3 * count, first=3 * start
            )

    def release(self) -> None:
        """Free the vertex array and its buffers."""
        self._array.release()
        for buffer in self._buffers:
            buffer.release()
