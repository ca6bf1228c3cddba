"""A spacecraft under construction: named meshes with their materials, turned into a Target's parts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flyaround.simulator.runtime.arrays import FloatArray
from flyaround.simulator.targets.builders.mesh import Mesh
from flyaround.simulator.targets.model import Part


@dataclass(frozen=True, eq=False)
class Piece:
    """A mesh with the name and the material it will have, and the texture coordinates (N, 2) of its vertices."""

    name: str
    material: str
    mesh: Mesh
    uv: FloatArray | None = None


def part_of(piece: Piece) -> Part:
    """The piece in the renderer's number formats (float32)."""
    normals = piece.mesh.normals / np.linalg.norm(piece.mesh.normals, axis=1, keepdims=True)
    return Part(
        name=piece.name,
        material=piece.material,
        positions_m=piece.mesh.positions_m.astype(np.float32),
        normals=normals.astype(np.float32),
        triangles=piece.mesh.triangles.astype(np.int64),
        uv=None if piece.uv is None else piece.uv.astype(np.float32),
    )
