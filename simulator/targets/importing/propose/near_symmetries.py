"""Near-symmetries of a mesh: rotations that map its surface onto itself, whatever its paint."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from flyaround.simulator.geometry.topology import MeshBody
from flyaround.simulator.runtime.arrays import FloatArray
from flyaround.simulator.targets.importing.propose.surface_points import surface_points

SAMPLES = 20000  # number of surface points
SHARE, MAX_DISTANCE = 0.9, 0.005
"""Share of the rotated surface that must lie closer to the surface than a share of the craft's size. NASA's TDRS, whose
antennas differ, has 0.0034; Dragon with its hatch, under quarter turns, 0.015."""
FOLDS = {4: "a quarter turn", 3: "a third of a turn", 2: "half a turn"}
SAME_AXIS_COS = float(np.cos(np.deg2rad(10.0)))  # cosine of the angle within which two axes count as one


def near_symmetries(bodies: list[MeshBody]) -> list[str]:
    """Describe the rotations about the model's and the principal axes that map the surface nearly onto itself.

    Returns
    -------
    list of str
        One phrase an axis, such as "half a turn about z", of the smallest turn; empty if there is none.
    """
    points = surface_points(bodies, SAMPLES, vertices=False).points_m
    tree, others = cKDTree(points[::2]), points[1::2]
    size, centre = float(np.linalg.norm(np.ptp(points, axis=0))), points.mean(axis=0)

    def distance(rotated: FloatArray) -> float:
        return float(np.quantile(tree.query(rotated)[0], SHARE))

    limit = distance(others) + MAX_DISTANCE * size
    phrases: list[str] = []
    found: list[FloatArray] = []
    principal = np.linalg.eigh(np.cov(points.T))[1].T
    for name, axis in (*zip("xyz", np.eye(3), strict=True), *(("", a) for a in principal)):
        if any(abs(axis @ other) > SAME_AXIS_COS for other in found):
            continue
        for fold, turn in FOLDS.items():
            rotation = Rotation.from_rotvec(2 * np.pi / fold * axis)
            if distance(rotation.apply(others - centre) + centre) <= limit:
                found.append(axis)
                phrases.append(f"{turn} about {name or np.round(axis, 2).tolist()}")
                break
    return phrases
