"""Wavefront OBJ with its .mtl: objects and groups as parts, diffuse colours and textures as materials."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from simulator.errors import UserError
from simulator.targets.importing.read.obj_materials import MaterialLibraries
from simulator.targets.importing.read.raw_model import UNNAMED_SURFACE, RawModel, RawPart, unique_names

if TYPE_CHECKING:
    from pathlib import Path

    from simulator.runtime.arrays import FloatArray, IntArray
    from simulator.targets.importing.read.obj_materials import ObjMaterial


LARGEST_NUMBER = 2**40


@dataclass(eq=False)
class _Block:
    """Faces between two changes of object, group or material, as text."""

    part: str
    material: str
    lines: list[str] = field(default_factory=list)
    seen: tuple[int, int, int] = (0, 0, 0)


def read_obj(path: Path, data: bytes) -> RawModel:
    """Read an OBJ; polygons are cut into fans of triangles.

    Raises
    ------
    UserError
        If its material library or a texture is missing, or a line cannot be read.
    """
    rows: dict[str, list[str]] = {"v": [], "vt": [], "vn": []}
    blocks: list[_Block] = []
    libraries: list[str] = []
    part, material = "body", ""
    text = data.decode("utf-8", "replace").replace("\\\n", " ").replace("\\\r\n", " ")
    lost = False
    for line in text.splitlines():
        word, _, rest = line.strip().partition(" ")
        if word in rows:
            rows[word].append(rest)
        elif word == "f":
            if not blocks or (blocks[-1].part, blocks[-1].material) != (part, material):
                blocks.append(_Block(part, material))
            blocks[-1].lines.append(rest)
            if "-" in rest:  # counted from the last vertex so far
                try:
                    rest = _absolute(rest, (len(rows["v"]), len(rows["vt"]), len(rows["vn"])))
                except ValueError as error:
                    raise _unreadable_face(path, rest) from error
                blocks[-1].lines[-1] = rest
        elif word in ("o", "g"):
            part = rest.strip() or "body"
        elif word == "usemtl":
            material = rest.strip()
        elif word == "mtllib":
            libraries.append(rest.strip())
        elif word in ("l", "p", "curv", "surf"):
            lost = True
    v = _numbers(path, rows["v"], 3, "v")
    vt = _numbers(path, rows["vt"], 2, "vt")
    vn = _numbers(path, rows["vn"], 3, "vn")
    palette = MaterialLibraries(path, libraries)
    used = list(dict.fromkeys(b.material for b in blocks))
    known = {name: palette[name] for name in used if name in palette}
    model = RawModel(path=path, kind="obj", parts=[], materials=[])
    if lost:
        model.notes.append("not carried over: points, lines and curves")
    _materials(path, model, used, known, has_libraries=len(palette) > 0)
    model.notes += palette.notes
    number = {m.name: k for k, m in enumerate(model.materials)}
    of_part: dict[str, list[_Block]] = {}
    for block in blocks:
        of_part.setdefault(block.part, []).append(block)
    short = 0
    for name, mine in zip(unique_names(of_part, "body"), of_part.values(), strict=True):
        body, dropped = _part(path, name, mine, (v, vt, vn), known, number)
        model.parts.append(body)
        short += dropped
    if short:
        model.notes.append(f"left out {short:,} faces of fewer than three corners")
    return model


def _materials(
    path: Path, model: RawModel, used: list[str], known: dict[str, ObjMaterial], *, has_libraries: bool
) -> None:
    for name in used:
        if name and name not in known and has_libraries:
            raise UserError(
                f"{path}: material {name!r} is in none of its .mtl files; export the model with its materials"
            )
    model.materials = [known[n].material for n in used if n in known] + [UNNAMED_SURFACE]
    model.pictures = {p.name: p for n in used if n in known and (p := known[n].picture) is not None}
    lost = sorted({k for n in used if n in known for k in known[n].lost})
    if lost:
        model.notes.append(f"not carried over: maps {', '.join(lost)}")
    if has_libraries and any(n not in known for n in used):
        model.notes.append("some faces name no material: given a mid-grey paint")


def _part(
    path: Path,
    name: str,
    blocks: list[_Block],
    data: tuple[FloatArray, FloatArray, FloatArray],
    known: dict[str, ObjMaterial],
    number: dict[str, int],
) -> tuple[RawPart, int]:
    v, vt, vn = data
    corners, materials, coordinates = [], [], []
    short = 0
    for block in blocks:
        c, dropped = _faces(path, block.lines)
        short += dropped
        for column, count, what in ((0, len(v), "vertex"), (1, len(vt), "vt"), (2, len(vn), "vn")):
            bad = (c[..., column] > count) | (c[..., column] < (1 if column == 0 else 0))
            if bad.any():
                face = int(np.argmax(bad.any(axis=1)))
                value = int(c[face, :, column][bad[face]][0])
                raise UserError(
                    f"{path}, part {name!r}: triangle {face} uses {what} {value} of {count}; export it again"
                )
        corners.append(c)
        materials.append(np.full(len(c), number.get(block.material, len(number) - 1), np.int64))
        uv = np.full((len(c), 3, 2), np.nan)
        if block.material in known and known[block.material].picture is not None and (c[..., 1] > 0).all():
            # OBJ counts texture rows from the bottom
            uv = np.stack([vt[:, 0], 1 - vt[:, 1]], axis=1)[c[..., 1] - 1]
        coordinates.append(uv)
    c = np.concatenate(corners)
    flat = c.reshape(-1, 3)
    key, inverse = np.unique(flat[:, 0] * (len(vn) + 1) + flat[:, 2], return_inverse=True)
    at, normal_at = key // (len(vn) + 1) - 1, key % (len(vn) + 1) - 1
    with_normals = len(vn) > 0 and bool((normal_at >= 0).all())
    uv = np.concatenate(coordinates)
    part = RawPart(
        name=name,
        positions_m=v[at],
        triangles=inverse.reshape(-1, 3),
        face_material=np.concatenate(materials),
        normals=vn[normal_at] if with_normals else None,
        corner_uv=None if np.isnan(uv).all() else uv,
    )
    return part, short


def _faces(path: Path, lines: list[str]) -> tuple[IntArray, int]:
    """(F, 3, 3) of vertex, texture and normal number, from 1; 0 where the file gives none.

    And how many faces had fewer than three corners: some exporters write edges so.
    """
    first = lines[0].split() or [""]
    slashes, double = first[0].count("/"), "//" in first[0]
    plain = all(line.count("/") == 3 * slashes and ("//" in line) == double for line in lines)
    if plain and all(len(line.split()) == 3 for line in lines):
        numbers = _whole_numbers(" ".join(lines).replace("//", " ").replace("/", " "))
        width = slashes + 1 - double
        if numbers.size == len(lines) * 3 * width:
            table = numbers.reshape(-1, 3, width)
            out = np.zeros((len(lines), 3, 3), np.int64)
            out[..., 0] = table[..., 0]
            if width > 1:
                out[..., 2 if double else 1] = table[..., 1]
            if width > 2:
                out[..., 2] = table[..., 2]
            return out, 0
    faces, short = [], 0
    for line in lines:
        try:
            corners = [_corner(token) for token in line.partition("#")[0].split()]
        except ValueError as error:
            raise _unreadable_face(path, line) from error
        short += len(corners) < 3
        faces += [(corners[0], corners[k], corners[k + 1]) for k in range(1, len(corners) - 1)]
    return np.array(faces, np.int64).reshape(-1, 3, 3), short


def _whole_numbers(text: str) -> IntArray:
    """Whole numbers between spaces; none where something else stands among them."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # how NumPy says that it stopped at something else
            numbers = np.fromstring(text, np.int64, sep=" ")
    except (ValueError, OverflowError, DeprecationWarning):
        return np.zeros(0, np.int64)
    return numbers


def _corner(token: str) -> tuple[int, int, int]:
    fields = [int(x) if x else 0 for x in token.split("/")] + [0, 0]
    if max(fields) > LARGEST_NUMBER or min(fields) < -LARGEST_NUMBER:
        raise ValueError("no file has so many vertices")
    return (fields[0], fields[1], fields[2])


def _unreadable_face(path: Path, line: str) -> UserError:
    return UserError(f"{path}: face {line.strip()[:60]!r} cannot be read; export it again")


def _absolute(text: str, counts: tuple[int, int, int]) -> str:
    """Face corners counted from the end, counted from the start."""
    out = []
    for token in text.partition("#")[0].split():
        fields = [
            str(n + 1 + int(x)) if x.startswith("-") else x
            for x, n in zip(token.split("/"), counts, strict=False)
        ]
        out.append("/".join(fields))
    return " ".join(out)


def _numbers(path: Path, rows: list[str], width: int, word: str) -> FloatArray:
    """(N, width) from the rows after ``word``; columns beyond are colours or weights and are left out."""
    if not rows:
        return np.zeros((0, width))
    try:
        columns = len(rows[0].split())
        flat = np.array(" ".join(rows).split(), float)
        if columns >= width and flat.size == columns * len(rows):
            return flat.reshape(len(rows), columns)[:, :width].copy()
        return np.array([[float(x) for x in (row.split() + ["0"] * width)[:width]] for row in rows])
    except ValueError as error:
        raise UserError(
            f"{path}: a {word} line holds something that is no number ({error}); export it again"
        ) from error
