"""Materials of an imported craft: only those in use, at most as many as can be drawn."""

from __future__ import annotations

import numpy as np

from simulator.targets.importing.topology import Body
from simulator.targets.model import Material

MOST_MATERIALS = 250
"""The renderer keeps a material's number in eight bits."""


def used_materials(bodies: list[Body], materials: list[Material]) -> tuple[list[Material], list[str]]:
    """Materials in use, renumbered in the bodies; beyond the limit the rarest become their nearest in colour."""
    area = np.zeros(len(materials))
    for b in bodies:
        area += np.bincount(b.face_material, np.linalg.norm(b.face_vectors, axis=1), minlength=len(materials))
    used = np.flatnonzero(area > 0)
    kept = np.sort(used[np.argsort(-area[used], kind="stable")[:MOST_MATERIALS]])
    look = np.array([(*m.base_color, m.metallic, m.roughness) for m in materials])
    into = np.zeros(len(materials), np.int64)
    for k in used:
        into[k] = (
            int(np.argmin(((look[kept] - look[k]) ** 2).sum(axis=1)))
            if k not in kept
            else int(np.searchsorted(kept, k))
        )
    for b in bodies:
        b.face_material = into[b.face_material]
    lost = len(used) - len(kept)
    notes = [f"{lost} materials of the least area became their nearest in colour"] if lost > 0 else []
    return [materials[int(k)] for k in kept], notes
