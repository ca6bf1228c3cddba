"""Of glTF what is arithmetic: a node's matrix, and strips and fans as triangles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from simulator.runtime.arrays import FloatArray, IntArray

TRIANGLES, STRIP, FAN = 4, 5, 6
"""What a primitive's indices are joined to: its ``mode``."""


def node_matrix(node: dict[str, Any]) -> FloatArray:
    """(4, 4) of a node relative to its parent: a matrix by columns, or translation, rotation (xyzw), scale."""
    if "matrix" in node:
        return np.asarray(node["matrix"], float).reshape(4, 4).T
    matrix = np.eye(4)
    x, y, z, w = np.asarray(node.get("rotation", [0, 0, 0, 1]), float)
    R = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix[:3, :3] = R * np.asarray(node.get("scale", [1, 1, 1]), float)
    matrix[:3, 3] = node.get("translation", [0, 0, 0])
    return matrix


def as_triangles(index: IntArray, mode: int) -> IntArray:
    """(N, 3) corners of the triangles that indices mean.

    Raises
    ------
    ValueError
        If the indices of separate triangles are no multiple of three.
    """
    if mode == TRIANGLES:
        if len(index) % 3:
            raise ValueError(f"{len(index)} indices are no whole number of triangles")
        return index.reshape(-1, 3)
    if mode == FAN:
        first = np.full(max(len(index) - 2, 0), index[0] if len(index) else 0)
        return np.stack([first, index[1:-1], index[2:]], axis=1)
    t = np.stack([index[:-2], index[1:-1], index[2:]], axis=1)
    t[1::2] = t[1::2, ::-1]  # every second triangle of a strip runs the other way
    return t
