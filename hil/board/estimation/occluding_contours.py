"""Occluding contours of the target from all sides, as stored in the board model file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Dict, Tuple

import numpy as np

from flyaround.hil.board.json_values import SMALLEST_M, number, numbers, unpack, whole

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Outlines:
    """Occluding contours from V directions, with N points each, evenly spaced along the contour.

    Parameters
    ----------
    directions : (V, 3) array
        Unit vectors from the target's centre to the camera, target frame.
    points_m : (V, N, 3) array
        Contour points on the surface, target frame [m].
    normals : (V, N, 3) array
        Outward unit surface normals, perpendicular to the line of sight.
    radius_m : (V, N) array
        Radius of curvature along the line of sight [m]; 0 at sharp edges.
    centre_m : (3,) array
        Centre of the target, target frame [m].
    range_m : float
        Distance of the views from the centre [m].
    """

    directions: Array
    points_m: Array
    normals: Array
    radius_m: Array
    centre_m: Array
    range_m: float

    @staticmethod
    def from_dict(record: Dict[str, Any]) -> Outlines:
        """Make contours from the board file's `outlines` object.

        Raises
        ------
        KeyError, OverflowError, TypeError, ValueError
            If a field is missing, a number is impossible or the data are damaged.
        """
        v, n = whole(record["views"]), whole(record["points"])
        if v < 1 or n < 1:
            raise ValueError(f"outlines of {v} views with {n} points")
        sizes = [v * 3 * 2, v * n * 3 * 2, v * n * 3, v * n]
        data = unpack(record["data"], sum(sizes))
        step_m, radius_step_m, range_m = (
            number(record[name], least=SMALLEST_M) for name in ("step_m", "radius_step_m", "range_m")
        )
        bounds = np.concatenate([[0], np.cumsum(sizes)])
        rows = [
            np.frombuffer(data[a:b], dtype)
            for a, b, dtype in zip(bounds[:-1], bounds[1:], ("<i2", "<i2", "i1", "u1"))  # noqa: B905 - Python 3.9
        ]
        centre = numbers(record["center_m"], 3)
        return Outlines(
            directions=_unit(rows[0].reshape(v, 3).astype(float)),
            points_m=centre + step_m * rows[1].reshape(v, n, 3),
            normals=_unit(rows[2].reshape(v, n, 3).astype(float)),
            radius_m=radius_step_m * rows[3].reshape(v, n),
            centre_m=centre,
            range_m=range_m,
        )

    def nearest(self, C_m: Array) -> Array:
        """Return the index of the view nearest to each camera position (B, 3), target frame."""
        return np.asarray(np.argmax(_unit(C_m - self.centre_m) @ self.directions.T, axis=1))

    def seen_from(self, view: int, C_m: Array) -> Tuple[Array, Array]:
        """Return a view's contour points and normals (N, 3), corrected for a camera at ``C_m`` (3,).

        Points slide along the osculating circle: accurate to second order in the angle between view and camera, and
        exact for spheres, cylinders seen side-on and sharp edges.

        References
        ----------
        Cipolla and Giblin (2000), Visual Motion of Curves and Surfaces, section 3.
        """
        p, n, radius = self.points_m[view], self.normals[view], self.radius_m[view][:, None]
        middle = p - radius * n  # centre of curvature
        normal = n
        for _ in range(3):  # fixed-point iteration: the line of sight depends on the moved point
            sight = _unit(C_m - (middle + radius * normal))
            normal = _unit(n - np.sum(n * sight, axis=-1, keepdims=True) * sight)
        return middle + radius * normal, normal


def _unit(v: Array) -> Array:
    return np.asarray(v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12))
