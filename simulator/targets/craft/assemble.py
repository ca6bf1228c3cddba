"""From pieces and labels to a checked target."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING

from simulator.arrays import Quat, Vec3
from simulator.targets.assembly import Piece, part_of
from simulator.targets.builders.mesh import merge
from simulator.targets.check import check_target
from simulator.targets.convert import content_sha256
from simulator.targets.model import Edge, Keypoint, MassProperties, Material, Occluders, Target

if TYPE_CHECKING:
    from collections.abc import Sequence


def assemble(
    *,
    name: str,
    title: str,
    pieces: Sequence[Piece],
    materials: Sequence[Material],
    keypoints: Sequence[Keypoint],
    wireframe: Sequence[Edge],
    occluders: Occluders,
    mass: MassProperties,
    frames: dict[str, tuple[Vec3, Vec3]],
    symmetry: tuple[Quat, ...] = (),
    notes: str = "",
) -> Target:
    """A target of the pieces, with those of ``materials`` that they use.

    Pieces of one name become one part; they must be of one material.
    """
    groups: dict[tuple[str, str], list[Piece]] = defaultdict(list)
    for piece in pieces:
        groups[piece.name, piece.material].append(piece)
    parts = tuple(
        part_of(Piece(part, material, merge([p.mesh for p in group])))
        for (part, material), group in groups.items()
    )
    used = {p.material for p in parts}
    kept = tuple(m for m in materials if m.name in used)
    points, edges = tuple(keypoints), tuple(wireframe)
    target = Target(
        name=name,
        title=title,
        sha256=content_sha256(kept, parts, points, edges, occluders),
        materials=kept,
        parts=parts,
        keypoints=points,
        wireframe=edges,
        mass=mass,
        frames=frames,
        symmetry=symmetry,
        notes=notes,
        occluders=occluders,
    )
    check_target(target, f"target {name}")
    return target
