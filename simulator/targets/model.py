"""The target: geometry by named parts, PBR materials, keypoints, wireframe, mass properties, levels of detail."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from flyaround.simulator.runtime.arrays import Float32Array, FloatArray, IntArray, Mat3, Vec3

Detail = Literal["full", "medium", "low"]
DETAILS: tuple[Detail, ...] = ("full", "medium", "low")
"""Levels of detail, finest first. All have the same keypoints, wireframe, occluders, mass and frames."""
PartClass = Literal["solar_array", "antenna", "propulsion", "docking", "sensor", "radiator", "body"]


@dataclass(frozen=True, kw_only=True)
class Material:
    """Metallic-roughness material of glTF 2.0, with a clear coat for cover glass.

    Parameters
    ----------
    name : str
        Name, unique in the target.
    base_color : tuple of float
        Linear reflectance, RGB, 0..1.
    metallic : float, optional
        Metallic factor as in glTF 2.0.
    roughness : float, optional
        Roughness factor as in glTF 2.0.
    clearcoat : float, optional
        Factor of KHR_materials_clearcoat.
    clearcoat_roughness : float, optional
        Roughness factor of KHR_materials_clearcoat.
    crinkle : float, optional
        Amplitude of the procedural normal detail of insulation blankets, 0..1.
    anisotropy : float, optional
        Strength of KHR_materials_anisotropy, 0..1, by which a brushed metal's highlight is wider across its grain.
    grain : array, optional
        Direction of the brushing, projected on each face, target frame; not normalised.
    turned : bool, optional
        True if the grain runs around that direction, as after turning on a lathe, instead of along it.
    base_color_texture : str, optional
        Name of a `TextureImage` (sRGB) that multiplies ``base_color`` where the part has texture coordinates; empty for
        none.
    metallic_roughness_texture : str, optional
        Name of an image whose green and blue multiply ``roughness`` and ``metallic``.
    normal_texture : str, optional
        Name of an image of normals in the tangent frame, green towards the image's top.
    """

    name: str
    base_color: Vec3
    metallic: float = 0.0
    roughness: float = 0.5
    clearcoat: float = 0.0
    clearcoat_roughness: float = 0.05
    crinkle: float = 0.0
    anisotropy: float = 0.0
    grain: Vec3 = (0.0, 0.0, 0.0)
    turned: bool = False
    base_color_texture: str = ""
    metallic_roughness_texture: str = ""
    normal_texture: str = ""

    @property
    def textures(self) -> tuple[str, str, str]:
        """Names of the base-colour, metalness-roughness and normal textures; empty if absent."""
        return (self.base_color_texture, self.metallic_roughness_texture, self.normal_texture)


@dataclass(frozen=True, kw_only=True)
class TextureImage:
    """A texture as a PNG or JPEG file, by name; rows from the top, repeated outside 0..1."""

    name: str
    data: bytes


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """A named piece of the mesh with one material.

    Parameters
    ----------
    name : str
        Name, unique in the target.
    material : str
        Name of its material.
    positions_m : (N, 3) float32 array
        Vertices, model frame [m].
    normals : (N, 3) float32 array
        Outward unit normals.
    triangles : (M, 3) array
        Indices, counter-clockwise seen from outside.
    uv : (N, 2) float32 array, optional
        Coordinates as in glTF, (0, 0) the upper left corner of an image; or None.
    """

    name: str
    material: str
    positions_m: Float32Array
    normals: Float32Array
    triangles: IntArray
    uv: Float32Array | None = None


@dataclass(frozen=True, kw_only=True)
class Keypoint:
    """A named point of the model with a label."""

    name: str
    position_m: Vec3


@dataclass(frozen=True, kw_only=True)
class Edge:
    """A straight segment of the wireframe and the outward normals of the faces that meet there.

    An edge is visible only if at least one of its faces is turned to the camera. The edge of a thin round member (rod)
    is its axis; it is visible from all sides, and a camera sees the two outlines beside it.

    Parameters
    ----------
    name : str
        Name of the edge.
    a_m : tuple of float
        First end, model frame [m].
    b_m : tuple of float
        Second end, model frame [m].
    normals : tuple of tuple of float, optional
        Outward normals of the adjacent faces; empty for a rod.
    radius_m : float, optional
        Radius of a rod, the mean for a tapered one; 0 for other edges.
    """

    name: str
    a_m: Vec3
    b_m: Vec3
    normals: tuple[Vec3, ...] = ()
    radius_m: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Occluders:
    """Coarse closed bodies that represent the craft in a board's visibility tests.

    Parameters
    ----------
    vertices_m : (V, 3) array, optional
        float64, target frame.
    triangles : (T, 3) array, optional
        Indices, counter-clockwise seen from outside.
    """

    vertices_m: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    triangles: IntArray = field(default_factory=lambda: np.zeros((0, 3), np.int64))


@dataclass(frozen=True, kw_only=True)
class MassProperties:
    """Mass [kg], centre of mass in the model frame [m], inertia about it, model axes [kg m2]."""

    mass_kg: float
    com_m: Vec3
    inertia_kg_m2: Mat3


@dataclass(frozen=True, kw_only=True, eq=False)
class Target:
    """One spacecraft: the contents of its target file.

    Parameters
    ----------
    name : str
        Name on the command line.
    title : str
        Name for people.
    sha256 : str
        Hash of geometry, materials, keypoints and wireframe, recorded with every image.
    materials : tuple of Material
        Materials of the parts.
    parts : tuple of Part
        The mesh.
    keypoints : tuple of Keypoint
        Labelled points.
    wireframe : tuple of Edge
        Labelled edges.
    mass : MassProperties
        Mass, centre of mass and inertia.
    frames : dict, optional
        Named frames on the craft (docking port, grasp point): origin [m] and axis.
    symmetry : tuple of tuple of float, optional
        Rotations (quaternions, model axes) under which the craft looks nearly the same.
    notes : str, optional
        Sources of the dimensions.
    occluders : Occluders, optional
        Coarse substitute of the geometry for visibility tests.
    pictures : tuple of TextureImage, optional
        The textures that materials name.
    part_classes : dict, optional
        Explicit classes of parts, by name; other classes follow from the parts' names.
    """

    name: str
    title: str
    sha256: str
    materials: tuple[Material, ...]
    parts: tuple[Part, ...]
    keypoints: tuple[Keypoint, ...]
    wireframe: tuple[Edge, ...]
    mass: MassProperties
    frames: dict[str, tuple[Vec3, Vec3]] = field(default_factory=dict)
    symmetry: tuple[tuple[float, float, float, float], ...] = ()
    notes: str = ""
    occluders: Occluders = field(default_factory=Occluders)
    pictures: tuple[TextureImage, ...] = ()
    part_classes: dict[str, PartClass] = field(default_factory=dict)


def split_level(name: str) -> tuple[str, Detail]:
    """Return the craft and the level of a name such as ``tango@low``; without a level, full detail."""
    craft, _, level = name.rpartition("@")
    for detail in DETAILS:
        if craft and level == detail:
            return craft, detail
    return name, "full"


def level_name(name: str, detail: Detail) -> str:
    """Return the name of a craft at a level; the inverse of `split_level`.

    Returns
    -------
    str
        Name such as ``tango@low``; the name alone for full detail.
    """
    return name if detail == "full" else f"{name}@{detail}"
