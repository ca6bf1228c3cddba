"""The board file: keypoints, wireframe, occluders, outlines and outer faces of a target as one small JSON."""

from __future__ import annotations

import base64
import contextlib
import zlib
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from simulator.runtime.arrays import vec3
from simulator.runtime.cache import cache_folder, entry_name, read_checked, store_checked
from simulator.runtime.files import write_atomic
from simulator.targets.board_model.contours import LARGEST_RADIUS, RANGE_RADII, Outlines, outlines_of
from simulator.targets.board_model.faces import kept_faces
from simulator.targets.convert import board_model
from simulator.targets.records import BoardModel, OutlinesRecord

if TYPE_CHECKING:
    from pathlib import Path

    from simulator.targets.model import Target

POSITION_STEPS = 8192
"""Steps along the craft's radius: half a millimetre on Dragon, less than a pixel's tenth wherever it fits a picture."""

# Of `packed(outlines_of(target))`: raise it when the same target gives another record (here or in outlines.py).
VERSION = 1


def write_board_model(target: Target, path: Path) -> None:
    """Write what a board needs of ``target`` (docs/formats/target.md).

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    write_atomic(path, msgspec.json.encode(board_record(target)))


def board_record(target: Target) -> BoardModel:
    """All that the board file holds of ``target``."""
    return msgspec.structs.replace(board_model(target, kept_outlines(target)), faces=kept_faces(target))


def packed(o: Outlines) -> OutlinesRecord:
    """Outlines in their small form; positions to a part in 8192 of the craft's radius, normals to half a degree."""
    radius = o.range_m / RANGE_RADII
    step, radius_step = radius / POSITION_STEPS, radius * LARGEST_RADIUS / 255
    rows = (
        np.rint(o.directions * 32767).astype("<i2"),
        np.rint((o.points_m - o.center_m) / step).astype("<i2"),
        np.rint(o.normals * 127).astype("i1"),
        np.rint(o.radius_m / radius_step).astype("u1"),
    )
    return OutlinesRecord(
        views=o.points_m.shape[0],
        points=o.points_m.shape[1],
        center_m=vec3(o.center_m),
        range_m=o.range_m,
        step_m=step,
        radius_step_m=radius_step,
        data=base64.b64encode(zlib.compress(b"".join(r.tobytes() for r in rows), 9)).decode(),
    )


def kept_outlines(target: Target) -> OutlinesRecord:
    """The target's outlines: computed once, then read from the user's cache by the target's hash."""
    path = cache_folder("targets") / f"{entry_name('outlines', VERSION, target.sha256)}.json"
    data = read_checked(path)
    if data is not None:
        with contextlib.suppress(msgspec.DecodeError):
            return msgspec.json.decode(data, type=OutlinesRecord)
    record = packed(outlines_of(target))
    # a board file can be written where the cache cannot
    store_checked(path, lambda file: file.write(msgspec.json.encode(record)))
    return record
