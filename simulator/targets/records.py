"""Typed records of a target file: the data other than geometry in a GLB.

These structs define the schema, which `flyaround.schemas` writes as JSON Schema.
"""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

from flyaround.simulator.runtime.arrays import Mat3, Quat, Vec3
from flyaround.simulator.targets.model import PartClass

Positive = Annotated[float, msgspec.Meta(gt=0)]
NotNegative = Annotated[float, msgspec.Meta(ge=0)]
Fraction = Annotated[float, msgspec.Meta(ge=0, le=1)]
Name = Annotated[str, msgspec.Meta(min_length=1)]
Sha256 = Annotated[str, msgspec.Meta(pattern="^[0-9a-f]{64}$")]
Index = Annotated[int, msgspec.Meta(ge=0)]


class KeypointRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A named point [m]."""

    name: Name
    position_m: Vec3


class EdgeRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A segment of the wireframe [m], the outward normals of its faces, the radius of a rod about it [m]."""

    name: Name
    a_m: Vec3
    b_m: Vec3
    normals: tuple[Vec3, ...] = ()
    radius_m: NotNegative = 0.0


class OccludersRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Coarse closed bodies [m], triangles counter-clockwise from outside."""

    vertices_m: tuple[Vec3, ...] = ()
    triangles: tuple[tuple[Index, Index, Index], ...] = ()


class MassRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Mass [kg], centre of mass [m], inertia about it in model axes [kg m2]."""

    mass_kg: Positive
    com_m: Vec3
    inertia_kg_m2: Mat3


class ReferenceFrameRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A named frame on the craft: origin [m] and axis (unit vector)."""

    origin_m: Vec3
    axis: Vec3


class TargetRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The `flyaround` object in the extras of a target file's scene (glTF 2.0, binary).

    Lengths are in metres, model frame; `crinkle` holds the amplitude of creases by material, `grain` the direction of
    brushed metals, `turned` those of them with the grain around it, `part_classes` explicit classes of parts.
    """

    schema: Literal["flyaround.target"]
    version: Literal[1]
    name: Name
    title: str
    sha256: Sha256
    keypoints: tuple[KeypointRecord, ...] = ()
    wireframe: tuple[EdgeRecord, ...] = ()
    occluders: OccludersRecord = OccludersRecord()
    mass: MassRecord
    frames: dict[str, ReferenceFrameRecord] = {}
    symmetry_wxyz: tuple[Quat, ...] = ()
    notes: str = ""
    crinkle: dict[str, Fraction] = {}
    grain: dict[str, Vec3] = {}
    turned: tuple[str, ...] = ()
    part_classes: dict[str, PartClass] | msgspec.UnsetType = msgspec.UNSET
