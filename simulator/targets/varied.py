"""Variation of a target model: its geometry deformed by millimetres, and its surface parameters scaled.

The deformation is a small symmetric strain ``A`` of the whole craft, ``x' = x + A x``. It keeps parts joined and edges
straight, and it does not rotate the craft. Keypoints and wireframe are deformed too, so that labels match the rendered
craft.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.arrays import Mat3, Vec3, vec3
from flyaround.simulator.targets.convert import content_sha256
from flyaround.simulator.targets.library import target_in_use
from flyaround.simulator.targets.model import Occluders

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.targets.model import Edge, Material, Part, Target


class SurfaceVariation(msgspec.Struct, frozen=True, kw_only=True):
    """Factors on a material's parameters. The results are clipped: reflectance to 0 to 1, roughness to 0.02 to 1."""

    reflectance: float = 1.0
    roughness: float = 1.0


class CraftVariation(msgspec.Struct, frozen=True, kw_only=True):
    """Random deviation of a craft from its nominal model.

    Attributes
    ----------
    base_sha256 : str
        Hash of the model.
    stretch : tuple of tuple of float
        Symmetric strain matrix ``A``, (3, 3).
    error_m : float
        Largest displacement of a vertex [m].
    surfaces : dict
        Factors by material name.
    """

    base_sha256: str
    stretch: Mat3 = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    error_m: float = 0.0
    surfaces: dict[str, SurfaceVariation] = msgspec.field(default_factory=dict)

    def deform(self, points_m: ArrayLike) -> FloatArray:
        """Deform points (..., 3) of the model by ``stretch``.

        Returns
        -------
        (..., 3) array
            New positions, model frame [m].
        """
        points = np.asarray(points_m, float)
        return points + points @ np.asarray(self.stretch).T


def varied_target(base: Target, variation: CraftVariation) -> Target:
    """Apply a variation to its model.

    Returns
    -------
    Target
        Craft with deformed meshes and labels, changed materials, and its own hash; mass and named frames are the
        model's. The last two are cached.

    Raises
    ------
    UserError
        If the variation refers to another model.
    """
    if base.sha256 != variation.base_sha256:
        raise UserError(
            f"the scene's craft is a variation of model {variation.base_sha256[:12]}, and {base.name} is "
            f"{base.sha256[:12]}; use the version of flyaround that the record names"
        )
    return _varied(base, msgspec.json.encode(variation))


def target_as_drawn(name: str, sha256: str, variation: CraftVariation | None, base: Target | None) -> Target:
    """Return the craft of a scene, with its variation, if any.

    Parameters
    ----------
    name : str
        Name of the target.
    sha256 : str
        Hash of the target in the scene.
    variation : CraftVariation or None
        Variation of the craft, or None.
    base : Target or None
        The model; by default it is loaded by name and hash.

    Returns
    -------
    Target
        Target with the variation, or the given one.

    Raises
    ------
    UserError
        As in `target_in_use` and `varied_target`.
    """
    if variation is None:
        return base or target_in_use(name, sha256)
    return varied_target(base or target_in_use(name, variation.base_sha256), variation)


@lru_cache(maxsize=2)
def _varied(base: Target, encoded: bytes) -> Target:
    v = msgspec.json.decode(encoded, type=CraftVariation)
    normal_matrix = np.linalg.inv(np.eye(3) + np.asarray(v.stretch)).T
    materials = tuple(_surface(m, v.surfaces.get(m.name)) for m in base.materials)
    parts = tuple(_part(p, v, normal_matrix) for p in base.parts)
    keypoints = tuple(replace(k, position_m=vec3(v.deform(k.position_m))) for k in base.keypoints)
    wireframe = tuple(_edge(e, v, normal_matrix) for e in base.wireframe)
    occluders = Occluders(vertices_m=v.deform(base.occluders.vertices_m), triangles=base.occluders.triangles)
    return replace(
        base,
        sha256=content_sha256(materials, parts, keypoints, wireframe, occluders, base.pictures),
        materials=materials,
        parts=parts,
        keypoints=keypoints,
        wireframe=wireframe,
        occluders=occluders,
    )


def _surface(material: Material, change: SurfaceVariation | None) -> Material:
    if change is None:
        return material
    red, green, blue = (float(np.clip(c * change.reflectance, 0.0, 1.0)) for c in material.base_color)
    roughness = float(np.clip(material.roughness * change.roughness, 0.02, 1.0))
    return replace(material, base_color=(red, green, blue), roughness=roughness)


def _part(part: Part, v: CraftVariation, normal_matrix: FloatArray) -> Part:
    return replace(
        part,
        positions_m=v.deform(part.positions_m).astype(np.float32),
        normals=_transform_normals(part.normals, normal_matrix).astype(np.float32),
    )


def _edge(edge: Edge, v: CraftVariation, normal_matrix: FloatArray) -> Edge:
    normals: tuple[Vec3, ...] = tuple(vec3(_transform_normals(n, normal_matrix)) for n in edge.normals)
    return replace(edge, a_m=vec3(v.deform(edge.a_m)), b_m=vec3(v.deform(edge.b_m)), normals=normals)


def _transform_normals(normals: ArrayLike, matrix: FloatArray) -> FloatArray:
    transformed = np.asarray(normals, float) @ matrix.T
    return np.asarray(transformed / np.maximum(np.linalg.norm(transformed, axis=-1, keepdims=True), 1e-30))
