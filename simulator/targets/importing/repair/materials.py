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
    for body in bodies:
        area += np.bincount(
            body.face_material, np.linalg.norm(body.face_vectors, axis=1), minlength=len(materials)
        )
    in_use = np.flatnonzero(area > 0)
    most_used = np.sort(in_use[np.argsort(-area[in_use], kind="stable")[:MAX_MATERIALS]])
    appearance = np.array([(*m.base_color, m.metallic, m.roughness) for m in materials])
    new_index = np.zeros(len(materials), np.int64)
    for k in in_use:
        new_index[k] = (
            int(np.argmin(((appearance[most_used] - appearance[k]) ** 2).sum(axis=1)))
            if k not in most_used
            else int(np.searchsorted(most_used, k))
        )
    for body in bodies:
        body.face_material = new_index[body.face_material]
    n_dropped = len(in_use) - len(most_used)
    notes = (
        [f"{n_dropped} materials of the least area became their nearest in colour"] if n_dropped > 0 else []
    )
    return [materials[int(k)] for k in most_used], notes


def replace_missing_textures(
    bodies: list[MeshBody], materials: list[Material], pictures: dict[str, TextureImage]
) -> tuple[list[Material], list[str]]:
    """Give faces without texture coordinates a material of the texture's mean colour.

    Parameters
    ----------
    bodies : list of MeshBody
        Bodies; their face materials are changed.
    materials : list of Material
        Materials of the bodies.
    pictures : dict
        Textures by name.

    Returns
    -------
    tuple
        Materials with the new ones appended, and one line per change for the user.
    """
    all_materials, notes = list(materials), []
    users: dict[int, list[MeshBody]] = {}
    for body in bodies:
        for k in np.unique(body.face_material):
            users.setdefault(int(k), []).append(body)
    for number, material in enumerate(materials):
        if number not in users or not any(material.textures):
            continue
        faces_by_body = []
        for body in users[number]:
            has_material = body.face_material == number
            faces_by_body.append(
                has_material
                if body.corner_uv is None
                else has_material & ~np.isfinite(body.corner_uv).all(axis=(1, 2))
            )
        count = sum(int(x.sum()) for x in faces_by_body)
        if not count:
            continue
        rgb = np.asarray(material.base_color)
        if material.base_color_texture:
            rgb = rgb * mean_colour(pictures[material.base_color_texture])
        for body, faces in zip(users[number], faces_by_body, strict=True):
            body.face_material = np.where(faces, len(all_materials), body.face_material)
        untextured = replace(without_textures(material), name=f"{material.name}-plain", base_color=vec3(rgb))
        all_materials.append(untextured)
        notes.append(
            f"{count:,} faces of material {material.name!r} have no texture coordinates: given its mean colour"
        )
    return all_materials, notes
