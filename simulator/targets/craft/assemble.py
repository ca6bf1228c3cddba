"""From pieces and labels to a checked target."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.simulator.runtime.arrays import Quat, Vec3
from flyaround.simulator.targets.builders.assembly import Piece, part_of
from flyaround.simulator.targets.builders.labels import named_keypoints, welded
from flyaround.simulator.targets.builders.mass import MassElement, mass_properties
from flyaround.simulator.targets.builders.mesh import Mesh, merge
from flyaround.simulator.targets.check_target import check_target
from flyaround.simulator.targets.convert import content_sha256
from flyaround.simulator.targets.model import (
    Edge,
    Keypoint,
    MassProperties,
    Material,
    Occluders,
    Target,
    TextureImage,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence


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
    pictures: tuple[TextureImage, ...] = (),
) -> Target:
    """A target of the pieces, with those of ``materials`` that they use.

    Pieces of one name become one part; they must be of one material.
    """
    parts = tuple(part_of(p) for p in gathered(pieces))
    used = {p.material for p in parts}
    kept = tuple(m for m in materials if m.name in used)
    points, edges = tuple(keypoints), tuple(wireframe)
    target = Target(
        name=name,
        title=title,
        sha256=content_sha256(kept, parts, points, edges, occluders, pictures),
        materials=kept,
        parts=parts,
        keypoints=points,
        wireframe=edges,
        mass=mass,
        frames=frames,
        symmetry=symmetry,
        notes=notes,
        occluders=occluders,
        pictures=pictures,
    )
    check_target(target, f"target {name}")
    return target


def assemble_lumped(
    name: str,
    title: str,
    *,
    pieces: Sequence[Piece],
    materials: Sequence[Material],
    keypoints: Mapping[str, Vec3],
    wireframe: Sequence[Edge],
    occluders: Sequence[Mesh],
    lumps: Sequence[MassElement],
    frames: dict[str, tuple[Vec3, Vec3]],
    symmetry: tuple[Quat, ...] = (),
    notes: str,
    pictures: tuple[TextureImage, ...] = (),
) -> Target:
    """``assemble`` from keypoints by name, coarse closed bodies and a mass list.

    Parameters
    ----------
    keypoints : position in the model frame [m] by name, in the order that labels report them.
    occluders : coarse closed bodies. lumps : the mass distribution.
    frames : origin [m] and unit axis by name.
    """
    return assemble(
        name=name,
        title=title,
        pieces=pieces,
        materials=materials,
        keypoints=named_keypoints(keypoints),
        wireframe=wireframe,
        occluders=welded(merge(occluders)),
        mass=mass_properties(lumps),
        frames=frames,
        symmetry=symmetry,
        notes=notes,
        pictures=pictures,
    )


def gathered(pieces: Sequence[Piece]) -> list[Piece]:
    """Pieces of one name and material joined into one, in order of first appearance.

    Raises
    ------
    ValueError
        If one name has two materials, or several textured pieces.
    """
    groups: dict[str, list[Piece]] = {}
    for p in pieces:
        groups.setdefault(p.name, []).append(p)
    joined = []
    for name, group in groups.items():
        if len({p.material for p in group}) > 1:
            raise ValueError(f"part {name} has two materials")
        if len(group) == 1:
            joined.append(group[0])
            continue
        if any(p.uv is not None for p in group):
            raise ValueError(f"part {name} has several textured pieces; merge them before")
        joined.append(Piece(name, group[0].material, merge([p.mesh for p in group])))
    return joined
