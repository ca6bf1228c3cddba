"""Capping of holes in a surface, where the result is a solid.

A connected piece is capped as a whole or not at all. All its openings must be simple rings, the closed piece must
enclose a volume, and no cap may coincide with other faces: window frames stay open, because the glass is another part.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.geometry.topology import edge_table, face_bodies
from flyaround.simulator.geometry.triangles import face_vectors
from flyaround.simulator.targets.importing.repair.coincident_faces import (
    MIN_SEPARATION,
    FaceTable,
    coincident_pairs,
    six_volumes,
)

if TYPE_CHECKING:
    from flyaround.simulator.geometry.topology import MeshBody
    from flyaround.simulator.runtime.arrays import FloatArray, IntArray

SHEET_RATIO = 1e-4
"""Volume over area to the 3/2 below which a closed surface is a double sheet; a sphere has 0.094."""
FILLING_DISTANCE = 0.01
"""Distance, relative to an opening's width, within which another part's face counts as its filling."""


@dataclass(frozen=True, eq=False)
class CappingResult:
    """Bodies after capping.

    Parameters
    ----------
    bodies : list of MeshBody
        The bodies.
    filled : int
        Number of openings that were capped.
    left : int
        Number of openings that were not.
    """

    bodies: list[MeshBody]
    filled: int
    left: int


@dataclass(frozen=True, eq=False)
class _Cap:
    """A fan over one opening: the corners of its faces, with body, piece and material."""

    body: int
    piece: int
    loop: IntArray
    material: int
    corners_m: FloatArray
    width_m: float


def cap_solids(bodies: list[MeshBody], extent_m: float) -> CappingResult:
    """Cap the openings of the pieces that become solids."""
    faces = FaceTable.from_bodies(bodies)
    caps: list[_Cap] = []
    openings = 0
    count = 0
    for number, body in enumerate(bodies):
        table = edge_table(body.triangles)
        n_pieces, piece = face_bodies(body.triangles, table)
        loops, is_capable = _rings(body, piece)
        openings += len(loops) + int((~np.array(list(is_capable.values()), bool)).sum())
        body_caps = [_cap(body, number, piece[owner], count, loop, owner) for loop, owner in loops]
        caps += [c for c in body_caps if is_capable[c.piece - count]]
        count += n_pieces
    solid = _solid_pieces(faces, caps)
    caps = [c for c in caps if c.piece in solid]
    conflicts = _find_conflicts(faces, caps, extent_m)
    caps = [c for c in caps if c.piece not in conflicts]
    capped = [_add_caps(b, [c for c in caps if c.body == k]) for k, b in enumerate(bodies)]
    return CappingResult(capped, len(caps), openings - len(caps))


def _rings(body: MeshBody, piece: IntArray) -> tuple[list[tuple[IntArray, int]], dict[int, bool]]:
    """Find the simple rings of open edges.

    Returns
    -------
    loops : list of tuple
        Vertices of each ring, and one of its faces.
    is_capable : dict
        For each open piece, True if all of its open edges form such rings.
    """
    table = edge_table(body.triangles)
    half = table.first[table.open]
    start = body.triangles.ravel()[half]
    end = np.roll(body.triangles, -1, axis=1).ravel()[half]
    is_capable = dict.fromkeys(np.unique(piece[half // 3]).tolist(), True)
    for k in np.unique(piece[table.first[table.non_manifold] // 3]).tolist():
        is_capable[k] = False
    follow = dict(zip(start.tolist(), end.tolist(), strict=True))
    owner = dict(zip(start.tolist(), (half // 3).tolist(), strict=True))
    if len(follow) < len(start):  # rings that meet in a corner
        corner, times = np.unique(start, return_counts=True)
        for k in np.unique(piece[(half // 3)[np.isin(start, corner[times > 1])]]).tolist():
            is_capable[k] = False
    loops = []
    while follow:
        ring = [next(iter(follow))]
        while ring[-1] in follow:
            ring.append(follow.pop(ring[-1]))
        if ring[-1] != ring[0] or len(ring) < 4:
            is_capable[int(piece[owner[ring[0]]])] = False
        else:
            loops.append((np.array(ring[:-1]), owner[ring[0]]))
    return loops, is_capable


def _cap(body: MeshBody, number: int, piece: int, first_piece: int, loop: IntArray, owner: int) -> _Cap:
    """Return a fan around the ring's centre, wound opposite to the ring."""
    outline = body.positions_m[loop]
    middle = outline.mean(axis=0).astype(np.float32).astype(float)
    if len(loop) == 3:
        corners = outline[::-1][None]
    else:
        corners = np.stack(
            [np.roll(outline, -1, axis=0), outline, np.broadcast_to(middle, outline.shape)], axis=1
        )
    width = float(np.linalg.norm(np.ptp(outline, axis=0)))
    return _Cap(number, int(piece) + first_piece, loop, int(body.face_material[owner]), corners, width)


def _solid_pieces(faces: FaceTable, caps: list[_Cap]) -> set[int]:
    """Return the pieces that enclose a volume with their caps."""
    if not caps:
        return set()
    n = int(faces.piece.max()) + 1
    corners = np.concatenate([faces.corners_m, *(c.corners_m for c in caps)])
    piece = np.concatenate([faces.piece, *(np.full(len(c.corners_m), c.piece) for c in caps)])
    centre = corners.mean(axis=(0, 1))
    volume = np.abs(np.bincount(piece, six_volumes(corners - centre), n)) / 6
    vectors = face_vectors(corners)
    area = np.bincount(piece, np.linalg.norm(vectors, axis=1), n) / 2
    return {c.piece for c in caps if volume[c.piece] > SHEET_RATIO * area[c.piece] ** 1.5}


def _find_conflicts(faces: FaceTable, caps: list[_Cap], extent_m: float) -> set[int]:
    """Return the pieces with a cap that coincides with another face, or is close to another piece's face."""
    if not caps:
        return set()
    n = len(faces.corners_m)
    lengths = [len(c.corners_m) for c in caps]
    corners = np.concatenate([faces.corners_m, *(c.corners_m for c in caps)])
    piece = np.concatenate([faces.piece, np.repeat([c.piece for c in caps], lengths)])
    ring = np.concatenate([np.full(n, -1), np.repeat(np.arange(len(caps)), lengths)])
    width = np.concatenate([np.zeros(n), np.repeat([c.width_m for c in caps], lengths)])
    tolerance_m = np.maximum(MIN_SEPARATION * extent_m, FILLING_DISTANCE * width)
    pairs = coincident_pairs(corners, extent_m, tolerance_m, ring >= 0)
    if pairs is None:  # too many to decide: leave them open
        return {c.piece for c in caps}
    a, b = pairs.T
    pairs = pairs[ring[a] != ring[b]]
    a, b = pairs.T
    # where two solids touch, the coincident faces have opposite normals and neither is visible: no clash
    is_closed = np.isin(piece, list({c.piece for c in caps})) | np.append(
        faces.closed, np.ones(sum(lengths), bool)
    )
    normal = face_vectors(corners)
    outward = normal * _outward_sign(corners, piece)[:, None]
    is_parallel = np.einsum("ij,ij->i", outward[a], outward[b]) > 0
    is_visible = (piece[a] == piece[b]) | is_parallel | ~(is_closed[a] & is_closed[b])
    return {int(piece[k]) for pair in pairs[is_visible] for k in pair if ring[k] >= 0}


def _outward_sign(corners: FloatArray, piece: IntArray) -> FloatArray:
    """Return (F,) -1 if the piece of a face is inside out, else 1."""
    centre = corners.mean(axis=(0, 1))
    volume = np.bincount(piece, six_volumes(corners - centre))
    return np.where(volume < 0, -1.0, 1.0)[piece]


def _add_caps(body: MeshBody, caps: list[_Cap]) -> MeshBody:
    if not caps:
        return body
    points, faces, materials = [body.positions_m], [body.triangles], [body.face_material]
    count = len(body.positions_m)
    for cap in caps:
        if len(cap.loop) == 3:
            cap_faces = cap.loop[::-1][None]
        else:
            points.append(cap.corners_m[:1, 2])
            cap_faces = np.stack([np.roll(cap.loop, -1), cap.loop, np.full(len(cap.loop), count)], axis=1)
            count += 1
        faces.append(cap_faces)
        materials.append(np.full(len(cap_faces), cap.material))
    n_added = sum(map(len, faces[1:]))
    uv = body.corner_uv
    return replace(
        body,
        positions_m=np.concatenate(points),
        triangles=np.concatenate(faces),
        face_material=np.concatenate(materials),
        corner_normals=None,  # new faces have no normals from the file
        corner_uv=None if uv is None else np.concatenate([uv, np.full((n_added, 3, 2), np.nan)]),
    )
