"""Mass properties of a mesh: a uniform solid of given density or mass, or a shell if it has no volume."""

from __future__ import annotations

import numpy as np

from flyaround.simulator.geometry.topology import MeshBody
from flyaround.simulator.geometry.triangles import face_vectors
from flyaround.simulator.runtime.arrays import FloatArray, vec3
from flyaround.simulator.targets.model import MassProperties

DENSITY_KG_M3 = 250.0
"""Default density, per volume of the body. The CubeSat Design Specification (revision 13) allows 1.33 kg in 10 x 10 x
11.35 cm, 1170 kg m-3; larger spacecraft are emptier. It scales mass and inertia, which the user states where they
matter."""
SHELL_KG_M2 = 10.0  # default mass per area of a mesh without volume
SHEET_RATIO = 1e-3
"""Ratio of volume to area^1.5 below which a mesh consists of sheets, not of bodies. A sphere has 0.094."""


def mass_properties(
    bodies: list[MeshBody], mass_kg: float | None, density_kg_m3: float | None
) -> tuple[MassProperties, str]:
    """Compute mass, centre of mass and inertia; return them with a line of text on their derivation.

    The moments are integrals over the tetrahedra between an origin and each face, or for sheets over the surface.

    Parameters
    ----------
    bodies : list of MeshBody
        Meshes of the craft.
    mass_kg : float or None
        Total mass; None to derive it from the density.
    density_kg_m3 : float or None
        Density of a solid; None for `DENSITY_KG_M3`.

    Raises
    ------
    ArithmeticError
        If the surface has no moments.

    References
    ----------
    Tonon (2004), Explicit exact formulas for the 3-D tetrahedron inertia tensor, J. Math. Stat. 1(1).
    """
    corners = np.concatenate([b.positions_m[b.triangles] for b in bodies])
    area = np.linalg.norm(face_vectors(corners), axis=1) / 2
    origin = corners.mean(axis=(0, 1))
    corners_from_origin = corners - origin
    volume = (
        np.einsum(
            "ij,ij->i",
            corners_from_origin[:, 0],
            np.cross(corners_from_origin[:, 1], corners_from_origin[:, 2]),
        )
        / 6
    )
    total_m3 = float(volume.sum())
    if total_m3 > SHEET_RATIO * float(area.sum()) ** 1.5:
        moments = _moments(corners_from_origin, volume, apex=True)
        if moments is not None:
            mass = mass_kg or total_m3 * (density_kg_m3 or DENSITY_KG_M3)
            derivation = f"{total_m3:.4g} m3" + (
                ""
                if mass_kg
                else f" at {density_kg_m3 or DENSITY_KG_M3:g} kg/m3 (--density or --mass to say better)"
            )
            return _mass_properties(moments, origin, mass, total_m3), f"mass {mass:.4g} kg: {derivation}"
    moments = _moments(corners_from_origin, area, apex=False)
    mass = mass_kg or float(area.sum()) * SHELL_KG_M2
    derivation = f"a shell of {float(area.sum()):.4g} m2" + (
        "" if mass_kg else f" at {SHELL_KG_M2:g} kg/m2 (--mass to say better)"
    )
    if moments is None:
        raise ArithmeticError("a surface with area has moments")
    return _mass_properties(moments, origin, mass, float(area.sum())), f"mass {mass:.4g} kg: {derivation}"


def _moments(corners: FloatArray, weight: FloatArray, *, apex: bool) -> tuple[FloatArray, FloatArray] | None:
    """Return centre of mass and second moments of weighted triangles (F, 3, 3), or of tetrahedra with ``apex``.

    The fourth corner of the tetrahedra is the origin. Return None if rounding makes the moments unphysical.
    """
    total = weight.sum()
    corner_sum, n = corners.sum(axis=1), 4 if apex else 3
    centre = (weight[:, None] * corner_sum).sum(axis=0) / n / total
    # second moments of a uniform simplex with n corners: (sum x x' + S S') w / (n (n + 1))
    second = np.einsum("f,fki,fkj->ij", weight, corners, corners) + np.einsum(
        "f,fi,fj->ij", weight, corner_sum, corner_sum
    )
    second = second / (n * (n + 1)) - total * np.outer(centre, centre)
    return (
        (centre, second) if np.linalg.eigvalsh(second).min() > -1e-12 * np.trace(second) > -np.inf else None
    )


def _mass_properties(
    moments: tuple[FloatArray, FloatArray], origin: FloatArray, mass: float, total: float
) -> MassProperties:
    centre, second = moments
    second = second * (mass / total)
    # a flat sheet gets a small thickness, so that the inertia is physical
    second = second + 1e-9 * np.trace(second) * np.eye(3)
    inertia = np.trace(second) * np.eye(3) - second
    inertia = (inertia + inertia.T) / 2
    rows = (vec3(inertia[0]), vec3(inertia[1]), vec3(inertia[2]))
    return MassProperties(mass_kg=float(mass), com_m=vec3(origin + centre), inertia_kg_m2=rows)
