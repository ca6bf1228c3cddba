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
    """Occluding contours of the target from all sides, in its axes.

    Parameters
    ----------
    views : int
        Number of directions.
    points : int
        Number of points of each contour.
    center_m : tuple of float
        Point that the directions start from [m].
    range_m : float
        Distance of the cameras from ``center_m`` [m].
    step_m : float
        Length of one unit of the positions [m].
    radius_step_m : float
        Length of one unit of the radii of curvature [m].
    data : str
        Base64 of a zlib stream of four little-endian arrays: unit vectors from ``center_m`` to the camera, int16 in
        units of 1/32767, (views, 3); positions of the points relative to ``center_m``, int16 in units of ``step_m``,
        (views, points, 3); outward unit normals, int8 in units of 1/127, (views, points, 3); radii of curvature along
        the line of sight, uint8 in units of ``radius_step_m``, (views, points), 0 at a sharp edge.
    """

    views: Index
    points: Index
    center_m: Vec3
    range_m: Positive
    step_m: Positive
    radius_step_m: Positive
    data: str


class FacesRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Outer faces of the target, and the BSP tree that sorts them by depth.

    Parameters
    ----------
    step_m : float
        Length of one unit of ``corners`` [m].
    corners : str
        Base64 of a zlib stream of little-endian int16 in units of ``step_m``: (faces, 4 corners, xyz), target axes. The
        corners of a face are counter-clockwise as seen from outside; a triangle repeats its last one.
    material : tuple of int
        Index of each face's material.
    plane : tuple of tuple of float
        Splitting plane (nx, ny, nz, d) of each node: the points x with n.x = d [m]. All four are 0 at a leaf.
    children : tuple of tuple of int
        Child nodes of each node: first that on the side where n.x > d, then that where n.x < d; -1 for none. Node 0 is
        the root, and a child has a higher number than its parent.
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

    The network is base64 of the file of a keypoint head trained for the target.
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
