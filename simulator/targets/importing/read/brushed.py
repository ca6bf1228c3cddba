"""Grain of a glTF model's brushed metals (anisotropy): one direction per material, from the tangents of its faces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.simulator.runtime.arrays import Vec3, vec3

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray, IntArray

MIN_AGREEING_SHARE = 0.8
"""Share of the faces' grain along one direction above which the material has that grain."""


def read_anisotropy(material: dict[str, Any], extension: str) -> tuple[float, float]:
    """Return strength 0..1 of a glTF material's anisotropy, and the angle [rad] from the tangent to its wide axis."""
    anisotropy = material.get("extensions", {}).get(extension, {})
    strength = float(np.clip(anisotropy.get("anisotropyStrength", 0.0), 0, 1))
    return strength, float(anisotropy.get("anisotropyRotation", 0.0))


def face_grain(
    corners_m: FloatArray, tangents: FloatArray | None, corner_uv: FloatArray | None, turn_rad: float
) -> FloatArray:
    """Return the (3, 3) sum over faces of area times the dyad of the grain, because a grain has no sign.

    Parameters
    ----------
    corners_m : (F, 3, 3) array
        Corners of the faces [m].
    tangents : (F, 3, 4) array or None
        glTF tangents of the corners, rotated with the mesh; or None to derive them from ``corner_uv``.
    corner_uv : (F, 3, 2) array or None
        Texture coordinates, or None; a mesh without either has no direction.
    turn_rad : float
        Angle, counter-clockwise, from the tangent to the direction in which the highlight is wide.

    References
    ----------
    Khronos Group (2023), KHR_materials_anisotropy.
    """
    ab, ac = corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 0]
    normal = np.cross(ab, ac)
    twice_area = np.linalg.norm(normal, axis=1)
    n = normal / np.maximum(twice_area, 1e-30)[:, None]
    if tangents is not None:
        t = tangents[..., :3].mean(axis=1)
        hand = np.sign(tangents[:, 0, 3])
    elif corner_uv is not None:
        du, dv = corner_uv[:, 1] - corner_uv[:, 0], corner_uv[:, 2] - corner_uv[:, 0]
        hand = -np.sign(du[:, 0] * dv[:, 1] - du[:, 1] * dv[:, 0])  # v runs down
        t = (ab * dv[:, 1:] - ac * du[:, 1:]) * -hand[:, None]
    else:
        return np.zeros((3, 3))
    t = t - (t * n).sum(axis=1, keepdims=True) * n
    t = t / np.maximum(np.linalg.norm(t, axis=1), 1e-30)[:, None]
    wide_axis = np.cos(turn_rad) * t + np.sin(turn_rad) * hand[:, None] * np.cross(n, t)
    grain = np.cross(n, wide_axis)
    is_valid = np.isfinite(grain).all(axis=1) & (twice_area > 0)
    return np.einsum("f,fi,fj->ij", twice_area[is_valid], grain[is_valid], grain[is_valid])


@dataclass(frozen=True)
class Grain:
    """The grain direction of a material.

    Parameters
    ----------
    axis : tuple of float
        Direction; zero without tangents and texture coordinates.
    turned : bool
        True if the grain runs around the axis, as on a turned part, instead of along it.
    fits : bool
        True if most faces agree with this direction.
    """

    axis: Vec3
    turned: bool
    fits: bool


def common_grain(dyads: FloatArray) -> Grain:
    """Return the dominant grain of a material's faces, from the sum of their dyads."""
    total = float(np.trace(dyads))
    if total <= 0:
        return Grain((0.0, 0.0, 0.0), turned=False, fits=True)
    values, vectors = np.linalg.eigh(dyads)
    straight = bool(values[2] > MIN_AGREEING_SHARE * total)
    # around an axis, the grain has all directions perpendicular to it
    is_around = not straight and bool(values[0] < 0.5 * (1 - MIN_AGREEING_SHARE) * total)
    axis = vectors[:, 0 if is_around else 2]
    return Grain(vec3(axis * np.sign(axis[np.argmax(np.abs(axis))])), is_around, straight or is_around)


def at_corners(values: FloatArray, triangles: IntArray) -> FloatArray:
    """Return per-vertex values at the corners of triangles (F, 3, ...); invalid indices are reported elsewhere."""
    return np.asarray(values[np.clip(triangles, 0, len(values) - 1)])
