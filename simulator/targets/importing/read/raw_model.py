"""A mesh as read from its file, unchecked: parts with per-face materials, and notes for the user."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from flyaround.simulator.runtime.arrays import FloatArray, IntArray
from flyaround.simulator.targets.model import Material, TextureImage

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

UNNAMED_SURFACE = Material(name="grey-paint", base_color=(0.55, 0.55, 0.55), roughness=0.6)
"""Material of faces without one: mid-grey paint."""


@dataclass(eq=False, kw_only=True)
class RawPart:
    """A named body of a file.

    Parameters
    ----------
    name : str
        Name in the file.
    positions_m : (N, 3) array
        Vertices in the axes of the file; after placement, in the model frame.
    triangles : (F, 3) array
        Indices.
    face_material : (F,) array
        Index into the model's materials.
    normals : (N, 3) array, optional
        Normals from the file, or None.
    face_colour : (F, 3) array, optional
        Linear colour of the vertices or of a texture, NaN where missing; or None.
    corner_uv : (F, 3, 2) array, optional
        Texture coordinates of the corners, origin at the image's top left, NaN where missing; or None.
    """

    name: str
    positions_m: FloatArray
    triangles: IntArray
    face_material: IntArray
    normals: FloatArray | None = None
    face_colour: FloatArray | None = None
    corner_uv: FloatArray | None = None


@dataclass(eq=False, kw_only=True)
class RawModel:
    """A file's parts and materials.

    Parameters
    ----------
    path : Path
        Path of the file.
    kind : str
        Suffix of the file, without its dot.
    parts : list of RawPart
        Bodies of the file.
    materials : list of Material
        Materials, indexed by the parts' faces.
    in_metres : bool, optional
        True if the format defines metres (glTF); STL and OBJ have no unit.
    up : str, optional
        Up axis by the format's rules (glTF: y), or None.
    notes : list of str, optional
        Conversions and losses, one line each, for the user.
    faults : list of str, optional
        Missing or wrong data that are not needed for drawing, one line each; ``--strict`` refuses them.
    pictures : dict, optional
        The textures that materials name, by name.
    openings : int, optional
        Number of open outlines, once the surface has been checked.
    """

    path: Path
    kind: str
    parts: list[RawPart]
    materials: list[Material]
    in_metres: bool = False
    up: str | None = None
    notes: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    pictures: dict[str, TextureImage] = field(default_factory=dict)
    openings: int = 0

    @property
    def triangle_count(self) -> int:
        """Triangles of all parts."""
        return sum(len(p.triangles) for p in self.parts)


def unique_name(name: str, used: set[str]) -> str:
    """Return the name, with a number appended if it is in ``used``."""
    return (
        name
        if name not in used
        else next(n for k in range(2, len(used) + 3) if (n := f"{name}_{k}") not in used)
    )


def unique_names(names: Iterable[str], fallback: str) -> list[str]:
    """Make names unique by appending numbers; empty ones become ``fallback``."""
    counts: dict[str, int] = {}
    unique = []
    for raw in names:
        name = raw.strip() or fallback
        count = counts.get(name, 0)
        candidate = name
        while candidate in counts:
            count += 1
            candidate = f"{name}_{count + 1}"
        counts[name] = count
        counts.setdefault(candidate, 0)
        unique.append(candidate)
    return unique
