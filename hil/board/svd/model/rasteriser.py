"""The craft drawn as faces of unknown brightness, for alignment on the whole picture rather than on edges.

Which face is seen in which pixel follows from the pose; how bright each face is, the picture itself tells (the mean
of its pixels), so nothing needs to be known of the Sun. What remains is a difference of pictures, and its
derivative by the pose lives where faces meet.
"""

from __future__ import annotations

import base64
import zlib
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Dict, Tuple, Union

import cv2
import numpy as np

if TYPE_CHECKING:
    from hil.board.svd.model.target_model import CameraIntrinsics

from hil.board.svd.image.response import Response
from hil.board.svd.native.backend import library
from hil.board.svd.native.raster import rasteriser as paint

Array = np.ndarray

# What OpenCV's polygon filling adds on every side [px]: with it the drawn area is the true one.
BORDER_PX = 0.48

# Blur that leaves of a texture what it would be without the craft: share of the region's longer side.
TEXTURE = 0.06

# Width below which what is drawn is too wide all the same [px].
NARROW_PX = 1.2


# Parts of a direction that have one brightness; on a round body it changes by as much as between materials.
STEPS, ROUND_STEPS = 3, 6


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
        group, groups = _grouped(material, n, STEPS)
        offset = np.einsum("ij,ij->i", n, corners[:, 0])
        return Faces(corners, n, offset, group, groups, material, plane, children, members)

    def grouped(self, steps: int) -> Faces:
        """The same with one brightness for each material and ``steps``-th of a direction's components."""
        group, groups = _grouped(self.material, self.normals, steps)
        return replace(self, group=group, groups=groups)

    @cached_property
    def labels(self) -> Array:
        """(T + 1,) group + 1 of each face, zero first: what no face covers."""
        return np.concatenate([[0], self.group + 1]).astype(np.uint8 if self.groups < 255 else np.uint16)

    @cached_property
    def area_m2(self) -> Array:
        """(T,) area of each face [m^2]."""
        c = self.corners
        return np.asarray(0.5 * np.linalg.norm(np.cross(c[:, 2] - c[:, 0], c[:, 3] - c[:, 1]), axis=1))

    @cached_property
    def group_normals(self) -> Array:
        """(G, 3) mean normal of each group, by area."""
        total = np.zeros((self.groups, 3))
        np.add.at(total, self.group, self.normals * self.area_m2[:, None])
        return np.asarray(total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-18))

    @cached_property
    def group_material(self) -> Array:
        """(G,) material of each group."""
        out = np.zeros(self.groups, int)
        out[self.group] = self.material
        return out

    @cached_property
    def _places(self) -> Tuple[Array, Array, Array, Array]:
        """Place of each node in the order, far to near: ``gain`` (N, N) times its sides plus ``base`` (N,).

        A node comes after its far subtree, and everything in its near one after both: how many that are depends
        on the side of each node above it alone, so that the whole tree is walked by one product of a matrix.
        Then the faces of all nodes, and the node of each.
        """
        n = len(self.children)
        size, above = np.ones(n), np.full(n, -1)
        for node in range(n - 1, -1, -1):
            # children come after their parents in the list
            for child in self.children[node]:
                if child >= 0:
                    size[node] += size[child]
                    above[child] = node
        sizes = np.append(size, 0.0)[self.children]
        gain, base = np.zeros((n, n), np.float32), np.zeros(n, np.float32)
        for node in range(n):
            parent = above[node]
            if parent >= 0:
                gain[node], base[node] = gain[parent], base[parent]
                in_front = self.children[parent, 0] == node
                # the parent's own share: what its far subtree holds
                gain[node, parent] = sizes[parent, 1] + 1 if in_front else -sizes[parent, 0] - 1
                base[node] += (0 if in_front else sizes[parent, 0] + 1) - sizes[parent, 0]
            gain[node, node] = sizes[node, 1] - sizes[node, 0]
            base[node] += sizes[node, 0]
        reached = np.flatnonzero((above >= 0) | (np.arange(n) == 0))
        ids = np.concatenate([self.members[k] for k in reached])
        owner = np.repeat(reached, [len(self.members[k]) for k in reached])
        return gain, base, ids, owner

    def order(self, C_m: Array) -> Array:
        """Faces that look at the camera centre ``C_m`` (3,), the farthest first."""
        native = library()
        return self._order(C_m) if native is None else paint.order(native, self.packed, C_m)

    @cached_property
    def packed(self) -> paint.Packed:
        """The faces as the kernels take them."""
        return paint.Packed.of(self, self._middles)

    def _order(self, C_m: Array) -> Array:
        """The same by numpy."""
        gain, base, ids, node = self._places
        side = (self.plane[:, :3] @ C_m > self.plane[:, 3]).astype(np.float32)
        keep = (self.normals @ C_m > self.offset)[ids]
        ids, rank = ids[keep], (gain @ side + base)[node[keep]]
        middle = self._middles[ids] - C_m
        far_first = -np.einsum("ij,ij->i", middle, middle)
        # within a leaf by distance; faces on the plane of a node lie beside each other
        return np.asarray(ids[np.lexsort((far_first, rank))])

    @cached_property
    def _middles(self) -> Array:
        return np.asarray(self.corners.mean(axis=1))


def _grouped(material: Array, normals: Array, steps: int) -> Tuple[Array, int]:
    """Group of each face, one material and nearly one direction, and how many there are."""
    key = np.concatenate([material[:, None], np.rint(normals * steps)], axis=1).astype(int)
    unique, group = np.unique(key, axis=0, return_inverse=True)
    return group.ravel(), len(unique)


@dataclass(frozen=True, eq=False)
class Canvas:
    """A region of the picture, reduced, for comparison with the drawn craft.

    Parameters
    ----------
    gray : (h, w) float32. sigma : its noise. x0, y0 : the region's corner, picture pixels.
    factor : picture pixels per pixel of it. fine : drawn pixels per pixel of it, each way.
    full : where its scale ends. plain : what it would be without the craft, (h, w) or one level; None for itself
        under a wide blur, see ``background``.
    tall : rows' picture pixels over columns': a region is no whole number of equal pixels both ways, and to take
        it for one moves the range by a thousandth.
    """

    gray: Array
    sigma: float
    x0: float
    y0: float
    factor: float
    fine: int
    full: float = 255.0
    plain: Union[float, Array, None] = 0.0
    tall: float = 1.0
    clipped: float = 0.0
    exact: bool = False

    @cached_property
    def textured(self) -> bool:
        """Whether what lies behind the craft has no one level."""
        return self.plain is None or np.ndim(self.plain) > 0

    @cached_property
    def background(self) -> Union[float, Array]:
        """What it would be without the craft, made when asked for: most that is aligned on a texture never is."""
        if self.plain is None:
            return cv2.GaussianBlur(self.gray, (0, 0), TEXTURE * max(self.gray.shape))
        return self.plain

    @cached_property
    def response(self) -> Response:
        """What the picture shows of a brightness."""
        return Response(self.clipped, self.full)

    @cached_property
    def scale(self) -> Tuple[float, float]:
        """Drawn pixels per picture pixel, across and down."""
        return self.fine / self.factor, self.fine / (self.factor * self.tall)

    @cached_property
    def _blurred(self) -> Dict[float, Array]:
        return {}

    def blurred(self, sigma_px: float) -> Array:
        """(h, w) the region through a Gaussian, kept for the next pose; hardly any blur is none."""
        if sigma_px <= 0.2:
            return self.gray
        if sigma_px not in self._blurred:
            self._blurred[sigma_px] = cv2.GaussianBlur(self.gray, (0, 0), sigma_px)
        return self._blurred[sigma_px]

    @cached_property
    def kept(self) -> Dict[str, Any]:
        """What does not hang on any pose, for the next one."""
        return {}

    def rays(self, camera: CameraIntrinsics) -> Tuple[Array, Array]:
        """Normalised coordinates of the drawn pixels' columns and rows; the canvas shows a pinhole's picture."""
        h, w = self.gray.shape
        across, down = self.scale
        u = ((np.arange(w * self.fine) + 0.5) / across - 0.5 + self.x0 - camera.cx_px) / camera.fx_px
        v = ((np.arange(h * self.fine) + 0.5) / down - 0.5 + self.y0 - camera.cy_px) / camera.fy_px
        return u, v


def draw_faces(
    faces: Faces,
    order: Array,
    camera: CameraIntrinsics,
    R: Array,
    t: Array,
    canvas: Canvas,
    least_px: float = 0.5,
) -> Array:
    """(h * fine, w * fine) int32: number of the face seen + 1, 0 where there is none.

    Parameters
    ----------
    order : faces to draw, the farthest first. least_px : smaller ones are left to their neighbours [drawn px^2].
    """
    native = library()
    if native is not None and not camera.distorted:
        return paint.draw_faces(native, faces.packed, order, camera, R, t, canvas, least_px)
    h, w = canvas.gray.shape
    p = camera.pixels(faces.corners[order] @ R.T + t)
    p = (p - (canvas.x0, canvas.y0) + 0.5) * canvas.scale - 0.5
    return fill_faces(p, order, (h * canvas.fine, w * canvas.fine), least_px, exact=canvas.exact)


def fill_faces(
    p: Array, order: Array, shape: Tuple[int, int], least_px: float, *, exact: bool = False
) -> Array:
    """Convex polygons ``p`` (P, 4, 2) filled one over the other with their number in ``order`` + 1.

    Parameters
    ----------
    exact : whether those narrower than a pixel get their true area.
    """
    native = library()
    if native is not None:
        return paint.fill_faces(native, p, order, shape, least_px, exact=exact)
    return _filled(p, order, shape, least_px, exact=exact)


def _filled(p: Array, order: Array, shape: Tuple[int, int], least_px: float, *, exact: bool) -> Array:
    """The same by numpy and OpenCV."""
    d1, d2 = p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]
    worth = np.abs(d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]) > 2.0 * least_px
    p, order = inset(shortened(p[worth]) if exact else p[worth]), order[worth]
    seen = np.zeros(shape, np.int32)
    polygons = np.rint(np.clip(p, -3000, 3000) * 16).astype(np.int32)
    fill, line = cv2.fillConvexPoly, cv2.LINE_8
    for polygon, number in zip(polygons, (order + 1).tolist()):  # noqa: B905 - Python 3.9 has no strict=
        fill(seen, polygon, number, line, 4)
    return seen


def shortened(p: Array) -> Array:
    """(P, 4, 2) convex polygons, narrow ones made shorter so that they cover what they should.

    OpenCV draws nothing narrower than a pixel. The rims of plates lie along the craft's outline as such strips: drawn
    a pixel wide each they make the craft larger by a tenth of a pixel all round, and its range longer.
    """
    (ax, ay), (bx, by) = (p[:, 2] - p[:, 0]).T, (p[:, 3] - p[:, 1]).T
    first, second = ax * ax + ay * ay, bx * bx + by * by
    squared = np.maximum(np.maximum(first, second), 1e-12)
    area = 0.5 * np.abs(ax * by - ay * bx)
    narrow = np.flatnonzero(area * area < NARROW_PX**2 * squared)
    if not len(narrow):
        return p
    some, length = p[narrow], np.sqrt(squared[narrow])
    width = area[narrow] / length
    longer = (first > second)[narrow]
    ux, uy = (
        np.where(longer, ax[narrow], bx[narrow]) / length,
        np.where(longer, ay[narrow], by[narrow]) / length,
    )
    # the width drawn after ``inset``, measured at all angles
    share = width / (0.98 + 0.19 * width) - 1.0
    along = some[..., 0] * ux[:, None] + some[..., 1] * uy[:, None]
    away = share[:, None] * (along - 0.25 * along.sum(axis=1, keepdims=True))
    out = p.copy()
    out[narrow, :, 0] += away * ux[:, None]
    out[narrow, :, 1] += away * uy[:, None]
    return out


def inset(p: Array) -> Array:
    """(P, 4, 2) convex polygons made smaller by what OpenCV adds to them: it fills the border's pixels too."""
    x, y = np.ascontiguousarray(p[..., 0]), np.ascontiguousarray(p[..., 1])
    ex, ey = x[:, [1, 2, 3, 0]] - x, y[:, [1, 2, 3, 0]] - y
    squared = ex * ex + ey * ey
    length = np.sqrt(squared)
    # unit normals to the left of each side, and of the side before it
    scale = 1.0 / np.maximum(length, 1e-9)
    ax, ay = -ey * scale, ex * scale
    bx, by = ax[:, [3, 0, 1, 2]], ay[:, [3, 0, 1, 2]]
    three = np.flatnonzero(squared[:, 2] < 1e-12)
    # a triangle's last corner is there twice: its two sides are the ones before and after both
    bx[three, 3], by[three, 3] = ax[three, 1], ay[three, 1]
    ax[three, 2], ay[three, 2] = ax[three, 3], ay[three, 3]
    d1, d2 = p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]
    twice = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]
    far = np.sign(twice) * np.minimum(BORDER_PX, 0.4 * np.abs(twice) / np.maximum(length.sum(axis=1), 1e-9))
    share = far[:, None] / np.maximum(1 + ax * bx + ay * by, 0.3)
    out = np.empty_like(p)
    out[..., 0], out[..., 1] = x + (ax + bx) * share, y + (ay + by) * share
    return out
