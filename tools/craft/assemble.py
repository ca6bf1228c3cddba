"""Assembly of named meshes and labels into a checked target."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.runtime.arrays import FloatArray, Quat, Vec3
from flyaround.simulator.targets.check_target import check_target
from flyaround.simulator.targets.convert import content_sha256
from flyaround.simulator.targets.model import Edge, Keypoint, Material, Part, Target, TextureImage
from tools.craft.finishes import FINISHES
from tools.craft.labels import welded
from tools.craft.mass import MassElement, mass_properties
from tools.craft.shapes.mesh import Mesh, merge

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence


@dataclass(frozen=True, eq=False)
class Piece:
    """A mesh with its part name, its material, and the texture coordinates (N, 2) of its vertices."""

    name: str
    material: str
    mesh: Mesh
    uv: FloatArray | None = None


def part_of(piece: Piece) -> Part:
    """Return the piece in the renderer's number formats (float32)."""
    normals = piece.mesh.normals / np.linalg.norm(piece.mesh.normals, axis=1, keepdims=True)
    return Part(
        name=piece.name,
        material=piece.material,
        positions_m=piece.mesh.positions_m.astype(np.float32),
        normals=normals.astype(np.float32),
        triangles=piece.mesh.triangles.astype(np.int64),
        uv=None if piece.uv is None else piece.uv.astype(np.float32),
    )


def assemble(
    name: str,
    title: str,
    *,
    pieces: Sequence[Piece],
    materials: Sequence[Material] = FINISHES,
    keypoints: Mapping[str, Vec3],
    wireframe: Sequence[Edge],
    occluders: Sequence[Mesh],
    lumps: Sequence[MassElement],
    frames: dict[str, tuple[Vec3, Vec3]],
    symmetry: tuple[Quat, ...] = (),
    notes: str,
    pictures: tuple[TextureImage, ...] = (),
) -> Target:
    """Build a target from its pieces and check it.

    Parameters
    ----------
    name : str
        Name of the target.
    title : str
        Title in lists.
    pieces : sequence of Piece
        Pieces of one name become one part; they must have one material.
    materials : sequence of Material, optional
        Available materials; unused ones are omitted.
    keypoints : mapping of str to Vec3
        Position in the model frame [m] by name, in the order that labels report them.
    wireframe : sequence of Edge
        Edges of the wireframe.
    occluders : sequence of Mesh
        Coarse closed bodies.
    lumps : sequence of MassElement
        Mass distribution.
    frames : dict of str to tuple of Vec3
        Origin [m] and unit axis by name.
    symmetry : tuple of Quat, optional
        Rotations that leave the shape unchanged.
    notes : str
        Sources and simplifications.
    pictures : tuple of TextureImage, optional
        Textures of the materials.
    """
    parts = tuple(part_of(p) for p in gathered(pieces))
    used_names = {p.material for p in parts}
    used_materials = tuple(m for m in materials if m.name in used_names)
    points = tuple(Keypoint(name=name, position_m=p) for name, p in keypoints.items())
    edges, bodies = tuple(wireframe), welded(merge(occluders))
    target = Target(
        name=name,
        title=title,
        sha256=content_sha256(used_materials, parts, points, edges, bodies, pictures),
        materials=used_materials,
        parts=parts,
        keypoints=points,
        wireframe=edges,
        mass=mass_properties(lumps),
        frames=frames,
        symmetry=symmetry,
        notes=notes,
        occluders=bodies,
        pictures=pictures,
    )
    check_target(target, f"target {name}")
    return target


def gathered(pieces: Sequence[Piece]) -> list[Piece]:
    """Return the pieces, merged by name, in order of first appearance.

    Raises
    ------
    ValueError
        If one name has two materials, or several textured pieces.
    """
    groups: dict[str, list[Piece]] = {}
    for p in pieces:
        groups.setdefault(p.name, []).append(p)
    pieces_out = []
    for name, group in groups.items():
        if len({p.material for p in group}) > 1:
            raise ValueError(f"part {name} has two materials")
        if len(group) == 1:
            pieces_out.append(group[0])
            continue
        if any(p.uv is not None for p in group):
            raise ValueError(f"part {name} has several textured pieces; merge them before")
        pieces_out.append(Piece(name, group[0].material, merge([p.mesh for p in group])))
    return pieces_out
