"""Faces of the target in the layout of the native library."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from flyaround.hil.board.estimation.faces import Faces
from flyaround.hil.board.hybrid.native.interface import STRUCTURES, Structure, contiguous

Array = np.ndarray


@lru_cache(maxsize=16)  # a target has one for each of its levels of brightness groups
def native_faces(faces: Faces) -> Structure:
    """Return the C structure of faces for the native library, built once while in use."""
    return STRUCTURES["faces"](
        corners=contiguous(faces.corners, "float64"),
        normals=contiguous(faces.normals, "float64"),
        offset=contiguous(faces.offset, "float64"),
        middles=contiguous(faces.middles, "float64"),
        plane=contiguous(faces.plane, "float64"),
        children=_one_parent(faces.children),
        first=contiguous(np.cumsum([0, *(len(m) for m in faces.members)]), "int64"),
        members=contiguous(np.concatenate([np.zeros(0, int), *faces.members]), "int64"),
        faces=len(faces.corners),
        nodes=len(faces.children),
    )


def _one_parent(children: Array) -> Array:
    """Return children (N, 2), int64, each under its first parent: an untrusted file may list a node twice."""
    out = contiguous(children, "int64").copy()
    seen_children = set()
    for entry in range(out.size):
        child = int(out.flat[entry])
        if child >= 0 and child in seen_children:
            out.flat[entry] = -1
        seen_children.add(child)
    return out
