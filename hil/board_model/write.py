"""Writer of the board model file: keypoints, wireframe, occluders, contours and outer faces of a target as JSON."""

from __future__ import annotations

import base64
import contextlib
import zlib
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from flyaround.hil.board_model.bsp_tree import build_tree
from flyaround.hil.board_model.contours import (
    MAX_RADIUS,
    RANGE_RADII,
    OccludingContours,
    outlines_of,
)
from flyaround.hil.board_model.outer_faces import merge_triangle_pairs, outer_triangles
from flyaround.hil.board_model.records import BoardModelRecord, FacesRecord, OutlinesRecord
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.runtime.cache import cache_folder, entry_name, read_checked, store_checked
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.targets.convert import target_record
from flyaround.simulator.targets.installed import network_file
from flyaround.simulator.targets.library import built_in_targets, load_target

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from flyaround.simulator.targets.model import Part, Target


POSITION_STEPS = 8192
"""Quantisation steps along the target's radius. Half a step is below a tenth of a pixel up to a radius of 1600 px."""

# Minimum area of a face whose plane may split space [share of the target's size, squared]. Smaller ones would cut large
# faces for little gain in order.
MIN_SPLITTING_AREA = 1.2e-3

# Steps along the largest coordinate of the faces' corners, within 16 bits with a sign.
FACE_STEPS = 32_000

# Decimals of the planes in the file.
PLANE_DIGITS = 6


def write_board_model(target: Target, path: Path) -> None:
    """Write the board model of ``target`` (docs/formats/target.md).

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    write_atomic(path, msgspec.json.encode(board_record(target)))


def board_record(target: Target) -> BoardModelRecord:
    """Return the board model of a target.

    Returns
    -------
    BoardModelRecord
        Labels, occluders, contours, faces and network. Faces are None if the target has too many triangles, the network
        is None if none was trained.

    Raises
    ------
    UserError
        If the network file cannot be read.
    """
    head = network_file(target.name)
    try:
        network = base64.b64encode(head.read_bytes()).decode() if head.is_file() else None
    except OSError as error:
        raise UserError(f"cannot read {head}: {error.strerror}; train the network again") from error
    return msgspec.structs.replace(
        record_without_faces(target),
        outlines=cached_outlines(target),
        faces=cached_faces(target),
        network=network,
    )


def record_without_faces(target: Target) -> BoardModelRecord:
    """Return the board model without contours and faces, which take seconds to compute."""
    record = target_record(target)
    return BoardModelRecord(
        schema="flyaround.board_model",
        version=1,
        name=target.name,
        sha256=target.sha256,
        keypoints=record.keypoints,
        wireframe=record.wireframe,
        occluders=record.occluders,
        symmetry_wxyz=target.symmetry,
        mass_kg=target.mass.mass_kg,
    )


def pack_contours(o: OccludingContours) -> OutlinesRecord:
    """Return contours in compact form: positions to 1/8192 of the target's radius, normals to half a degree."""
    radius = o.range_m / RANGE_RADII
    step, radius_step = radius / POSITION_STEPS, radius * MAX_RADIUS / 255
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


def cached_outlines(target: Target) -> OutlinesRecord:
    """Return the target's contours, cached on disk by the target's hash."""
    key = entry_name("outlines", (pack_contours, outlines_of), target.sha256)
    path = cache_folder("board-models") / f"{key}.json"
    data = read_checked(path)
    if data is not None:
        with contextlib.suppress(msgspec.DecodeError):
            return msgspec.json.decode(data, type=OutlinesRecord)
    record = pack_contours(outlines_of(target))
    # writing a board file must work without a writable cache
    store_checked(path, lambda file: file.write(msgspec.json.encode(record)))
    return record


def make_faces(levels: Sequence[Sequence[Part]]) -> FacesRecord | None:
    """Return the outer faces of a target as convex quadrilaterals in BSP order; `None` if there are too many.

    Parameters
    ----------
    levels : sequence of sequence of Part
        Parts at each level of detail, coarsest first.
    """
    triangles, material = outer_triangles(levels)
    if not len(triangles):
        return None
    corners, parent = merge_triangle_pairs(triangles, material)
    area = 0.5 * np.linalg.norm(
        np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]), axis=1
    )
    size = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    names = sorted(set(parent))
    tree = build_tree(corners, area > MIN_SPLITTING_AREA * size**2)
    places = np.array(tree.corners_m)
    step = float(np.abs(places).max()) / FACE_STEPS
    n = PLANE_DIGITS
    places_packed = zlib.compress(np.rint(places / step).astype("<i2").tobytes(), 9)
    return FacesRecord(
        step_m=step,
        corners=base64.b64encode(places_packed).decode(),
        material=tuple(names.index(parent[k]) for k in tree.source),
        # rounded to micrometres, because twenty coplanar faces may describe one plane
        plane=tuple((round(a, n), round(b, n), round(c, n), round(d, n)) for a, b, c, d in tree.plane),
        children=tuple(tree.children),
        members=tuple(tuple(m) for m in tree.members),
    )


def cached_faces(target: Target) -> FacesRecord | None:
    """Return the target's faces, cached on disk by the target's hash."""
    levels = _levels(target)
    makers = (make_faces, outer_triangles, build_tree)
    key = entry_name("faces", makers, target.sha256, [level.sha256 for level in levels])
    path = cache_folder("board-models") / f"{key}.json"
    data = read_checked(path)
    if data is not None:
        with contextlib.suppress(msgspec.DecodeError):
            return msgspec.json.decode(data, type=FacesRecord | None)
    record = make_faces([level.parts for level in levels])
    # writing a board file must work without a writable cache
    store_checked(path, lambda file: file.write(msgspec.json.encode(record)))
    return record


def _levels(target: Target) -> list[Target]:
    """Return the low and medium levels of detail of a built-in target; otherwise the target itself."""
    if target.name in built_in_targets() and load_target(target.name).sha256 == target.sha256:
        return [load_target(target.name, "low"), load_target(target.name, "medium")]
    return [target]
