"""Faces of the target in the layout of the native library."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np

from flyaround.hil.board.estimation.faces import Faces
from flyaround.hil.board.hybrid.native.interface import STRUCTURES, Structure, contiguous

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class NativeFaces(Faces):
    """Faces with the C structure that the native library reads, built once.

    Attributes
    ----------
    native : Structure
        C structure of the arrays.
    """

    native: Structure = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "native", _structure(self))

    @staticmethod
    def from_faces(faces: Faces) -> NativeFaces:
        """Return the faces with their C structure."""
        if isinstance(faces, NativeFaces):
            return faces
        return NativeFaces(**{f.name: getattr(faces, f.name) for f in fields(Faces)})


def native_faces(faces: Faces) -> Structure:
    """Return the C structure of faces; it is built at each call unless ``faces`` is a ``NativeFaces``."""
    return NativeFaces.from_faces(faces).native


def _structure(faces: Faces) -> Structure:
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
