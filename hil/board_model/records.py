"""Typed records of the board model file."""

from __future__ import annotations

from typing import Literal

import msgspec

from flyaround.simulator.runtime.arrays import Quat, Vec3
from flyaround.simulator.targets.records import (
    EdgeRecord,
    Index,
    KeypointRecord,
    Name,
    OccludersRecord,
    Positive,
    Sha256,
)


class OutlinesRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Occluding contours from `views` directions, `points` each.

    `data` is base64 of a zlib stream of little-endian rows, in order: directions to the camera (views, 3) int16/32767;
    positions about `center_m` (views, points, 3) int16 x `step_m`; outward normals (views, points, 3) int8 / 127; radii
    of curvature along the line of sight (views, points) uint8 x `radius_step_m`, 0 at sharp edges. `range_m` is the
    distance of the camera from `center_m`.
    """

    views: Index
    points: Index
    center_m: Vec3
    range_m: Positive
    step_m: Positive
    radius_step_m: Positive
    data: str


class FacesRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Outer faces of the target, and the BSP tree that orders them.

    Parameters
    ----------
    step_m : float
        Length of one unit of ``corners`` [m].
    corners : str
        Base64 of a zlib stream of little-endian int16 x `step_m`: (faces, 4 corners, xyz), target frame. Corners are in
        order as seen from outside; a triangle repeats the last one.
    material : tuple of int
        Index of each face's material.
    plane : tuple of tuple of float
        Splitting plane (nx, ny, nz, d) of each node, zeros at a leaf.
    children : tuple of tuple of int
        Child nodes in front of and behind the plane; -1 for none.
    members : tuple of tuple of int
        Indices of the faces of each node.
    """

    step_m: Positive
    corners: str
    material: tuple[int, ...]
    plane: tuple[tuple[float, float, float, float], ...]
    children: tuple[tuple[int, int], ...]
    members: tuple[tuple[int, ...], ...]


class BoardModelRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Data of a target that a board needs to estimate its pose: a few thousand faces at most.

    `network` is base64 of the file of a keypoint head trained for the target.
    """

    schema: Literal["flyaround.board_model"]
    version: Literal[1]
    name: Name
    sha256: Sha256
    keypoints: tuple[KeypointRecord, ...]
    wireframe: tuple[EdgeRecord, ...]
    occluders: OccludersRecord
    symmetry_wxyz: tuple[Quat, ...] = ()
    mass_kg: Positive
    outlines: OutlinesRecord | None = None
    faces: FacesRecord | None = None
    network: str | None = None
