"""Whether a part's surface is closed: then only its triangles that face a viewer can be what the viewer meets first."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from simulator.runtime.memory import kept_with

if TYPE_CHECKING:
    from simulator.targets.model import Part


@kept_with
def is_closed(part: Part) -> bool:
    """Whether every edge is met once in each direction, and the shell's signed volume is positive."""
    # corners that share a place are one, whatever their normals
    _, place = np.unique(np.round(part.positions_m, 6), axis=0, return_inverse=True)
    corners = place.ravel()[np.asarray(part.triangles)]
    start = corners.ravel()
    end = np.roll(corners, -1, axis=1).ravel()
    count = len(place)
    forward, backward = start * count + end, end * count + start
    real = start != end  # slivers may have lost an edge in the rounding
    p = part.positions_m.astype(float)[np.asarray(part.triangles)]
    volume = np.einsum("ij,ij->", p[:, 0], np.cross(p[:, 1], p[:, 2]))
    return bool(volume > 0 and np.array_equal(np.sort(forward[real]), np.sort(backward[real])))
