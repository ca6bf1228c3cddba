"""STL, binary and text: one body without units, materials or shared vertices."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from simulator.errors import UserError
from simulator.targets.importing.read.raw_model import UNNAMED_SURFACE, RawModel, RawPart

if TYPE_CHECKING:
    from pathlib import Path

    from simulator.runtime.arrays import FloatArray

HEADER_BYTES, RECORD_BYTES = 84, 50
VERTEX = re.compile(rb"^\s*vertex[ \t]+(.*)$", re.IGNORECASE | re.MULTILINE)
FACET = re.compile(rb"^\s*facet\b", re.IGNORECASE | re.MULTILINE)
RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def is_binary_stl(data: bytes) -> bool:
    """Whether the length is the one that the count of triangles in the header asks for."""
    if len(data) < HEADER_BYTES:
        return False
    count = int.from_bytes(data[80:84], "little")
    return count > 0 and len(data) == HEADER_BYTES + count * RECORD_BYTES


def read_stl(path: Path, data: bytes) -> RawModel:
    """Read one STL; its face normals are ignored, for the winding says the same.

    Raises
    ------
    UserError
        If it is cut short or not STL.
    """
    if is_binary_stl(data):
        raw = np.frombuffer(data, RECORD, offset=HEADER_BYTES)["corners"].reshape(-1, 3)
        with np.errstate(invalid="ignore"):  # vertices that are not finite are named later
            corners = raw.astype(float)
    elif b"facet" in data.lower():
        corners = _text(path, data)
    else:
        expected = HEADER_BYTES + int.from_bytes(data[80:84], "little") * RECORD_BYTES
        raise UserError(f"{path} is cut short ({len(data)} of {expected} bytes); copy or export it again")
    part = RawPart(
        name="body",
        positions_m=corners,
        triangles=np.arange(len(corners)).reshape(-1, 3),
        face_material=np.zeros(len(corners) // 3, np.int64),
    )
    return RawModel(path=path, kind="stl", parts=[part], materials=[UNNAMED_SURFACE])


def _text(path: Path, data: bytes) -> FloatArray:
    if b"endsolid" not in data[-4096:].lower():
        raise UserError(f"{path} is cut short (no endsolid); copy or export it again")
    vertices = VERTEX.findall(data)
    facets = len(FACET.findall(data))
    try:
        corners = np.array([v.split() for v in vertices], float).reshape(-1, 3)
    except ValueError as error:
        raise UserError(
            f"{path} has a vertex that is no three numbers; export it again, as binary"
        ) from error
    if len(corners) != 3 * facets:
        raise UserError(
            f"{path} is not a readable text STL: {facets} facets have {len(corners)} vertices; export it again, as "
            "binary"
        )
    return corners
