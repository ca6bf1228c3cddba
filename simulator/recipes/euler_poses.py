"""Poses by Euler angles in left-handed axes, as in a published data set.

The data set uses the left-handed axes of its rendering engine: x right, y up, z forward. This package uses right-handed
axes with y down. The conversion mirrors y in both the camera's and the model's axes: a position (x, y, z) becomes
(x, -y, z), and a rotation (w, x, y, z) becomes (w, -x, y, -z).

References
----------
Hematulin et al. (2025), Generating Large-Scale Datasets for Spacecraft Pose Estimation via a High-Resolution Synthetic
Image Renderer, Aerospace 12(4) 334, equations 1 and 3 to 6, algorithm 1.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flyaround.simulator.runtime.arrays import FloatArray


def quat_from_euler(euler_deg: ArrayLike) -> FloatArray:
    """Return the (4,) quaternion, scalar first, of rotations by rx about x, then ry about y, then rz about fixed z.

    Equations 3 to 6; the paper as printed lacks the minus signs of the second and the fourth.
    """
    half = np.radians(np.asarray(euler_deg, float)) / 2
    (sx, sy, sz), (cx, cy, cz) = np.sin(half), np.cos(half)
    return np.array(
        [
            cx * cy * cz + sx * sy * sz,
            sx * cy * cz - cx * sy * sz,
            cx * sy * cz + sx * cy * sz,
            cx * cy * sz - sx * sy * cz,
        ]
    )


def from_left_handed(q_wxyz: ArrayLike) -> FloatArray:
    """Return the (4,) rotation with both axes mirrored by y -> -y, which is an involution."""
    return np.asarray(q_wxyz, float) * (1.0, -1.0, 1.0, -1.0)


def to_left_handed(position_m: ArrayLike) -> FloatArray:
    """Return the (3,) point with y negated."""
    return np.asarray(position_m, float) * (1.0, -1.0, 1.0)
