"""Closed boxes as parts of a target."""

import numpy as np

from flyaround.simulator.targets.model import Part


def closed_box(name, low, high, material="m"):
    """A box along the axes between two corners [m]; its flat faces share no vertices."""
    positions, normals, triangles = [], [], []
    for axis in range(3):
        for side in (0, 1):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            corner = np.tile(np.asarray(low, float), (4, 1))
            corner[:, axis] = (low, high)[side][axis]
            corner[[1, 2], u], corner[[2, 3], v] = high[u], high[v]
            normal = np.zeros(3)
            normal[axis] = 2 * side - 1
            first = len(positions)
            positions += [*corner]
            normals += [normal] * 4
            quad = [[0, 1, 2], [0, 2, 3]] if side else [[0, 2, 1], [0, 3, 2]]
            triangles += [[first + k for k in t] for t in quad]
    return Part(
        name=name,
        material=material,
        positions_m=np.asarray(positions, np.float32),
        normals=np.asarray(normals, np.float32),
        triangles=np.asarray(triangles, np.uint32),
    )
