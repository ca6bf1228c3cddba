"""The craft drawn as faces of unknown brightness, for alignment on the whole picture rather than on edges.

Which face is seen in which pixel follows from the pose; how bright each face is, the picture itself tells (the mean
of its pixels), so nothing needs to be known of the Sun. What remains is a difference of pictures, and its
derivative by the pose lives where faces meet.
"""

from __future__ import annotations

import base64
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Dict, List, Tuple, Union

import cv2
import numpy as np

if TYPE_CHECKING:
    from hil.board.svd.model import CameraIntrinsics

Array = np.ndarray

# What OpenCV's polygon filling adds on every side [px].
BORDER_PX = 0.45


@dataclass(frozen=True, eq=False)
class Faces:
    """Plane faces with their materials, and the tree that orders them from any place.

    Parameters
    ----------
    corners : (T, 4, 3) convex plane faces, the last corner twice where there are three [m].
    normals : (T, 3) outward. offset : (T,) plane n.x = offset.
    group : (T,) index of material and direction: one brightness. groups : how many. material : (T,).
    plane : (N, 4) of each node of the tree, zero at leaves. children : (N, 2) in front of and behind it, -1 none.
    members : per node its faces; node 0 is the root.
    """

    corners: Array
    normals: Array
    offset: Array
    group: Array
    groups: int
    material: Array
    plane: Array
    children: Array
    members: Tuple[Array, ...]

    @staticmethod
    def from_dict(record: Dict[str, Any]) -> Faces:
        """Faces from the board file's ``faces`` object; groups of one material and nearly one direction.

        Raises
        ------
        KeyError, ValueError
            If a field is missing or a number names what is not there.
        """
        try:
            data = zlib.decompress(base64.b64decode(record["corners"], validate=True))
        except zlib.error as error:
            raise ValueError(f"faces cannot be unpacked: {error}") from error
        corners = float(record["step_m"]) * np.frombuffer(data, "<i2").astype(float).reshape(-1, 4, 3)
        material = np.asarray(record["material"], int).reshape(-1)
        children = np.asarray(record["children"], int).reshape(-1, 2)
        plane = np.asarray(record["plane"], float).reshape(-1, 4)
        members = tuple(np.asarray(m, int).reshape(-1) for m in record["members"])
        named = np.concatenate(members) if members else np.zeros(0, int)
        if (
            not len(corners)
            or len(material) != len(corners)
            or not len(plane) == len(children) == len(members)
        ):
            raise ValueError("faces and the nodes of their tree do not fit together")
        below = np.arange(len(children))[:, None]
        if np.any((children >= len(children)) | ((children >= 0) & (children <= below))):
            raise ValueError("a node of the tree of faces names a node that is not below it")
        if not np.all(np.isfinite(corners)) or np.any((named < 0) | (named >= len(corners))):
            raise ValueError("the tree of faces names a face that is not there")
        n = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
        n = n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-18)
        key = np.concatenate([material[:, None], np.rint(n * 3)], axis=1).astype(int)
        unique, group = np.unique(key, axis=0, return_inverse=True)
        offset = np.einsum("ij,ij->i", n, corners[:, 0])
        return Faces(corners, n, offset, group.ravel(), len(unique), material, plane, children, members)

    def order(self, C_m: Array) -> Array:
        """Triangles that look at the camera centre ``C_m`` (3,), the farthest first."""
        front = self.normals @ C_m > self.offset
        side = self.plane[:, :3] @ C_m > self.plane[:, 3]
        out: List[Array] = []
        stack = [(0, False)]
        while stack:
            node, draw = stack.pop()
            if node < 0:
                continue
            if draw:
                ids = self.members[node]
                ids = ids[front[ids]]
                if len(ids) > 1 and self.children[node, 0] < 0 and self.children[node, 1] < 0:
                    middle = self.corners[ids].mean(axis=1) - C_m
                    ids = ids[np.argsort(-np.einsum("ij,ij->i", middle, middle))]
                out.append(ids)
                continue
            a, b = self.children[node]
            near, far = (a, b) if side[node] else (b, a)
            stack += [(near, False), (node, True), (far, False)]
        return np.concatenate(out) if out else np.zeros(0, int)


@dataclass(frozen=True, eq=False)
class Canvas:
    """A region of the picture, reduced, for comparison with the drawn craft.

    Parameters
    ----------
    gray : (h, w) float32. sigma : its noise. x0, y0 : the region's corner, picture pixels.
    factor : picture pixels per pixel of it. fine : drawn pixels per pixel of it, each way.
    full : where its scale ends. plain : what it would be without the craft, (h, w) or one level.
    """

    gray: Array
    sigma: float
    x0: float
    y0: float
    factor: float
    fine: int
    full: float = 255.0
    plain: Union[float, Array] = 0.0


def draw_faces(
    faces: Faces, order: Array, camera: CameraIntrinsics, R: Array, t: Array, canvas: Canvas
) -> Array:
    """(h * fine, w * fine) int32: number of the triangle seen + 1, 0 where there is none."""
    h, w = canvas.gray.shape
    s = canvas.fine / canvas.factor
    p = camera.pixels(faces.corners[order] @ R.T + t)
    p = (p - (canvas.x0, canvas.y0) + 0.5) * s - 0.5
    d1, d2 = p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]
    # what covers less than a drawn pixel is left to its neighbours
    worth = np.abs(d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]) > 1.0
    p, order = inset(p[worth]), order[worth]
    seen = np.zeros((h * canvas.fine, w * canvas.fine), np.int32)
    polygons = np.rint(np.clip(p, -3000, 3000) * 16).astype(np.int32)
    for polygon, number in zip(polygons, (order + 1).tolist()):  # noqa: B905 - Python 3.9 has no strict=
        cv2.fillConvexPoly(seen, polygon, number, cv2.LINE_8, 4)
    return seen


def inset(p: Array) -> Array:
    """(P, 4, 2) convex polygons made smaller by what OpenCV adds to them: it fills the border's pixels too."""
    edge = np.roll(p, -1, axis=1) - p
    three = np.einsum("ij,ij->i", edge[:, 2], edge[:, 2]) < 1e-12
    # a triangle's last corner is there twice: its two sides are the ones before and after both
    after, before = edge.copy(), np.roll(edge, 1, axis=1)
    after[three, 2], before[three, 3] = edge[three, 3], edge[three, 1]
    length = np.sqrt(np.einsum("ijk,ijk->ij", edge, edge)).sum(axis=1)
    d1, d2 = p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]
    twice = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]
    far = np.sign(twice) * np.minimum(BORDER_PX, 0.4 * np.abs(twice) / np.maximum(length, 1e-9))
    na, nb = _left(after), _left(before)
    out = (na + nb) / np.maximum(1 + np.einsum("ijk,ijk->ij", na, nb), 0.3)[..., None]
    return np.asarray(p + out * far[:, None, None])


def _left(v: Array) -> Array:
    n = np.stack([-v[..., 1], v[..., 0]], axis=-1)
    return n / np.maximum(np.sqrt(np.einsum("ijk,ijk->ij", n, n)), 1e-9)[..., None]
