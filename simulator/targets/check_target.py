"""Checks of a target: geometry, textures, labels and mass that can be drawn, labelled and propagated."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.geometry.triangles import distance_to_triangles
from flyaround.simulator.targets.textures import check_picture, mime_type
from flyaround.simulator.world.attitude.rigid_body import check_inertia

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.targets.model import (
        Edge,
        Keypoint,
        MassProperties,
        Material,
        Occluders,
        Part,
        Target,
    )

KEYPOINT_TOLERANCE = 0.02
"""Largest distance of a keypoint from the surface, relative to the craft's size. A keypoint at the corner of a box
lies this far outside a mesh that rounds the corner off: with a radius r it is 0.73 r, for r up to 2.7 % of the size."""
MIN_AREA_M2 = 5e-15
"""Smallest area of a triangle [m2]: half a square of 0.1 micrometres. Smaller ones hide nothing in `ray_cast`."""
_FACTORS = (
    "base_color",
    "metallic",
    "roughness",
    "clearcoat",
    "clearcoat_roughness",
    "crinkle",
    "anisotropy",
)


def check_target(target: Target, source: str) -> None:
    """Check that a target can be drawn, labelled and propagated.

    Parameters
    ----------
    target : Target
        Target to check.
    source : str
        Name of its file, for messages.

    Raises
    ------
    UserError
        If it cannot; the message states the problem, its location and a remedy.
    """
    _check_unique("material", [m.name for m in target.materials], source)
    _check_unique("part", [p.name for p in target.parts], source)
    for part in target.parts:
        check_part(part, source)
    check_materials(target.materials, source)
    check_textures(target, source)
    check_labels(target.keypoints, target.wireframe, target.occluders, source)
    check_frames(target, source)
    check_mass(target.mass, source)


def check_part(part: Part, source: str) -> None:
    """Check that vertices are finite, indices valid, normals unit vectors, and no triangle degenerate or inverted.

    Raises
    ------
    UserError
        If a check fails; the message names the part and the remedy.
    """
    where_part = f"{source}, part {part.name!r}"
    positions, normals, triangles = part.positions_m.astype(float), part.normals.astype(float), part.triangles
    finite = np.isfinite(positions).all(axis=1)
    if not finite.all():
        raise UserError(f"{where_part}: vertex {int(np.argmin(finite))} is not finite; repair the mesh")
    if len(normals) != len(positions):
        raise UserError(
            f"{where_part}: {len(positions)} vertices but {len(normals)} normals; export it with normals"
        )
    if len(triangles) == 0:
        raise UserError(f"{where_part}: no triangles; remove the part or export it again")
    missing = triangles[(triangles < 0) | (triangles >= len(positions))]
    if missing.size:
        raise UserError(
            f"{where_part}: a triangle uses vertex {int(missing[0])} of {len(positions)}; export it again"
        )
    if not _are_units(normals):
        raise UserError(f"{where_part}: normals are not unit vectors; export the model with normals")
    face_normals = np.cross(
        positions[triangles[:, 1]] - positions[triangles[:, 0]],
        positions[triangles[:, 2]] - positions[triangles[:, 0]],
    )
    area = 0.5 * np.linalg.norm(face_normals, axis=1)
    if (area < MIN_AREA_M2).any():
        raise UserError(
            f"{where_part}: triangle {int(np.argmin(area))} has no area; remove degenerate triangles from the mesh"
        )
    if ((face_normals * normals[triangles].sum(axis=1)).sum(axis=1) <= 0).any():
        raise UserError(
            f"{where_part}: some triangles are wound against their normals (inside out); flip those faces or "
            "recompute the normals"
        )


def check_keypoints_on_mesh(target: Target, source: str) -> None:
    """Check that every keypoint is within `KEYPOINT_TOLERANCE` of the mesh, because its visibility is computed there.

    Do not call it for coarse levels of detail, which keep all labels but omit small parts.

    Raises
    ------
    UserError
        If one is farther away.
    """
    if not target.keypoints or not target.parts:
        return
    corners = np.concatenate([p.positions_m[p.triangles] for p in target.parts])
    # per column: comparing contiguous arrays is faster
    low, high = (np.ascontiguousarray(f(corners, axis=1).T) for f in (np.min, np.max))
    tolerance_m = KEYPOINT_TOLERANCE * float((high.max(axis=1) - low.min(axis=1)).max())
    for k in target.keypoints:
        p = np.asarray(k.position_m, float)
        nearby = np.ones(len(corners), bool)
        for axis in range(3):
            nearby &= (low[axis] <= p[axis] + tolerance_m) & (high[axis] >= p[axis] - tolerance_m)
        candidates = corners[nearby].astype(float)
        if (
            len(candidates) == 0
            or distance_to_triangles(np.tile(p, (len(candidates), 1)), candidates).min() > tolerance_m
        ):
            position = ", ".join(f"{x:.3f}" for x in p)
            raise UserError(
                f"{source}: keypoint {k.name!r} at ({position}) m is off the mesh by more than {tolerance_m:.3g} m; "
                "put it on the surface, in metres in the model frame"
            )


def check_materials(materials: Sequence[Material], source: str) -> None:
    """Check that factors are between 0 and 1, and that brushed metals have a grain direction.

    Raises
    ------
    UserError
        If a factor is out of range, or a grain is missing.
    """
    for m in materials:
        for name in _FACTORS:
            values = np.atleast_1d(getattr(m, name))
            # the negated test also refuses NaN
            wrong = values[~((values >= 0) & (values <= 1))]
            if wrong.size:
                raise UserError(
                    f"{source}: material {m.name!r}: {name} is {wrong[0]:g}, allowed: 0 to 1; correct it"
                )
        length = float(np.linalg.norm(m.grain))
        if m.anisotropy > 0 and not (np.isfinite(length) and length > 0):
            raise UserError(
                f"{source}: material {m.name!r} is brushed (anisotropy {m.anisotropy:g}) in no direction; "
                "give its grain"
            )


def check_frames(target: Target, source: str) -> None:
    """Check that axes of frames are unit vectors, and symmetries unit quaternions.

    Raises
    ------
    UserError
        If one is not, or a number is not finite.
    """
    for name, (origin_m, axis) in target.frames.items():
        if not np.isfinite(origin_m).all():
            raise UserError(f"{source}: frame {name!r}: its origin is not finite; correct it")
        if not _are_units([axis]):
            raise UserError(
                f"{source}: frame {name!r}: its axis is not a unit vector; divide it by its length"
            )
    if not _are_units(target.symmetry):
        raise UserError(f"{source}: a symmetry is not a unit quaternion; divide it by its length")


def check_textures(target: Target, source: str) -> None:
    """Check that every texture of a material exists as PNG or JPEG, and that parts that use it have coordinates.

    Raises
    ------
    UserError
        If a texture or coordinates are missing or cannot be read.
    """
    pictures = {p.name: p.data for p in target.pictures}
    for name, data in pictures.items():
        if not mime_type(data):
            raise UserError(f"{source}: texture {name!r} is neither PNG nor JPEG; convert it to PNG")
        check_picture(data, f"{source}: texture {name!r}")
    textured = set()
    for m in target.materials:
        for name in filter(None, m.textures):
            textured.add(m.name)
            if name not in pictures:
                raise UserError(
                    f"{source}: material {m.name!r} names the texture {name!r}, which is missing; embed it in the file"
                )
    for part in target.parts:
        if part.uv is None:
            if part.material in textured:
                raise UserError(
                    f"{source}, part {part.name!r}: its material has a texture and the part no texture "
                    "coordinates; unwrap it, or remove its texture"
                )
        elif part.uv.shape != (len(part.positions_m), 2) or not np.isfinite(part.uv).all():
            raise UserError(
                f"{source}, part {part.name!r}: texture coordinates are not two finite numbers for each vertex; "
                "unwrap it again"
            )


def check_labels(
    keypoints: Sequence[Keypoint], wireframe: Sequence[Edge], occluders: Occluders, source: str
) -> None:
    """Check that names are unique, numbers finite, edges not of zero length, normals unit, occluder indices in range.

    Raises
    ------
    UserError
        If a check fails.
    """
    _check_unique("keypoint", [k.name for k in keypoints], source)
    _check_unique("edge", [e.name for e in wireframe], source)
    for k in keypoints:
        if not np.isfinite(k.position_m).all():
            raise UserError(f"{source}: keypoint {k.name!r} is not finite; correct its position")
    for e in wireframe:
        length = np.linalg.norm(np.subtract(e.b_m, e.a_m))
        if not np.isfinite(length) or length <= 0:
            raise UserError(f"{source}: edge {e.name!r} has no length or is not finite; correct its ends")
        if not _are_units(e.normals):
            raise UserError(f"{source}: edge {e.name!r}: its normals are not unit vectors; correct them")
    indices = occluders.triangles
    missing = indices.size and (indices.min() < 0 or indices.max() >= len(occluders.vertices_m))
    if not np.isfinite(occluders.vertices_m).all() or missing:
        raise UserError(f"{source}: occluders have a vertex that is not finite or is missing; correct them")


def check_mass(mass: MassProperties, source: str) -> None:
    """Check that mass is positive, and that a rigid body can have the inertia.

    Raises
    ------
    UserError
        If a check fails or a number is not finite.
    """
    if not (np.isfinite(mass.mass_kg) and mass.mass_kg > 0 and np.isfinite(mass.com_m).all()):
        raise UserError(f"{source}: mass must be positive and centre of mass finite; correct them")
    try:
        check_inertia(np.asarray(mass.inertia_kg_m2, float))
    except ValueError as error:
        raise UserError(f"{source}: {error}; correct inertia_kg_m2") from error


def _check_unique(kind: str, names: Sequence[str], source: str) -> None:
    duplicate = next((name for name, count in Counter(names).items() if count > 1), None)
    if duplicate is not None:
        raise UserError(f"{source}: two {kind}s are called {duplicate!r}; give each its own name")


def _are_units(vectors: Sequence[Sequence[float]] | FloatArray) -> bool:
    """Return True if all vectors have length 1 within a thousandth, for rounding in the file; False for NaN."""
    return len(vectors) == 0 or bool((np.abs(np.linalg.norm(vectors, axis=1) - 1) < 1e-3).all())
