"""Safe repairs of duplicate vertices, degenerate faces and winding; unsafe cases raise an error."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.geometry.topology import (
    MeshBody,
    components,
    edge_table,
    used_vertices,
    weld,
)
from flyaround.simulator.targets.check_target import MIN_AREA_M2

if TYPE_CHECKING:
    from flyaround.simulator.geometry.topology import EdgeTable
    from flyaround.simulator.runtime.arrays import BoolArray, FloatArray, IntArray
    from flyaround.simulator.targets.importing.read.raw_model import RawPart

MIN_FACE_HEIGHT = 3e-7
"""Height of a face, relative to the craft's size, below which float32 cannot represent its normal."""
MAX_OPEN_SHARE = 0.02
"""Share of open edges up to which the signed volume decides which side is outside."""

WHY_OPEN = "caps would not make a solid, or would lie on other faces"


def plural(count: int, singular: str, plural: str = "") -> str:
    """Return a count with its noun; the plural ends in s unless given."""
    return f"{count:,} {singular if count == 1 else plural or singular + 's'}"


@dataclass
class RepairCounts:
    """Counts of repairs over all parts."""

    merged_vertices: int = 0
    thin_faces: int = 0
    duplicate_faces: int = 0
    reversed_faces: int = 0
    filled_holes: int = 0
    open_holes: int = 0
    reversed_parts: list[str] = field(default_factory=list)

    def lines(self) -> list[str]:
        """Return one line per kind of repair."""
        out = []
        if self.merged_vertices:
            out.append(f"merged {plural(self.merged_vertices, 'duplicate vertex', 'duplicate vertices')}")
        if self.thin_faces:
            out.append(f"dropped {plural(self.thin_faces, 'face')} without area")
        if self.duplicate_faces:
            out.append(f"dropped {plural(self.duplicate_faces, 'duplicate face')}")
        if self.filled_holes:
            out.append(f"filled {plural(self.filled_holes, 'hole')} with flat fans")
        if self.open_holes:
            out.append(f"left {plural(self.open_holes, 'hole')} open: {WHY_OPEN}")
        if self.reversed_faces:
            parts = self.reversed_parts
            names = ", ".join(repr(n) for n in parts[:4]) + ", ..." * (len(parts) > 4)
            out.append(f"turned {plural(self.reversed_faces, 'face')} to look outwards (part {names})")
        return out


def weld_body(part: RawPart, low: FloatArray, extent: float, counts: RepairCounts) -> MeshBody:
    """Weld the part's vertices and drop degenerate and duplicate faces."""
    vertices = used_vertices(part.triangles, len(part.positions_m))
    positions, index = weld(part.positions_m[vertices], low, extent)
    counts.merged_vertices += len(vertices) - len(positions)
    new_index = np.empty(len(part.positions_m), np.int64)
    new_index[vertices] = index
    triangles = new_index[part.triangles]
    normals = None if part.normals is None else part.normals[part.triangles]
    body = MeshBody(
        name=part.name,
        # in the precision of the target file
        positions_m=positions.astype(np.float32).astype(float),
        triangles=triangles,
        face_material=part.face_material,
        corner_normals=normals,
        corner_uv=part.corner_uv,
    )
    return drop_slivers(body, extent, counts)


def drop_slivers(body: MeshBody, extent: float, counts: RepairCounts) -> MeshBody:
    """Drop faces too thin for float32, and faces that repeat another with the same winding."""
    corners = body.positions_m[body.triangles]
    longest = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).max(axis=1)
    twice_area = np.linalg.norm(body.face_vectors, axis=1)
    # twice the smallest area that `check_target` accepts: float32 may still shrink it
    is_thin = twice_area <= np.maximum(MIN_FACE_HEIGHT * extent * longest, 4 * MIN_AREA_M2)
    counts.thin_faces += int(is_thin.sum())
    body = body.submesh(~is_thin)
    is_copy = _copies(body.triangles)
    counts.duplicate_faces += int(is_copy.sum())
    return body.submesh(~is_copy)


def _copies(triangles: IntArray) -> BoolArray:
    """Return a mask of faces that repeat an earlier one. A face of opposite winding is a sheet's back, not a copy."""
    # rotate each face to its lowest corner first, which keeps the winding
    start = np.argmin(triangles, axis=1)
    rows = np.arange(len(triangles))
    a, b, c = (triangles[rows, (start + k) % 3] for k in range(3))
    _, edge = np.unique(a * (int(triangles.max(initial=0)) + 1) + b, return_inverse=True)
    key = edge.ravel() * (int(triangles.max(initial=0)) + 1) + c
    order = np.argsort(key, kind="stable")
    is_copy = np.zeros(len(triangles), bool)
    is_copy[order[1:]] = np.diff(key[order]) == 0
    return is_copy


def orient_body(body: MeshBody, source: str, counts: RepairCounts, *, lenient: bool) -> tuple[MeshBody, int]:
    """Orient every connected piece consistently and outwards.

    The outside of a closed piece follows from the sign of its volume, that of an open piece from the file's normals or,
    without normals, from the orientation of the larger part of its area.

    Parameters
    ----------
    body : MeshBody
        Body to orient.
    source : str
        File and part, for messages.
    counts : RepairCounts
        Counts to increase.
    lenient : bool
        True to accept one-sided pieces.

    Returns
    -------
    tuple
        The oriented body, and the number of faces in one-sided pieces.

    Raises
    ------
    UserError
        If a piece is one-sided (unless ``lenient``).
    """
    table = edge_table(body.triangles)
    count = len(body.triangles)
    faces = table.pairs // 3
    start = body.triangles.ravel()
    # two faces of one edge agree if they traverse it in opposite directions
    is_clashing = (start[table.pairs[:, 0]] == start[table.pairs[:, 1]]).astype(np.int64)
    links = np.concatenate(
        [np.stack([2 * faces[:, 0] + s, 2 * faces[:, 1] + (s ^ is_clashing)], axis=1) for s in (0, 1)]
    )
    _, label = components(links, 2 * count)
    label_kept, label_reversed = label[0::2], label[1::2]
    is_one_sided = label_kept == label_reversed
    if is_one_sided.any() and not lenient:
        raise UserError(
            f"{source}: {plural(int(is_one_sided.sum()), 'face forms', 'faces form')} a one-sided surface (the first "
            f"is face {int(np.argmax(is_one_sided))}); cut it in the modelling tool, or add "
            "--keep-non-manifold to take it as it is"
        )
    is_flipped = (label_kept > label_reversed) & ~is_one_sided
    _, piece = np.unique(np.minimum(label_kept, label_reversed), return_inverse=True)
    piece = piece.ravel()
    is_flipped ^= _is_inverted(body, table, piece, is_flipped)[piece] & ~is_one_sided
    if is_flipped.any():
        counts.reversed_faces += int(is_flipped.sum())
        counts.reversed_parts.append(body.name)
    triangles = body.triangles.copy()
    triangles[is_flipped] = triangles[is_flipped][:, ::-1]
    normals = body.corner_normals
    if normals is not None:
        normals = normals.copy()
        normals[is_flipped] = normals[is_flipped][:, ::-1]
    uv = body.corner_uv
    if uv is not None:
        uv = uv.copy()
        uv[is_flipped] = uv[is_flipped][:, ::-1]
    return replace(body, triangles=triangles, corner_normals=normals, corner_uv=uv), int(is_one_sided.sum())


def _is_inverted(body: MeshBody, table: EdgeTable, piece: IntArray, is_flipped: BoolArray) -> BoolArray:
    """Return a mask of the pieces that are inside out once the faces in ``is_flipped`` are reversed."""
    n = int(piece.max(initial=-1)) + 1
    sign = np.where(is_flipped, -1.0, 1.0)
    corners = body.positions_m[body.triangles]
    sums = np.stack([np.bincount(piece, corners[..., k].mean(axis=1), n) for k in range(3)], axis=1)
    centre = sums / np.bincount(piece, minlength=n)[:, None]
    corners = corners - centre[piece][:, None]
    volume = np.bincount(
        piece, sign * np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6, n
    )
    area_vector = body.face_vectors * sign[:, None]
    twice_area = np.linalg.norm(area_vector, axis=1)
    total = np.bincount(piece, twice_area, n) / 2
    edge_piece = piece[table.first // 3]
    share_open = np.bincount(edge_piece, table.open, n) / np.maximum(np.bincount(edge_piece, minlength=n), 1)
    # a closed sphere has V = 0.094 A^1.5; a double sheet has none
    is_solid = (share_open <= MAX_OPEN_SHARE) & (np.abs(volume) > 1e-4 * total**1.5)
    score = np.bincount(piece, twice_area * sign, n)
    if body.corner_normals is not None:
        agree = np.sign(np.einsum("ij,ij->i", area_vector, np.nan_to_num(body.corner_normals).sum(axis=1)))
        by_normals = np.bincount(piece, twice_area * agree, n)
        score = np.where(by_normals != 0, by_normals, score)
    return np.asarray(np.where(is_solid, volume, score) < 0)


def check_surface(
    body: MeshBody, source: str, *, keep_holes: bool, keep_non_manifold: bool, tried_to_fill: bool = False
) -> tuple[int, int, int]:
    """Count holes and edges of three or more faces; raise unless they are allowed.

    Returns
    -------
    tuple of int
        Numbers of remaining holes, open edges and non-manifold edges.

    Raises
    ------
    UserError
        If there are holes or non-manifold edges that no option allows; the message names part, counts, the first
        place, and the options.
    """
    table = edge_table(body.triangles)
    bad = table.non_manifold
    if bad.any() and not keep_non_manifold:
        first = int(np.argmax(bad))
        raise UserError(
            f"{source}: {plural(int(bad.sum()), 'edge belongs', 'edges belong')} to three or more faces (the first at "
            f"{_place(body, table.ends[first])}, face {int(table.first[first]) // 3}); separate the surfaces in the "
            "modelling tool, or add --keep-non-manifold"
        )
    ends = table.ends[table.open]
    if not len(ends):
        return 0, 0, int(bad.sum())
    _, compact = np.unique(ends, return_inverse=True)
    compact = compact.reshape(-1, 2)
    holes, _ = components(compact, int(compact.max()) + 1)
    if not keep_holes:
        first = int(np.argmax(table.open))
        raise UserError(
            f"{source}: {plural(holes, 'hole')} with {plural(len(ends), 'open edge')} (the first at "
            f"{_place(body, table.ends[first])}, face {int(table.first[first]) // 3}); close them in the modelling "
            "tool, or "
            + (
                f"add --keep-holes too: {WHY_OPEN}"
                if tried_to_fill
                else "add --keep-holes to take open surfaces as sheets seen from both sides, or --fill-holes to cap "
                "the holes where that gives a solid"
            )
        )
    return holes, len(ends), int(bad.sum())


def _place(body: MeshBody, ends: IntArray) -> str:
    middle = body.positions_m[ends].mean(axis=0)
    return "(" + ", ".join(f"{x:.3f}" for x in middle) + ") m"
