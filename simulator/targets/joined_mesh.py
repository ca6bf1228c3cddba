"""The mesh of a whole target: its joined parts, and their bounding box."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.geometry.mesh import TriangleMesh, box_corners_m
from flyaround.simulator.geometry.topology import is_closed
from flyaround.simulator.runtime.memory import cached_per_object

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.targets.model import Part, Target


@cached_per_object
def part_is_closed(part: Part) -> bool:
    """Return True if a part is a set of closed shells that face outwards.

    Returns
    -------
    bool
        True if every edge is used once in each direction and the signed volume is positive; cached for as long as
        the part lives.
    """
    return is_closed(part.positions_m, part.triangles)


def join_parts(parts: Sequence[Part]) -> TriangleMesh:
    """Join parts into one mesh, in their order."""
    offsets = np.cumsum([0] + [len(p.positions_m) for p in parts[:-1]])
    return TriangleMesh(
        np.concatenate([p.positions_m for p in parts]).astype(np.float64),
        np.concatenate([p.triangles + o for p, o in zip(parts, offsets, strict=True)]).astype(np.int64),
        np.repeat([part_is_closed(p) for p in parts], [len(p.triangles) for p in parts]),
    )


@cached_per_object
def joined_mesh(target: Target) -> TriangleMesh:
    """Join the parts of a target into one mesh.

    Returns
    -------
    TriangleMesh
        Vertices in the model frame [m] and triangles in the order of the parts. It is cached for as long as the
        target lives, so do not modify it.
    """
    return join_parts(target.parts)


@cached_per_object
def box_3d_m(target: Target) -> FloatArray:
    """Return the corners of the mesh's bounding box.

    Returns
    -------
    (8, 3) array
        Corners in the model frame [m], read-only. Corner k is the upper one in x, y and z if bits 4, 2 and 1 of k
        are set.
    """
    # from the parts: every image needs it, while the joined mesh serves labels only
    corners = box_corners_m([part.positions_m for part in target.parts if len(part.positions_m)])
    corners.flags.writeable = False
    return corners
