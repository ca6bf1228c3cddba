"""Conversion between a `Target` and the records of a target file, and the hash of a target."""

from __future__ import annotations

import hashlib
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from flyaround.simulator.runtime.arrays import Vec3
from flyaround.simulator.targets.model import Edge, Keypoint, MassProperties, Occluders
from flyaround.simulator.targets.records import (
    EdgeRecord,
    KeypointRecord,
    MassRecord,
    OccludersRecord,
    ReferenceFrameRecord,
    TargetRecord,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.targets.model import Material, Part, Target, TextureImage


def _keypoints(points: Sequence[Keypoint]) -> tuple[KeypointRecord, ...]:
    return tuple(KeypointRecord(k.name, k.position_m) for k in points)


def _wireframe(edges: Sequence[Edge]) -> tuple[EdgeRecord, ...]:
    return tuple(EdgeRecord(e.name, e.a_m, e.b_m, e.normals, e.radius_m) for e in edges)


def _occluders(bodies: Occluders) -> OccludersRecord:
    return OccludersRecord(
        tuple((float(x), float(y), float(z)) for x, y, z in bodies.vertices_m),
        tuple((int(a), int(b), int(c)) for a, b, c in bodies.triangles),
    )


def content_sha256(
    materials: Sequence[Material],
    parts: Sequence[Part],
    keypoints: Sequence[Keypoint],
    wireframe: Sequence[Edge],
    occluders: Occluders,
    pictures: Sequence[TextureImage] = (),
) -> str:
    """Compute the SHA-256 of all data that affect an image or a label of the target.

    The digest covers these blocks in order, each preceded by its length in bytes (uint64, little-endian):

    - one line of canonical JSON (sorted keys, no spaces) with materials, part names, keypoints, wireframe and
      occluders; unused texture slots are omitted
    - for each part: positions and normals (float32), triangles (uint32), and texture coordinates (float32) if it has
      some, all little-endian
    - for each image: its name and its bytes

    Returns
    -------
    str
        64 hexadecimal digits in lower case.
    """
    head: dict[str, Any] = {
        "materials": [_material_head(m) for m in materials],
        "parts": [(p.name, p.material) for p in parts],
        "keypoints": _keypoints(keypoints),
        "wireframe": _wireframe(wireframe),
        "occluders": _occluders(occluders),
    }
    digest = hashlib.sha256()
    blocks = [msgspec.json.encode(head, order="sorted")]
    for p in parts:
        blocks += [
            np.ascontiguousarray(p.positions_m, "<f4").tobytes(),
            np.ascontiguousarray(p.normals, "<f4").tobytes(),
            np.ascontiguousarray(p.triangles, "<u4").tobytes(),
        ]
        if p.uv is not None:
            blocks.append(np.ascontiguousarray(p.uv, "<f4").tobytes())
    for picture in pictures:
        blocks += [picture.name.encode(), picture.data]
    for block in blocks:
        digest.update(len(block).to_bytes(8, "little"))
        digest.update(block)
    return digest.hexdigest()


def _material_head(material: Material) -> dict[str, Any]:
    """Return a material without empty textures and grain, so that older targets keep their hash."""
    absent = () if material.anisotropy > 0 else ("anisotropy", "grain", "turned")
    return {
        k: v
        for k, v in asdict(material).items()
        if not (k.endswith("_texture") and v == "") and k not in absent
    }


def target_record(target: Target) -> TargetRecord:
    """Build the record that a target file holds next to its glTF meshes and materials.

    Returns
    -------
    TargetRecord
        Names, hash, labels, occluders, mass, frames and symmetry of the target, and those parameters of materials
        and parts that glTF has no fields for.
    """
    return TargetRecord(
        schema="flyaround.target",
        version=1,
        name=target.name,
        title=target.title,
        sha256=target.sha256,
        keypoints=_keypoints(target.keypoints),
        wireframe=_wireframe(target.wireframe),
        occluders=_occluders(target.occluders),
        mass=MassRecord(target.mass.mass_kg, target.mass.com_m, target.mass.inertia_kg_m2),
        frames={name: ReferenceFrameRecord(o, a) for name, (o, a) in target.frames.items()},
        symmetry_wxyz=target.symmetry,
        notes=target.notes,
        crinkle={m.name: m.crinkle for m in target.materials if m.crinkle > 0},
        grain={m.name: m.grain for m in target.materials if m.anisotropy > 0},
        turned=tuple(m.name for m in target.materials if m.anisotropy > 0 and m.turned),
        part_classes=target.part_classes or msgspec.UNSET,
    )


def keypoints_from(record: TargetRecord) -> tuple[Keypoint, ...]:
    """Return the keypoints of a record."""
    return tuple(Keypoint(name=k.name, position_m=k.position_m) for k in record.keypoints)


def wireframe_from(record: TargetRecord) -> tuple[Edge, ...]:
    """Return the wireframe of a record."""
    return tuple(
        Edge(name=e.name, a_m=e.a_m, b_m=e.b_m, normals=e.normals, radius_m=e.radius_m)
        for e in record.wireframe
    )


def occluders_from(record: TargetRecord) -> Occluders:
    """Return the occluders of a record."""
    return Occluders(
        vertices_m=np.array(record.occluders.vertices_m, float).reshape(-1, 3),
        triangles=np.array(record.occluders.triangles, np.int64).reshape(-1, 3),
    )


def mass_from(record: TargetRecord) -> MassProperties:
    """Return the mass properties of a record."""
    m = record.mass
    return MassProperties(mass_kg=m.mass_kg, com_m=m.com_m, inertia_kg_m2=m.inertia_kg_m2)


def frames_from(record: TargetRecord) -> dict[str, tuple[Vec3, Vec3]]:
    """Return the named frames of a record."""
    return {name: (f.origin_m, f.axis) for name, f in record.frames.items()}
