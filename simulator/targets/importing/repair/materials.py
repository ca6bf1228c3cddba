"""Materials of an imported craft: those in use, up to the limit."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.geometry.topology import MeshBody
from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.targets.importing.read.textures import mean_colour, without_textures
from flyaround.simulator.targets.model import Material

if TYPE_CHECKING:
    from flyaround.simulator.targets.model import TextureImage

MAX_MATERIALS = 250
"""Largest number of materials, whose index the renderer stores in eight bits."""


def used_materials(bodies: list[MeshBody], materials: list[Material]) -> tuple[list[Material], list[str]]:
    """Keep the materials in use and renumber them; beyond the limit, replace the rarest by the nearest in colour."""
    area = np.zeros(len(materials))
    for b in bodies:
        area += np.bincount(b.face_material, np.linalg.norm(b.face_vectors, axis=1), minlength=len(materials))
    in_use = np.flatnonzero(area > 0)
    most_used = np.sort(in_use[np.argsort(-area[in_use], kind="stable")[:MAX_MATERIALS]])
    look = np.array([(*m.base_color, m.metallic, m.roughness) for m in materials])
    into = np.zeros(len(materials), np.int64)
    for k in in_use:
        into[k] = (
            int(np.argmin(((look[most_used] - look[k]) ** 2).sum(axis=1)))
            if k not in most_used
            else int(np.searchsorted(most_used, k))
        )
    for b in bodies:
        b.face_material = into[b.face_material]
    n_dropped = len(in_use) - len(most_used)
    notes = (
        [f"{n_dropped} materials of the least area became their nearest in colour"] if n_dropped > 0 else []
    )
    return [materials[int(k)] for k in most_used], notes


def plain_where_unwrapped(
    bodies: list[MeshBody], materials: list[Material], pictures: dict[str, TextureImage]
) -> tuple[list[Material], list[str]]:
    """Give faces without texture coordinates a plain material of the texture's mean colour."""
    out, notes = list(materials), []
    users: dict[int, list[MeshBody]] = {}
    for b in bodies:
        for k in np.unique(b.face_material):
            users.setdefault(int(k), []).append(b)
    for number, material in enumerate(materials):
        if number not in users or not any(material.textures):
            continue
        bare = []
        for b in users[number]:
            of_material = b.face_material == number
            bare.append(
                of_material
                if b.corner_uv is None
                else of_material & ~np.isfinite(b.corner_uv).all(axis=(1, 2))
            )
        count = sum(int(x.sum()) for x in bare)
        if not count:
            continue
        rgb = np.asarray(material.base_color)
        if material.base_color_texture:
            rgb = rgb * mean_colour(pictures[material.base_color_texture])
        for b, faces in zip(users[number], bare, strict=True):
            b.face_material = np.where(faces, len(out), b.face_material)
        plain = replace(without_textures(material), name=f"{material.name}-plain", base_color=vec3(rgb))
        out.append(plain)
        notes.append(
            f"{count:,} faces of material {material.name!r} have no texture coordinates: given its mean colour"
        )
    return out, notes
