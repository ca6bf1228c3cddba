"""A triangle mesh with its bounding box, its convex hull and the planes of its triangles."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import ConvexHull, QhullError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from flyaround.simulator.runtime.arrays import BoolArray, FloatArray, IntArray

# Tolerance for rounding errors: sine of the angle by which a triangle may face away and still count as facing.
GRAZING = 1e-6


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A triangle mesh: vertex positions (N, 3) [m] and vertex indices (M, 3).

    Parameters
    ----------
    positions_m : (N, 3) array
        Vertex positions.
    triangles : (M, 3) array
        Vertex indices of each triangle.
    in_shell : (M,) array, optional
        True for triangles of a closed shell that faces outwards; None if unknown.
    """

    positions_m: FloatArray
    triangles: IntArray
    in_shell: BoolArray | None = None

    @cached_property
    def corners_m(self) -> FloatArray:
        """(3, 3, M) x, y, z of each triangle's three corners, contiguous per corner."""
        return np.ascontiguousarray(self.positions_m[self.triangles].transpose(2, 1, 0))

    @cached_property
    def box_m(self) -> FloatArray:
        """(3, 8) corners of the bounding box, in the order of `box_corners_m`."""
        return box_corners_m([self.positions_m]).T

    @cached_property
    def hull_m(self) -> FloatArray:
        """(K, 3) vertices of the convex hull; all positions of a flat mesh."""
        try:
            return np.asarray(self.positions_m[ConvexHull(self.positions_m).vertices])
        except QhullError:
            return self.positions_m

    @cached_property
    def _planes(self) -> FloatArray:
        """(4, M) unit normal and negated distance from the origin; zeros for triangles without a reliable outside."""
        a, b, c = self.corners_m.transpose(1, 0, 2)
        normal = np.cross(b - a, c - a, axis=0)
        length = np.linalg.norm(normal, axis=0)
        normal /= np.maximum(length, 1e-30)
        planes = np.concatenate([normal, -(normal * a).sum(axis=0)[None]])
        planes[:, length < 1e-12] = 0
        if self.in_shell is None:
            return np.zeros_like(planes)
        return planes * self.in_shell

    def facing(self, place: FloatArray) -> IntArray:
        """Return the indices of all triangles except the back faces of closed shells, which are always hidden.

        Parameters
        ----------
        place : (4,) array
            Homogeneous coordinates of the viewpoint, outside all shells: (x, y, z, 1) [m], or (x, y, z, 0) for a
            direction at infinity.

        Returns
        -------
        (K,) array of int
            Indices of triangles.
        """
        unit = place / np.linalg.norm(place[:3])
        return np.flatnonzero(unit @ self._planes >= -GRAZING)


def box_corners_m(positions_m: Sequence[NDArray[np.floating]]) -> FloatArray:
    """Return the corners of the bounding box of point sets (N, 3).

    Returns
    -------
    (8, 3) array
        Corners [m], in the frame of the points. Bits 2, 1 and 0 of a corner's index select the upper bound in x, y and
        z.
    """
    low = np.min([points.min(axis=0) for points in positions_m], axis=0).astype(float)
    high = np.max([points.max(axis=0) for points in positions_m], axis=0).astype(float)
    bits = np.array([[k >> 2 & 1, k >> 1 & 1, k & 1] for k in range(8)])
    return np.asarray(low + bits * (high - low))
