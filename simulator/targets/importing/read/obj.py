"""Wavefront OBJ with its .mtl: objects and groups as parts, diffuse colours and textures as materials."""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.importing.read.named_files import split_word, text_lines, unquoted
from flyaround.simulator.targets.importing.read.obj_materials import MaterialLibraries
from flyaround.simulator.targets.importing.read.polygons import are_convex, fan, polygon_triangles
from flyaround.simulator.targets.importing.read.raw_model import (
    UNNAMED_SURFACE,
    RawModel,
    RawPart,
    unique_names,
)
from flyaround.simulator.targets.importing.read.textures import linear_from_srgb

if TYPE_CHECKING:
    from pathlib import Path

    from flyaround.simulator.runtime.arrays import FloatArray, IntArray
    from flyaround.simulator.targets.importing.read.obj_materials import ObjMaterial


MAX_INDEX = 2**40  # no file has so many vertices, and sums of such indices fit in int64
MAX_CLIPPING = 50e6
"""Limit on the sum of squared corner counts of concave polygons, to which the time of ear clipping is proportional."""


CURVES = ("l", "p", "curv", "curv2", "surf")
IGNORED_STATEMENTS = (
    "s", "mg", "vp", "bevel", "c_interp", "d_interp", "lod", "shadow_obj", "trace_obj", "ctech", "stech", "cstype",
    "deg", "bmat", "step", "parm", "trim", "hole", "scrv", "sp", "end", "con",
)  # fmt: skip
"""Statements that change no triangle, or belong to curves, which are reported."""
_COMMENT = re.compile(r"(?:^|\s)#.*")


@dataclass(eq=False)
class _Block:
    """Faces between two changes of object, group or material, as text."""

    part: str
    material: str
    lines: list[str] = field(default_factory=list)


@dataclass(eq=False)
class _Statements:
    """The statements of a file by kind, as text."""

    rows: dict[str, list[str]] = field(default_factory=lambda: {"v": [], "vt": [], "vn": []})
    blocks: list[_Block] = field(default_factory=list)
    libraries: list[str] = field(default_factory=list)
    has_curves: bool = False
    unknown: int = 0
    first_unknown: str = ""


def read_obj(path: Path, data: bytes) -> RawModel:
    """Read an OBJ; polygons become triangles.

    Raises
    ------
    UserError
        If a line cannot be read, or textures are too large.
    """
    statements = _statements(path, data)
    rows = statements.rows
    v, colours, has_weights = _vertices(path, rows["v"])
    vt = _numbers(path, rows["vt"], 1, "vt")[:, :2]
    vn = _numbers(path, rows["vn"], 3, "vn")[:, :3]
    palette = MaterialLibraries(path, statements.libraries)
    names_in_use = list(dict.fromkeys(b.material for b in statements.blocks))
    in_use = {name: palette[name] for name in names_in_use if name in palette}
    model = RawModel(path=path, kind="obj", parts=[], materials=[])
    if statements.unknown:
        model.notes.append(
            f"{statements.unknown:,} lines begin with a word that OBJ does not have and were not read (the first is "
            f"{statements.first_unknown})"
        )
    if statements.has_curves:
        model.notes.append("not carried over: points, lines and curves")
    if has_weights:
        model.notes.append("not carried over: weights of vertices (their fourth number)")
    _materials(
        model,
        names_in_use,
        in_use,
        has_libraries=len(palette) > 0,
        names_libraries=bool(statements.libraries),
    )
    model.notes += palette.notes
    model.faults += palette.faults
    number = {m.name: k for k, m in enumerate(model.materials)}
    blocks_by_part: dict[str, list[_Block]] = {}
    for block in statements.blocks:
        blocks_by_part.setdefault(block.part, []).append(block)
    n_dropped = 0
    for name, part_blocks in zip(unique_names(blocks_by_part, "body"), blocks_by_part.values(), strict=True):
        body, dropped = _part(path, name, part_blocks, (v, vt, vn, colours), in_use, number)
        model.parts.append(body)
        n_dropped += dropped
    if n_dropped:
        model.notes.append(f"left out {n_dropped:,} faces of fewer than three corners")
    return model


def _statements(path: Path, data: bytes) -> _Statements:
    statements = _Statements()
    rows, blocks = statements.rows, statements.blocks
    part, material = "body", ""
    for number, line in enumerate(text_lines(data), 1):
        word, rest = split_word(line)
        if word not in rows and word != "f":
            word = word.lower()
        if (word in rows or word in ("f", "fo")) and "#" in rest:
            rest = _COMMENT.sub("", rest)
        if word in rows:
            rows[word].append(rest)
        elif word in ("f", "fo"):
            if not blocks or (blocks[-1].part, blocks[-1].material) != (part, material):
                blocks.append(_Block(part, material))
            if "-" in rest:  # counted from the last vertex so far
                try:
                    rest = _absolute(rest, (len(rows["v"]), len(rows["vt"]), len(rows["vn"])))
                except ValueError as error:
                    raise _unreadable_face(path, rest) from error
            blocks[-1].lines.append(rest)
        elif word in ("o", "g"):
            part = unquoted(rest) or "body"
        elif word == "usemtl":
            material = unquoted(rest)
        elif word == "mtllib":
            statements.libraries.append(rest)
        elif word in CURVES:
            statements.has_curves = True
        elif word and not word.startswith("#") and word not in IGNORED_STATEMENTS:
            statements.unknown += 1
            statements.first_unknown = statements.first_unknown or f"{word[:20]!r}, line {number:,}"
    return statements


def _materials(
    model: RawModel,
    used: list[str],
    by_name: dict[str, ObjMaterial],
    *,
    has_libraries: bool,
    names_libraries: bool,
) -> None:
    absent = [n for n in used if n and n not in by_name]
    if absent and (has_libraries or not names_libraries):
        names = ", ".join(repr(n[:80]) for n in absent[:5]) + ", ..." * (len(absent) > 5)
        description = f"material{'s' * (len(absent) > 1)} {names} {'are' if len(absent) > 1 else 'is'}"
        if has_libraries:
            model.faults.append(f"{description} in none of the .mtl files that were read: drawn grey")
        else:
            model.notes.append(f"{description} named, but no .mtl file: drawn grey")
    model.materials = [by_name[n].material for n in used if n in by_name] + [UNNAMED_SURFACE]
    model.pictures = {p.name: p for n in used if n in by_name and (p := by_name[n].picture) is not None}
    unsupported = sorted({k for n in used if n in by_name for k in by_name[n].lost})
    if unsupported:
        model.notes.append(
            f"not carried over: {', '.join(unsupported[:20])}" + ", ..." * (len(unsupported) > 20)
        )
    if has_libraries and "" in used:
        model.notes.append("some faces name no material: given a mid-grey paint")


def _part(
    path: Path,
    name: str,
    blocks: list[_Block],
    data: tuple[FloatArray, FloatArray, FloatArray, FloatArray | None],
    by_name: dict[str, ObjMaterial],
    number: dict[str, int],
) -> tuple[RawPart, int]:
    v, vt, vn, vertex_colours = data
    corners, materials, coordinates, colours = [], [], [], []
    n_dropped = 0
    for block in blocks:
        triangles, dropped = _faces(path, block.lines, v)
        n_dropped += dropped
        for column, count, what in ((0, len(v), "vertex"), (1, len(vt), "vt"), (2, len(vn), "vn")):
            bad = (triangles[..., column] > count) | (triangles[..., column] < (1 if column == 0 else 0))
            if bad.any():
                face = int(np.argmax(bad.any(axis=1)))
                value = int(triangles[face, :, column][bad[face]][0])
                raise UserError(
                    f"{path}, part {name!r}: triangle {face} uses {what} {value} of {count}; export it again"
                )
        corners.append(triangles)
        materials.append(np.full(len(triangles), number.get(block.material, len(number) - 1), np.int64))
        uv = np.full((len(triangles), 3, 2), np.nan)
        material = by_name.get(block.material)
        if material is not None and material.picture is not None and len(vt):
            with np.errstate(over="ignore", invalid="ignore"):
                transformed = vt * material.scale + material.offset
            # OBJ counts texture rows from the bottom
            uv = np.stack([transformed[:, 0], 1 - transformed[:, 1]], axis=1)[triangles[..., 1] - 1]
            uv[triangles[..., 1] == 0] = np.nan
        coordinates.append(uv)
        if vertex_colours is not None:
            factor = np.asarray(material.material.base_color) if material is not None else 1.0
            is_untextured = material is None or material.picture is None
            colours.append(
                vertex_colours[triangles[..., 0] - 1].mean(axis=1) * factor
                if is_untextured
                else np.full((len(triangles), 3), np.nan)
            )
    triangles = np.concatenate(corners)
    flat = triangles.reshape(-1, 3)
    key, inverse = np.unique(flat[:, 0] * (len(vn) + 1) + flat[:, 2], return_inverse=True)
    vertex, normal = key // (len(vn) + 1) - 1, key % (len(vn) + 1) - 1
    with_normals = len(vn) > 0 and bool((normal >= 0).all())
    uv = np.concatenate(coordinates)
    part = RawPart(
        name=name,
        positions_m=v[vertex],
        triangles=inverse.reshape(-1, 3),
        face_material=np.concatenate(materials),
        normals=vn[normal] if with_normals else None,
        face_colour=np.concatenate(colours) if colours else None,
        corner_uv=None if np.isnan(uv).all() else uv,
    )
    return part, n_dropped


def _faces(path: Path, lines: list[str], v: FloatArray) -> tuple[IntArray, int]:
    """Triangulate faces.

    Returns
    -------
    tuple
        Vertex, texture and normal numbers (F, 3, 3), from 1, or 0 where the file has none; and the number of faces with
        fewer than three corners, which some exporters write for edges.
    """
    corners, counts = _corners(path, lines)
    vertex = corners[:, 0] - 1
    start = np.cumsum(counts) - counts
    face_of_corner = np.repeat(np.arange(len(counts)), counts)
    is_invalid = np.zeros(len(counts), bool)
    is_invalid[face_of_corner[(vertex < 0) | (vertex >= len(v))]] = True  # reported later
    is_triangle, is_quad = counts == 3, counts == 4
    is_convex = np.zeros(len(counts), bool)
    is_convex[is_quad & ~is_invalid] = are_convex(
        v[vertex[start[is_quad & ~is_invalid][:, None] + np.arange(4)]]
    )
    is_fan = is_quad & (is_convex | is_invalid)
    faces = [np.flatnonzero(is_triangle), np.flatnonzero(is_fan), np.flatnonzero(is_fan)]
    triples = [
        start[is_triangle, None] + (0, 1, 2),
        start[is_fan, None] + (0, 1, 2),
        start[is_fan, None] + (0, 2, 3),
    ]
    remaining = np.flatnonzero((counts > 3) & ~is_fan)
    if float((counts[remaining].astype(float) ** 2).sum()) > MAX_CLIPPING:
        raise UserError(f"{path} has too many polygons of many corners; export it as triangles")
    for k in remaining:
        rows = start[k] + np.arange(counts[k])
        try:
            pieces = fan(len(rows)) if is_invalid[k] else polygon_triangles(v[vertex[rows]])
        except ValueError as error:
            raise UserError(f"{path} has {error}, too many to cut; export it as triangles") from error
        faces.append(np.full(len(pieces), k))
        triples.append(rows[np.array(pieces)])
    order = np.argsort(np.concatenate(faces), kind="stable")
    return corners[np.concatenate(triples)[order]].reshape(-1, 3, 3), int((counts < 3).sum())


def _corners(path: Path, lines: list[str]) -> tuple[IntArray, IntArray]:
    """Return vertex, texture and normal number (C, 3) of all faces' corners, and the number of corners of each face."""
    counts = np.array([len(line.split()) for line in lines], np.int64)
    first = (lines[0].split() or [""])[0]
    slashes, has_no_uv = first.count("/"), "//" in first
    if all(
        x.count("/") == n * slashes and ("//" in x) == has_no_uv for x, n in zip(lines, counts, strict=True)
    ):
        numbers = _whole_numbers(" ".join(lines).replace("//", " ").replace("/", " "))
        width = slashes + 1 - has_no_uv
        if width <= 3 and numbers.size == counts.sum() * width:
            table = numbers.reshape(-1, width)
            corners = np.zeros((len(table), 3), np.int64)
            corners[:, 0] = table[:, 0]
            if width > 1:
                corners[:, 2 if has_no_uv else 1] = table[:, 1]
            if width > 2:
                corners[:, 2] = table[:, 2]
            return corners, counts
    rows = []
    for line in lines:
        try:
            rows += [_corner(token) for token in line.split()]
        except ValueError as error:
            raise _unreadable_face(path, line) from error
    return np.array(rows, np.int64).reshape(-1, 3), counts


def _whole_numbers(text: str) -> IntArray:
    """Parse whitespace-separated integers; empty if there is anything else."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # NumPy warns if it stopped early
            numbers = np.fromstring(text, np.int64, sep=" ")
    except (ValueError, OverflowError, DeprecationWarning):
        return np.zeros(0, np.int64)
    return numbers


def _corner(token: str) -> tuple[int, int, int]:
    fields = [int(x) if x else 0 for x in token.split("/")] + [0, 0]
    if max(fields) > MAX_INDEX or min(fields) < -MAX_INDEX:
        raise ValueError("no file has so many vertices")
    return (fields[0], fields[1], fields[2])


def _unreadable_face(path: Path, line: str) -> UserError:
    return UserError(f"{path}: face {line.strip()[:60]!r} cannot be read; export it again")


def _absolute(text: str, counts: tuple[int, int, int]) -> str:
    """Convert face corners counted from the end to absolute ones."""
    tokens = []
    for token in text.split():
        fields = [
            str(_from_start(int(x), n)) if x.startswith("-") else x
            for x, n in zip(token.split("/"), counts, strict=False)
        ]
        tokens.append("/".join(fields))
    return " ".join(tokens)


def _from_start(index: int, count: int) -> int:
    """Convert an index from the end (negative) to one from the start; out of range it stays negative for a check."""
    return count + 1 + index if count + index >= 0 else index


def _vertices(path: Path, rows: list[str]) -> tuple[FloatArray, FloatArray | None, bool]:
    """Return positions (N, 3), linear colours (N, 3) or None, and True if there are weights other than 1.

    Three numbers are a position, four a position and a weight, six or seven a position and a colour.
    """
    table = _numbers(path, rows, 3, "v")
    width = table.shape[1]
    weighted = np.isfinite(table[:, 3]) & (table[:, 3] != 1) if width > 3 else np.zeros(len(table), bool)
    if width < 6:
        return table[:, :3], None, bool(weighted.any())
    colours = table[:, 3:6]
    finite_colours = colours[np.isfinite(colours).all(axis=1)]
    if not len(finite_colours) or (finite_colours == finite_colours[0]).all():
        return table[:, :3], None, bool((weighted & np.isnan(table[:, 4])).any())
    colours = np.clip(colours / (255.0 if finite_colours.max() > 1 else 1.0), 0, 1)
    return table[:, :3], linear_from_srgb(colours), False


def _numbers(path: Path, rows: list[str], min_columns: int, word: str) -> FloatArray:
    """Parse rows of numbers as an array (N, width), NaN where a row is shorter.

    Parameters
    ----------
    path : Path
        File, for messages.
    rows : list of str
        Rows without their first word.
    min_columns : int
        Smallest allowed number of values.
    word : str
        First word of the rows, for messages.
    """
    if not rows:
        return np.zeros((0, max(min_columns, 2)))
    columns = len(rows[0].split())
    try:
        flat = np.array(" ".join(rows).split(), float)
        if not (min_columns <= columns <= 8 and flat.size == columns * len(rows)):
            flat = np.array([(row.split() + ["nan"] * 8)[:8] for row in rows], float)
            columns = 8
    except ValueError as error:
        raise UserError(
            f"{path}: a {word} line has a value that is not a number ({error}); export it again"
        ) from error
    table = flat.reshape(len(rows), columns)
    counts = np.array([len(row.split()) for row in rows]) if columns == 8 else np.full(len(rows), columns)
    if counts.min() < min_columns:
        k = int(np.argmin(counts))
        raise UserError(
            f"{path}: {word} line {k + 1:,} has {counts[k]} numbers where {min_columns} are needed; export it again"
        )
    return np.column_stack([table, np.zeros(len(rows))]) if columns < 2 else table
