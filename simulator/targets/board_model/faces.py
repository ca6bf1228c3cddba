"""The part of the board file that lets a board draw the craft: outer faces in the order in which they hide."""

from __future__ import annotations

import base64
import contextlib
import zlib
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from simulator.runtime.cache import cache_folder, entry_name, read_checked, store_checked
from simulator.targets.board_model import bsp_tree as face_tree
from simulator.targets.board_model import outer_faces as faces
from simulator.targets.detail import DETAILS
from simulator.targets.library import built_in_targets, cache_name, load_target
from simulator.targets.records import FacesRecord

if TYPE_CHECKING:
    from collections.abc import Sequence

    from simulator.targets.model import Part, Target

# A face larger than this divides space in the tree [share of the craft's size, squared].
LARGE = 1.2e-3

# Decimals of the planes in the file.
PLANE_DIGITS = 6

# Of `make_faces`: raise it when the same parts give another record (changes here, in face_tree.py, in faces.py).
VERSION = 1


def make_faces(levels: Sequence[Sequence[Part]]) -> FacesRecord | None:
    """Outer faces of a craft, paired, and ordered by a tree; none where they are too many.

    Parameters
    ----------
    levels : parts at each level of detail, the coarsest first.
    """
    triangles, material = faces.outer_triangles(levels)
    if not len(triangles):
        return None
    corners, of = faces.paired(triangles, material)
    area = 0.5 * np.linalg.norm(
        np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]), axis=1
    )
    size = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    names = sorted(set(of))
    tree = face_tree.build_tree(corners, area > LARGE * size**2)
    places = np.array(tree.corners_m)
    step = float(np.abs(places).max()) / 32000
    n = PLANE_DIGITS
    packed = zlib.compress(np.rint(places / step).astype("<i2").tobytes(), 9)
    return FacesRecord(
        step_m=step,
        corners=base64.b64encode(packed).decode(),
        material=tuple(names.index(of[k]) for k in tree.source),
        # a micrometre: what lies in a plane is told by twenty
        plane=tuple((round(a, n), round(b, n), round(c, n), round(d, n)) for a, b, c, d in tree.plane),
        children=tuple(tree.children),
        members=tuple(tuple(m) for m in tree.members),
    )


def kept_faces(target: Target) -> FacesRecord | None:
    """The target's faces: computed once, then read from the user's cache by the target's hash."""
    levels = [cache_name(target.name, d) for d in DETAILS] if target.name in built_in_targets() else []
    path = cache_folder("targets") / f"{entry_name('faces', VERSION, target.sha256, levels)}.json"
    data = read_checked(path)
    if data is not None:
        with contextlib.suppress(msgspec.DecodeError):
            return msgspec.json.decode(data, type=FacesRecord | None)
    record = make_faces(_levels(target))
    # a board file can be written where the cache cannot
    store_checked(path, lambda file: file.write(msgspec.json.encode(record)))
    return record


def _levels(target: Target) -> list[tuple[Part, ...]]:
    """Parts of a built-in craft at low and medium detail; those of any other as they are."""
    if target.name in built_in_targets() and load_target(target.name).sha256 == target.sha256:
        return [load_target(target.name, "low").parts, load_target(target.name, "medium").parts]
    return [target.parts]
