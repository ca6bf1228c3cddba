"""STL, binary and text: solids without units, materials or shared vertices."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.importing.read.raw_model import (
    UNNAMED_SURFACE,
    RawModel,
    RawPart,
    unique_names,
)

if TYPE_CHECKING:
    from pathlib import Path

    from flyaround.simulator.runtime.arrays import FloatArray

HEADER_BYTES = 84  # 80 of free text and the number of triangles
RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
MAX_SOLIDS = (
    4000  # each becomes a part, of which an imported target has at most as many (repair/placement.py)
)
_SOLID = re.compile(rb"\s*solid(?=\s|$)", re.IGNORECASE)
_FACET = re.compile(rb"facet\s+normal\b|outer\s+loop\b|vertex\s+[-+.\d]", re.IGNORECASE)
_END = re.compile(rb"(?<![^\s])endsolid\b", re.IGNORECASE)
_NAME = re.compile(
    rb"\s*solid\b[ \t]*(.*?)(?=\s*(?:[\r\n]|\bfacet\s+normal\b|\bendsolid\b|$))", re.IGNORECASE
)
_LOOP = re.compile(rb"\bouter\s+loop\b", re.IGNORECASE)
_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)


def is_stl(data: bytes) -> bool:
    """Return True if the bytes are a binary STL by their length, or begin like a text one."""
    return _is_text(data) or _has_counted_length(data)


def read_stl(path: Path, data: bytes) -> RawModel:
    """Read one STL; its face normals are ignored, because they follow from the winding.

    Raises
    ------
    UserError
        If it is truncated or not STL.
    """
    model = RawModel(path=path, kind="stl", parts=[], materials=[UNNAMED_SURFACE])
    if not _has_counted_length(data) and _is_text(data):
        solids = _text_solids(path, _plain_text(data))
    else:
        solids = [("body", _binary_corners(path, data, model.notes))]
    names = unique_names((name for name, _ in solids), "body")
    for name, (_, corners) in zip(names, solids, strict=True):
        model.parts.append(
            RawPart(
                name=name,
                positions_m=corners,
                triangles=np.arange(len(corners)).reshape(-1, 3),
                face_material=np.zeros(len(corners) // 3, np.int64),
            )
        )
    return model


def _has_counted_length(data: bytes) -> bool:
    if len(data) < HEADER_BYTES:
        return False
    count = int.from_bytes(data[80:84], "little")
    return count > 0 and len(data) == HEADER_BYTES + count * RECORD.itemsize


def _plain_text(data: bytes) -> bytes:
    """Return the text without a byte-order mark, one byte per character."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", "replace").encode()
    return data.removeprefix(b"\xef\xbb\xbf")


def _is_text(data: bytes) -> bool:
    head = _plain_text(data[:4096])
    return _SOLID.match(head) is not None and (
        _FACET.search(head) is not None or (b"\0" not in head and _END.search(_plain_text(data)) is not None)
    )


def _binary_corners(path: Path, data: bytes, notes: list[str]) -> FloatArray:
    if len(data) < HEADER_BYTES:
        raise UserError(
            f"{path} is cut short or no STL ({len(data)} bytes; a binary one has {HEADER_BYTES} at least); "
            "export it again"
        )
    count = int.from_bytes(data[80:84], "little")
    n_records, remainder = divmod(len(data) - HEADER_BYTES, RECORD.itemsize)
    if count == 0 and n_records and not remainder:
        notes.append(f"its header counts no triangles: all {n_records:,} that follow were read")
        count = n_records
    if count > n_records:
        expected = HEADER_BYTES + count * RECORD.itemsize
        raise UserError(f"{path} is cut short ({len(data)} of {expected} bytes); copy or export it again")
    trailing = len(data) - HEADER_BYTES - count * RECORD.itemsize
    if trailing:
        notes.append(f"{trailing:,} bytes after its {count:,} triangles were not read")
    records = np.frombuffer(data, RECORD, count, HEADER_BYTES)
    if (records["attribute"] != 0).any() or b"COLOR=" in data[:80]:
        notes.append("not carried over: colours of faces (attribute bytes of the STL)")
    with np.errstate(invalid="ignore"):  # non-finite vertices are reported later
        return records["corners"].reshape(-1, 3).astype(float)


def _text_solids(path: Path, text: bytes) -> list[tuple[str, FloatArray]]:
    """Return name and corners (3 F, 3) of each solid."""
    *solids, trailing = _END.split(text)
    if _VERTEX.search(trailing) or not solids:
        raise UserError(f"{path} is cut short (no endsolid); copy or export it again")
    if len(solids) > MAX_SOLIDS:
        raise UserError(
            f"{path} has {len(solids):,} solids and at most {MAX_SOLIDS:,} are taken; export it with fewer"
        )
    named_corners = []
    for number, solid in enumerate(solids):
        # endsolid is followed by the name again
        start = solid if number == 0 else solid[max(solid.lower().find(b"solid"), 0) :]
        name = _NAME.match(start[:1000])
        named_corners.append((name[1].decode("utf-8", "replace") if name else "", _corners(path, solid)))
    return named_corners


def _corners(path: Path, solid: bytes) -> FloatArray:
    facets = len(_LOOP.findall(solid))
    first = _LOOP.search(solid)  # a name before it may contain any word
    try:
        corners = np.array(_VERTEX.findall(solid, first.start() if first else len(solid)), float).reshape(
            -1, 3
        )
    except ValueError as error:
        raise UserError(
            f"{path} has a vertex that is not three numbers; export it again, as binary"
        ) from error
    if len(corners) != 3 * facets:
        raise UserError(
            f"{path} is not a readable text STL: {facets} facets have {len(corners)} vertices; export it again, as "
            "binary"
        )
    return corners
