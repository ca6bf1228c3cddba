"""Which stretch of each model edge a camera sees: analytic hidden-line removal against the mesh.

Both an edge and a triangle have an inverse depth that is linear on the screen. So each triangle whose
projection an edge crosses hides it over one interval: the part of the edge inside the triangle, cut where the
two inverse depths are equal. The union of these intervals is what is hidden.

References
----------
Appel (1967), The notion of quantitative invisibility and the machine rendering of solids. Cyrus and Beck (1978),
Generalized two- and three-dimensional clipping, for the part inside.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from simulator.camera.model import Distortion
from simulator.labels.occlusion import SURFACE_TOLERANCE_M, Mesh

if TYPE_CHECKING:
    from simulator.arrays import FloatArray
    from simulator.camera.model import Camera
    from simulator.targets.model import Edge, Target
    from simulator.world.pose import Pose

NEAR_M = 0.05
# A stretch shorter than this share of its edge is rounding where two triangles meet.
SHORTEST = 1e-6


@dataclass(frozen=True, eq=False)
class EdgeView:
    """One edge as a camera sees it.

    Parameters
    ----------
    edge : the model's edge.
    ends_px : (2, 2) where its ends project, not clipped to the image.
    inverse_depth : (2,) of its ends, linear along the projected edge [m-1].
    stretches : visible parts, as shares 0..1 of the edge's projection by a lens that does not bend it.
    straight_px, lens : ends (2, 2) in that projection and the camera, where the lens bends; else None.
    """

    edge: Edge
    ends_px: FloatArray
    inverse_depth: FloatArray
    stretches: tuple[tuple[float, float], ...]
    straight_px: FloatArray | None = None
    lens: Camera | None = None

    @property
    def length_px(self) -> float:
        """Length of the whole projected edge."""
        return float(np.hypot(*(self.ends_px[1] - self.ends_px[0])))

    @property
    def visible_px(self) -> float:
        """Length of what is seen, on the image or not."""
        return self.length_px * sum(b - a for a, b in self.stretches)

    def at(self, share: FloatArray) -> FloatArray:
        """Pixels (S, 2) at shares (S,) of the projected edge."""
        a, b = self.ends_px if self.straight_px is None else self.straight_px
        straight = np.asarray(a + share[:, None] * (b - a))
        if self.lens is None:
            return straight
        c = self.lens
        xy = (straight - (c.cx_px, c.cy_px)) / (c.fx_px, c.fy_px)
        return c.project(np.concatenate([xy, np.ones((len(xy), 1))], axis=1))


def view_edges(camera: Camera, camera_from_target: Pose, target: Target, mesh: Mesh) -> tuple[EdgeView, ...]:
    """All edges of a target that lie before the camera, with their visible stretches.

    An edge whose faces all look away has no visible stretch. A rod's edge is its axis, which its own surface hides:
    it is tested against what lies nearer than the rod.

    Parameters
    ----------
    mesh : all triangles of ``target``.
    """
    vertices = camera_from_target.apply(mesh.positions_m)
    triangles = mesh.triangles
    if vertices[:, 2].min() <= NEAR_M:
        triangles = triangles[np.all(vertices[triangles, 2] > NEAR_M, axis=1)]
    # what hides what is a matter of rays: a lens that bends them does not change it, and lines stay straight without
    bends = not camera.distortion.is_none
    straight = replace(camera, distortion=Distortion()) if bends else camera
    with np.errstate(divide="ignore"):  # of vertices in the lens's plane, which no triangle here has
        screen = _Screen.of(straight.project(vertices)[triangles], (1 / vertices[:, 2])[triangles])
    in_camera = camera_from_target.apply(
        np.array([(e.a_m, e.b_m) for e in target.wireframe]).reshape(-1, 3)
    ).reshape(-1, 2, 3)
    ahead = np.flatnonzero(in_camera[..., 2].min(axis=1) >= NEAR_M)
    edges, in_camera = [target.wireframe[k] for k in ahead], in_camera[ahead]
    pixels = straight.project(in_camera.reshape(-1, 3)).reshape(-1, 2, 2)
    ends_px = camera.project(in_camera.reshape(-1, 3)).reshape(-1, 2, 2) if bends else pixels
    inverse = 1 / in_camera[..., 2]
    tolerance = SURFACE_TOLERANCE_M + 1.2 * np.array([e.radius_m for e in edges])[:, None]
    nearer = inverse / (1 - tolerance / np.linalg.norm(in_camera, axis=2))
    eye = np.asarray(camera_from_target.inverse().t_m)
    facing = np.flatnonzero([_faces_camera(edge, eye) for edge in edges])
    stretches: list[tuple[tuple[float, float], ...]] = [()] * len(edges)
    for k, hidden in zip(facing, screen.hidden(pixels[facing], nearer[facing]), strict=True):
        stretches[k] = _complement(hidden)
    return tuple(
        EdgeView(edge, ends_px[k], inverse[k], stretches[k], *((pixels[k], camera) if bends else ()))
        for k, edge in enumerate(edges)
    )


def _faces_camera(edge: Edge, eye: FloatArray) -> bool:
    if not edge.normals:
        return True
    to_eye = eye - np.asarray(edge.a_m)  # any point of the edge: it lies in both faces' planes
    return any(float(to_eye @ np.asarray(n)) > 0 for n in edge.normals)


@dataclass(frozen=True, eq=False)
class _Screen:
    """The projected mesh, ready to be cut with edges.

    Parameters
    ----------
    bounds : (4, M) lowest x, y and highest x, y of each triangle, for a quick reject. nearest : (M,) its largest
        inverse depth.
    planes : (4, 3, M) coefficients a, b, c of a x + b y + c: the triangle's inverse depth, then the distance from each
        of its sides, positive inside (times the side's length).
    """

    bounds: FloatArray
    nearest: FloatArray
    planes: FloatArray

    @staticmethod
    def of(xy: FloatArray, inverse: FloatArray) -> _Screen:
        """The mesh from its projected corners (M, 3, 2) and their inverse depths (M, 3)."""
        x, y = (np.ascontiguousarray(xy[..., axis].T) for axis in (0, 1))
        key = np.ascontiguousarray(inverse.T)
        area = (x[1] - x[0]) * (y[2] - y[0]) - (y[1] - y[0]) * (x[2] - x[0])
        solid = np.abs(area) > 1e-9  # not seen edge-on
        if not solid.all():
            x, y, key, area = x[:, solid], y[:, solid], key[:, solid], area[solid]
        planes = np.empty((4, 3, len(area)))
        d1, d2 = (key[1] - key[0]) / area, (key[2] - key[0]) / area
        planes[0, 0] = d1 * (y[2] - y[0]) - d2 * (y[1] - y[0])
        planes[0, 1] = d2 * (x[1] - x[0]) - d1 * (x[2] - x[0])
        planes[0, 2] = key[0] - planes[0, 0] * x[0] - planes[0, 1] * y[0]
        turn = np.sign(area)
        for k in range(3):
            j = (k + 1) % 3
            planes[1 + k, 0] = turn * (y[k] - y[j])
            planes[1 + k, 1] = turn * (x[j] - x[k])
            planes[1 + k, 2] = -planes[1 + k, 0] * x[k] - planes[1 + k, 1] * y[k]
        bounds = np.stack([x.min(axis=0), y.min(axis=0), x.max(axis=0), y.max(axis=0)])
        return _Screen(bounds, key.max(axis=0), planes)

    def hidden(self, ends_px: FloatArray, inverse: FloatArray) -> list[FloatArray]:
        """Of each edge the intervals (H, 2) that some triangle covers with a larger inverse depth.

        Parameters
        ----------
        ends_px : (E, 2, 2). inverse : (E, 2) inverse depths of the ends.
        """
        if len(ends_px) == 0:
            return []
        b, low, high = self.bounds, ends_px.min(axis=1), ends_px.max(axis=1)
        near = [
            np.flatnonzero(
                (b[0] <= high[k, 0])
                & (b[1] <= high[k, 1])
                & (b[2] >= low[k, 0])
                & (b[3] >= low[k, 1])
                & (self.nearest > inverse[k].min())
            )
            for k in range(len(ends_px))
        ]
        edge = np.repeat(np.arange(len(ends_px)), [len(n) for n in near])
        triangle = np.concatenate(near)
        first, last = np.zeros(len(edge)), np.ones(len(edge))
        along, rise = ends_px[:, 1] - ends_px[:, 0], inverse[:, 1] - inverse[:, 0]
        for k in range(4):
            a_b_c = self.planes[k][:, triangle]
            value = a_b_c[0] * ends_px[edge, 0, 0] + a_b_c[1] * ends_px[edge, 0, 1] + a_b_c[2]
            slope = a_b_c[0] * along[edge, 0] + a_b_c[1] * along[edge, 1]
            if k == 0:
                value, slope = value - inverse[edge, 0], slope - rise[edge]
            _cut(first, last, value, slope)
            left = np.flatnonzero(last > first)
            edge, triangle, first, last = edge[left], triangle[left], first[left], last[left]
        ends = np.searchsorted(edge, np.arange(len(ends_px) + 1))
        intervals = np.stack([first, last], axis=1)
        return [intervals[i:j] for i, j in itertools.pairwise(ends)]


def _cut(first: FloatArray, last: FloatArray, value: FloatArray, slope: FloatArray) -> None:
    """Shrink [first, last] in place to where ``value + s slope >= 0``."""
    with np.errstate(divide="ignore", invalid="ignore"):
        root = -value / slope
    np.maximum(first, root, out=first, where=slope > 0)
    np.minimum(last, root, out=last, where=slope < 0)
    last[(slope == 0) & (value < 0)] = -1.0


def _complement(hidden: FloatArray) -> tuple[tuple[float, float], ...]:
    """What a union of intervals (H, 2) leaves of [0, 1]."""
    hidden = hidden[np.argsort(hidden[:, 0], kind="stable")]
    starts = np.append(hidden[:, 0], 1.0)
    reached = np.maximum.accumulate(np.insert(hidden[:, 1], 0, 0.0))
    gaps = starts - reached > SHORTEST
    return tuple(zip(reached[gaps].tolist(), starts[gaps].tolist(), strict=True))
