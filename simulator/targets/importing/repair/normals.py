"""Corner normals (the file's if they are consistent, else computed with creases), and the split into parts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.geometry.topology import components, edge_table
from flyaround.simulator.targets.model import Part

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.geometry.topology import MeshBody
    from flyaround.simulator.runtime.arrays import BoolArray, FloatArray
    from flyaround.simulator.targets.model import Material

CREASE_RAD = np.deg2rad(32.0)
"""Crease angle above which an edge stays sharp, as in most modelling tools (30 to 35 deg) [rad]."""
MIN_NORMAL_COSINE = 0.1
"""Smallest cosine between a corner's normal and its face's normal. Smooth rims stay above it."""

MIN_FITTING_SHARE = 0.999
"""Share of corners that must fit; single slivers may not, whose normals neighbours determine."""


def normals_fit(body: MeshBody) -> bool:
    """Return True if the file's normals are usable: present, finite, non-zero, and on the faces' side."""
    n = body.corner_normals
    if n is None or not np.isfinite(n).all():
        return False
    length = np.linalg.norm(n, axis=2)
    if (length < 1e-6).any():  # a normal of no length, as exporters write for degenerate faces
        return False
    face = body.face_vectors
    face = face / np.linalg.norm(face, axis=1, keepdims=True)
    fits = np.einsum("fkj,fj->fk", n / length[..., None], face) > MIN_NORMAL_COSINE
    return bool(fits.mean() > MIN_FITTING_SHARE)


def smooth_normals(body: MeshBody) -> FloatArray:
    """Return (F, 3, 3) unit normals, smoothed across faces that meet at less than the crease angle.

    Weights are the angles at the corner (Thuermer and Wuethrich 1998).
    """
    face = body.face_vectors
    unit = face / np.linalg.norm(face, axis=1, keepdims=True)
    table = edge_table(body.triangles)
    f, g = (table.pairs // 3).T
    smooth = np.einsum("ij,ij->i", unit[f], unit[g]) > np.cos(CREASE_RAD)
    h, k = table.pairs[smooth].T
    start = body.triangles.ravel()
    next_corner = 3 * (np.arange(len(start)) // 3) + (np.arange(len(start)) + 1) % 3
    is_same_direction = start[h] == start[k]
    # corners at one end of the edge, then at the other
    links = np.concatenate([
        np.stack([h, np.where(is_same_direction, k, next_corner[k])], axis=1),
        np.stack([next_corner[h], np.where(is_same_direction, next_corner[k], k)], axis=1),
    ])  # fmt: skip
    count, group = components(links, len(start))
    p = body.positions_m[body.triangles]
    forward, backward = np.roll(p, -1, axis=1) - p, np.roll(p, 1, axis=1) - p
    cosine = np.einsum("fkj,fkj->fk", forward, backward)
    cosine /= np.linalg.norm(forward, axis=2) * np.linalg.norm(backward, axis=2)
    weighted = np.arccos(np.clip(cosine, -1, 1))[..., None] * unit[:, None]
    flat = weighted.reshape(-1, 3)
    total = np.stack([np.bincount(group, flat[:, k], count) for k in range(3)], axis=1)[group].reshape(
        -1, 3, 3
    )
    length = np.linalg.norm(total, axis=2, keepdims=True)
    normals = np.where(length > 1e-9, total / np.maximum(length, 1e-12), unit[:, None])
    return _replace_inconsistent(normals, unit)


def file_normals(body: MeshBody) -> FloatArray:
    """Return (F, 3, 3) unit normals of the file, and flat ones on faces where they are inconsistent."""
    n = body.corner_normals
    if n is None:
        return smooth_normals(body)
    face = body.face_vectors
    unit = face / np.linalg.norm(face, axis=1, keepdims=True)
    return _replace_inconsistent(n / np.linalg.norm(n, axis=2, keepdims=True), unit)


def _replace_inconsistent(normals: FloatArray, unit: FloatArray) -> FloatArray:
    inconsistent: BoolArray = (np.einsum("fkj,fj->fk", normals, unit) <= MIN_NORMAL_COSINE).any(axis=1)
    out = normals.copy()
    out[inconsistent] = unit[inconsistent][:, None]
    return out


def split_by_material(body: MeshBody, normals: FloatArray, materials: Sequence[Material]) -> list[Part]:
    """Split a body into one part per material; corners with equal position, normal and texture coordinates are shared.

    Parameters
    ----------
    body : MeshBody
        Body with one material per face.
    normals : (F, 3, 3) array
        Unit normals of the faces' corners.
    materials : sequence of Material
        Materials of the model.
    """
    parts = []
    material_indices = np.unique(body.face_material)
    for k in material_indices:
        faces = body.face_material == k
        vertex = body.triangles[faces].ravel()
        corner_normals = normals[faces].reshape(-1, 3).astype(np.float32)
        # normals are equal if they round to the same multiples of 1e-4, which is less than a grey level
        step = np.rint(corner_normals * 1e4).astype(np.int64) + 20_000
        key = (step[:, 0] * 50_000 + step[:, 1]) * 50_000 + step[:, 2]
        uv = None
        if body.corner_uv is not None and any(materials[int(k)].textures):
            uv = body.corner_uv[faces].reshape(-1, 2).astype(np.float32)
            key = np.unique(np.column_stack([key, uv.view(np.int32)]), axis=0, return_inverse=True)[1].ravel()
        order = np.lexsort((key, vertex))
        is_new = np.concatenate([[True], (np.diff(vertex[order]) != 0) | (np.diff(key[order]) != 0)])
        index = np.empty(len(order), np.int64)
        index[order] = np.cumsum(is_new) - 1
        first = order[is_new]
        unit = corner_normals[first] / np.linalg.norm(corner_normals[first], axis=1, keepdims=True)
        material = materials[int(k)].name
        parts.append(
            Part(
                name=body.name if len(material_indices) == 1 else f"{body.name}.{material}",
                material=material,
                positions_m=body.positions_m[vertex[first]].astype(np.float32),
                normals=unit.astype(np.float32),
                triangles=index.reshape(-1, 3),
                uv=None if uv is None else uv[first],
            )
        )
    return parts
