"""A uniform grid over a plane: the triangles whose projections may cover a point or cross an edge.

References
----------
Franklin (1980), A linear time exact hidden surface algorithm: the uniform grid on the screen.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray, IntArray

# Mean number of triangles in a cell of the grid; chosen for speed.
TRIANGLES_PER_CELL = 20
MAX_CELLS = 64  # per side: cell indices fit 16 bits, which sort fastest


@dataclass(frozen=True, eq=False)
class PlaneGrid:
    """Cells that list the triangles whose bounds touch them.

    Parameters
    ----------
    low : (2,) array
        Lower corner of the grid.
    per_cell : (2,) array
        Cells per unit of x and y.
    side : int
        Number of cells per row and column.
    first : array
        (side^2 + 1,) start of each cell's triangles in ``listed``, row by row.
    listed : array
        Triangle indices.
    """

    low: FloatArray
    per_cell: FloatArray
    side: int
    first: IntArray
    listed: IntArray

    @staticmethod
    def over(bounds: FloatArray) -> PlaneGrid:
        """Build a grid over boxes (4, M): low x, low y, high x, high y.

        Returns
        -------
        PlaneGrid
            Grid over all boxes; ``listed`` holds the boxes of each cell in their given order.
        """
        n = bounds.shape[1]
        side = int(np.clip(np.sqrt(n / TRIANGLES_PER_CELL), 1, MAX_CELLS))
        low, span = np.zeros(2), np.ones(2)
        if n:
            low = bounds[:2].min(axis=1)
            span = bounds[2:].max(axis=1) - low
        per_cell = side / np.maximum(span, 1e-12)
        left, top, right, bottom = _cells(
            (bounds - np.tile(low, 2)[:, None]) * np.tile(per_cell, 2)[:, None], side
        )
        n_columns = right - left + 1
        count = n_columns * (bottom - top + 1)
        triangle = np.repeat(np.arange(n), count)
        offset = _concatenated_ranges(np.zeros(n, np.int64), count, triangle)
        cell = (
            (top * side + left)[triangle]
            + offset // n_columns[triangle] * side
            + offset % n_columns[triangle]
        )
        order = np.argsort(cell.astype(np.uint16), kind="stable")
        first = np.concatenate([[0], np.cumsum(np.bincount(cell, minlength=side * side))])
        return PlaneGrid(low, per_cell, side, first, triangle[order])

    def counts(self, points: FloatArray) -> IntArray:
        """Count the triangles in the cells of points (K, 2).

        Returns
        -------
        (K,) array of int
            Number of triangles whose boxes touch the point's cell. A point outside the grid counts in the nearest cell.
        """
        cell = self._cell(points)
        return np.asarray(self.first[cell + 1] - self.first[cell])

    def at(self, points: FloatArray) -> tuple[IntArray, IntArray]:
        """Pair points (K, 2) with the triangles that touch their cells.

        Returns
        -------
        point : (N,) array of int
            Index of the point of each pair, in ascending order.
        triangle : (N,) array of int
            Index of its triangle.
        """
        cell = self._cell(points)
        return self._pairs(self.first[cell], self.first[cell + 1] - self.first[cell])

    def _cell(self, points: FloatArray) -> IntArray:
        column, row = _cells((points - self.low) * self.per_cell, self.side).T
        return np.asarray(row * self.side + column)

    def along(self, ends: FloatArray) -> tuple[IntArray, IntArray]:
        """Pair edges with the triangles whose cells they cross; ``ends`` are (E, 2, 2).

        Returns
        -------
        edge : (N,) array of int
            Index of the edge of each pair, in ascending order.
        triangle : (N,) array of int
            Index of its triangle; a pair occurs once for each common cell.
        """
        a, b = np.moveaxis((ends - self.low) * self.per_cell, 1, 0)[..., None]
        row = np.arange(self.side)
        rise = b[:, 1] - a[:, 1]
        level = np.abs(rise) < 1e-9
        with np.errstate(divide="ignore", invalid="ignore"):
            enters, leaves = (np.clip((row + k - a[:, 1]) / rise, 0, 1) for k in (0, 1))
        enters, leaves = np.where(level, 0.0, enters), np.where(level, 1.0, leaves)
        x = [a[:, 0] + share * (b[:, 0] - a[:, 0]) for share in (enters, leaves)]
        margin = 1e-6  # as a share of a cell: rounding must not lose an entry that begins at the end of a row
        left, right = _cells(np.minimum(*x) - margin, self.side), _cells(np.maximum(*x) + margin, self.side)
        below = _cells(np.minimum(a[:, 1], b[:, 1]) - margin, self.side)
        above = _cells(np.maximum(a[:, 1], b[:, 1]) + margin, self.side)
        # the cells of an edge in one row are consecutive, and so are their triangles
        start = self.first[row * self.side + left].ravel()
        stop = self.first[row * self.side + right + 1].ravel()
        count = np.where(((row >= below) & (row <= above)).ravel(), stop - start, 0)
        crossing, triangle = self._pairs(start, count)
        return crossing // self.side, triangle

    def _pairs(self, start: IntArray, count: IntArray) -> tuple[IntArray, IntArray]:
        """Return, for slices of ``listed``, the slice of each triangle, and the triangles."""
        owner = np.repeat(np.arange(len(count)), count)
        return owner, self.listed[_concatenated_ranges(start, count, owner)]


def _cells(positions: FloatArray, side: int) -> IntArray:
    """Return the columns or rows of positions in cell units, clamped to the grid."""
    return np.asarray(np.clip(positions, 0, side - 1)).astype(np.int64)


def _concatenated_ranges(start: IntArray, count: IntArray, owner: IntArray) -> IntArray:
    """Return ``count`` consecutive integers from each start, concatenated; ``owner`` maps each integer to its start."""
    return np.asarray(np.arange(len(owner)) + (start - np.cumsum(count) + count)[owner])
