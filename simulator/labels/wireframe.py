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

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from simulator.camera.model import Distortion
from simulator.labels.occlusion import SURFACE_TOLERANCE_M, Mesh, triangle_bounds

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
    eye = np.asarray(camera_from_target.inverse().t_m)
    views = []
    for edge in target.wireframe:
        in_camera = camera_from_target.apply(np.array([edge.a_m, edge.b_m]))
        if in_camera[:, 2].min() < NEAR_M:
            continue
        pixels, inverse = straight.project(in_camera), 1 / in_camera[:, 2]
        stretches: tuple[tuple[float, float], ...] = ()
        if _faces_camera(edge, eye):
            distance = np.linalg.norm(in_camera, axis=1)
            tolerance = SURFACE_TOLERANCE_M + 1.2 * edge.radius_m
            stretches = _complement(screen.hidden(pixels, inverse / (1 - tolerance / distance)))
        if bends:
            views.append(EdgeView(edge, camera.project(in_camera), inverse, stretches, pixels, camera))
        else:
            views.append(EdgeView(edge, pixels, inverse, stretches))
    return tuple(views)


def _faces_camera(edge: Edge, eye: FloatArray) -> bool:
    if not edge.normals:
        return True
    to_eye = eye - np.asarray(edge.a_m)  # any point of the edge: it lies in both faces' planes
    return any(float(to_eye @ np.asarray(n)) > 0 for n in edge.normals)


@dataclass(frozen=True, eq=False)
class _Screen:
    """The projected mesh: corners (M, 3, 2), inverse depths (M, 3), and bounds (4, M) for a quick reject."""

    xy: FloatArray
    inverse: FloatArray
    bounds: FloatArray

    @staticmethod
    def of(xy: FloatArray, inverse: FloatArray) -> _Screen:
        e1, e2 = xy[:, 1] - xy[:, 0], xy[:, 2] - xy[:, 0]
        area = e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0]
        # counter-clockwise on the screen, and not seen edge-on
        turned = area < 0
        xy, inverse = xy.copy(), inverse.copy()
        xy[turned], inverse[turned] = xy[turned][:, ::-1], inverse[turned][:, ::-1]
        solid = np.abs(area) > 1e-9
        xy, inverse = xy[solid], inverse[solid]
        return _Screen(xy, inverse, np.concatenate(triangle_bounds(xy)))

    def hidden(self, ends_px: FloatArray, inverse: FloatArray) -> FloatArray:
        """Intervals (H, 2) of the edge that some triangle covers with a larger inverse depth."""
        low, high = ends_px.min(axis=0), ends_px.max(axis=0)
        b = self.bounds
        near = np.flatnonzero((b[0] <= high[0]) & (b[1] <= high[1]) & (b[2] >= low[0]) & (b[3] >= low[1]))
        if near.size == 0:
            return np.empty((0, 2))
        xy, key = self.xy[near], self.inverse[near]
        start, along = ends_px[0], ends_px[1] - ends_px[0]
        first, last = np.zeros(len(near)), np.ones(len(near))
        for k in range(3):
            side = xy[:, (k + 1) % 3] - xy[:, k]
            # inside: left of each side, f(s) = value + s slope >= 0
            value = side[:, 0] * (start[1] - xy[:, k, 1]) - side[:, 1] * (start[0] - xy[:, k, 0])
            slope = side[:, 0] * along[1] - side[:, 1] * along[0]
            _cut(first, last, value, slope)
        # the triangle's inverse depth as a plane over the screen, along the edge
        e1, e2 = xy[:, 1] - xy[:, 0], xy[:, 2] - xy[:, 0]
        area = e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0]
        d1, d2 = key[:, 1] - key[:, 0], key[:, 2] - key[:, 0]
        gx = (d1 * e2[:, 1] - d2 * e1[:, 1]) / area
        gy = (d2 * e1[:, 0] - d1 * e2[:, 0]) / area
        value = key[:, 0] + gx * (start[0] - xy[:, 0, 0]) + gy * (start[1] - xy[:, 0, 1]) - inverse[0]
        slope = gx * along[0] + gy * along[1] - (inverse[1] - inverse[0])
        _cut(first, last, value, slope)
        found = last > first
        return np.stack([first[found], last[found]], axis=1)


def _cut(first: FloatArray, last: FloatArray, value: FloatArray, slope: FloatArray) -> None:
    """Shrink [first, last] in place to where ``value + s slope >= 0``."""
    with np.errstate(divide="ignore", invalid="ignore"):
        root = -value / slope
    rising, falling = slope > 0, slope < 0
    first[rising] = np.maximum(first[rising], root[rising])
    last[falling] = np.minimum(last[falling], root[falling])
    last[(slope == 0) & (value < 0)] = -1.0


def _complement(hidden: FloatArray) -> tuple[tuple[float, float], ...]:
    """What a union of intervals leaves of [0, 1]."""
    seen, reached = [], 0.0
    for a, b in sorted(map(tuple, hidden.tolist())):
        if a - reached > SHORTEST:
            seen.append((reached, a))
        reached = max(reached, b)
    if 1.0 - reached > SHORTEST:
        seen.append((reached, 1.0))
    return tuple(seen)
