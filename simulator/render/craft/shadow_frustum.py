"""The light's view of a craft: the box of its shadow map, and the part of it that the camera's view needs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from pyrr.matrix44 import create_orthogonal_projection

from flyaround.simulator.geometry.directions import orthonormal_basis

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.render.craft.mesh import GpuMesh
    from flyaround.simulator.runtime.arrays import BoolArray, FloatArray

WIDER = 1.02
"""Half the box, over the radius of the craft."""
_TURN_RAD = 0.38


def light_matrix(center_m: FloatArray, radius_m: float, along: FloatArray) -> FloatArray:
    """(4, 4) clip matrix of an orthographic box around a sphere, seen along a unit vector.

    The box is turned about the light: edges of a craft follow its axes, and one along a map's rows would lie half a
    texel off over all its length.
    """
    x, y, z = orthonormal_basis(along)
    c, s = math.cos(_TURN_RAD), math.sin(_TURN_RAD)
    view = np.eye(4)
    view[:3, :3] = c * x + s * y, c * y - s * x, z
    view[:3, 3] = -view[:3, :3] @ center_m
    half = radius_m * WIDER
    # near and far in turn: OpenGL's depth grows against the view's z, ours with it
    return np.asarray(create_orthogonal_projection(-half, half, -half, half, half, -half).T @ view)


_LARGEST = 0.85  # of the box: a larger window is not worth a change
_STEP = 2**0.25  # between the sizes of windows
_GRID = 32  # places of a window's middle across its width; whole numbers of texels of every map
_MARGIN = 1 + 4 / _GRID  # for the filter's reach and the middle's rounding
_ROOM = 1.02  # around the craft as the Sun sees it: five texels and more on each side, for the filter's reach
_PATCH = 0.1  # of the mesh's radius: the size of a patch
_MOST_SPLITS = 8  # a triangle's edges are halved that often at most
_CORNERS = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])


@dataclass(frozen=True)
class ShadowFrustum:
    """A square in the map's clip coordinates: middle and half width, ``0, 0, 1`` for all of it."""

    x: float = 0.0
    y: float = 0.0
    half: float = 1.0

    @property
    def matrix(self) -> FloatArray:
        """(4, 4) from the whole box's clip coordinates to the window's; depth stays, for what throws the shadows."""
        matrix = np.eye(4)
        matrix[:2, :2] /= self.half
        matrix[:2, 3] = -self.x / self.half, -self.y / self.half
        return matrix


@dataclass(frozen=True, eq=False)
class SurfacePatches:
    """The surface in small boxes of one side each.

    Parameters
    ----------
    corners_m : (8, 3, P) of the boxes, target frame. normals : (P, 3) their mean, unit.
    spread_rad : (P,) largest angle between it and a normal in the box.
    """

    corners_m: FloatArray
    normals: FloatArray
    spread_rad: FloatArray

    @staticmethod
    def of(mesh: GpuMesh, positions_m: FloatArray) -> SurfacePatches:
        """The patches of a mesh whose vertices (K, 3) are given."""
        triangles, normals = positions_m[mesh.triangles].astype(float), mesh.planes[:, :3].astype(float)
        size = _PATCH * mesh.radius_m
        for _ in range(_MOST_SPLITS):
            long = np.ptp(triangles, axis=1).max(axis=1) > size
            if not long.any():
                break
            middles = (triangles[long] + np.roll(triangles[long], -1, axis=1)) / 2
            parts = [
                np.stack([triangles[long, k], middles[:, k], middles[:, k - 1]], axis=1) for k in range(3)
            ]
            triangles = np.concatenate([triangles[~long], middles, *parts])
            normals = np.concatenate([normals[~long], *[normals[long]] * 4])
        cell = np.floor((triangles.mean(axis=1) - mesh.center_m) / size).astype(int)
        side = 2 * np.abs(normals).argmax(axis=1) + (normals.max(axis=1) > -normals.min(axis=1))
        _, patch = np.unique(np.column_stack([cell, side]), axis=0, return_inverse=True)
        order = np.argsort(patch.ravel(), kind="stable")
        starts = np.flatnonzero(np.diff(patch.ravel()[order], prepend=-1))
        low = np.minimum.reduceat(triangles.min(axis=1)[order], starts)
        high = np.maximum.reduceat(triangles.max(axis=1)[order], starts)
        mean = np.add.reduceat(normals[order], starts)
        mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-9)
        of_patch = np.repeat(np.arange(len(starts)), np.diff(starts, append=len(order)))
        cosine = np.minimum.reduceat(np.einsum("ij,ij->i", normals[order], mean[of_patch]), starts)
        corners = np.where(_CORNERS[..., None] == 0, low.T, high.T)
        return SurfacePatches(corners, mean, np.arccos(np.clip(cosine, -1, 1)))

    def facing(self, place_m: FloatArray) -> BoolArray:
        """(P,) whether anything in a box may look towards a place."""
        middle = self.corners_m.mean(axis=0).T
        radius = np.linalg.norm(self.corners_m[7].T - middle, axis=1)
        to = place_m - middle
        distance = np.maximum(np.linalg.norm(to, axis=1), 1e-9)
        angle = np.arccos(np.clip(np.einsum("ij,ij->i", to, self.normals) / distance, -1, 1))
        own = np.arcsin(np.clip(radius / distance, 0, 1))
        return np.asarray(angle < np.pi / 2 + self.spread_rad + own)


def frustum_around(points_m: FloatArray, light_from_target: FloatArray) -> ShadowFrustum:
    """The window that holds a craft as the Sun sees it: a third smaller than the box around its sphere, or half of it.

    It depends on where the Sun stands in the craft's frame and on nothing else: on an approach no shadow's edge crawls.

    Parameters
    ----------
    points_m : (3, K) whose convex hull holds the craft, target frame.
    light_from_target : (4, 4) to the clip coordinates of the whole box.
    """
    places = light_from_target[:2, :3] @ points_m + light_from_target[:2, 3:]
    low, high = places.min(axis=1), places.max(axis=1)
    half = float((high - low).max()) / 2 * _ROOM
    x, y = (low + high) / 2
    return ShadowFrustum(float(x), float(y), half) if half < 1 else ShadowFrustum()


def fit_shadow_frustum(
    patches: SurfacePatches,
    camera: Camera,
    camera_from_target: FloatArray,
    light_from_target: FloatArray,
    *,
    closed: bool,
    widest: float = 0.0,
) -> ShadowFrustum:
    """The window that holds every surface that the image may show.

    What shades a point lies on its ray to the Sun, in the same window. Sizes and places come in steps, so that
    neighbouring frames share the map's texels and no shadow's edge crawls.

    Parameters
    ----------
    camera_from_target, light_from_target : (4, 4); the second to the clip coordinates of the whole box.
    closed : surfaces that look away from the camera do not show.
    widest : least width of the window over the greatest height of a blocker over a surface that shows; the filter
        looks at so many texels, and those of a smaller window would not hold its penumbra.
    """
    x, y, z = _placed(patches.corners_m, camera_from_target)
    before = np.maximum(z, 1e-3)
    seen = np.ones(z.shape[1], bool)
    for along, length, middle_px, focal_px in (
        (x, camera.width_px, camera.cx_px, camera.fx_px),
        (y, camera.height_px, camera.cy_px, camera.fy_px),
    ):
        slope = along / before
        seen &= slope.max(axis=0) > (-0.5 - middle_px) / focal_px
        seen &= slope.min(axis=0) < (length - 0.5 - middle_px) / focal_px
    # a box that reaches behind the camera may be anywhere in the image
    seen |= z.min(axis=0) <= 1e-3
    seen &= z.max(axis=0) > 0
    if closed:
        R = camera_from_target[:3, :3]
        seen &= patches.facing(-R.T @ camera_from_target[:3, 3])
    if not seen.any():
        return ShadowFrustum()
    light = _placed(patches.corners_m, light_from_target)
    shown = light[:, :, seen].reshape(3, -1)
    (*low, _), (*high, deepest) = shown.min(axis=1), shown.max(axis=1)
    extent = np.subtract(high, low)
    needed = float(extent.max()) / 2 * _MARGIN
    middle = np.add(low, high) / 2
    if widest > 0:
        over = np.all(np.abs(light[:2].mean(axis=1) - middle[:, None]) < needed + _PATCH, axis=0)
        needed = max(needed, widest * float(deepest - light[2][:, over].min()) / 2)
    half = float(_STEP ** np.ceil(np.log(needed) / np.log(_STEP)))
    if half >= _LARGEST:
        return ShadowFrustum()
    grid = 2 * half / _GRID
    x, y = np.round(middle / grid) * grid
    return ShadowFrustum(float(x), float(y), half)


def _placed(corners_m: FloatArray, matrix: FloatArray) -> FloatArray:
    """(3, 8, P) corners (8, 3, P) where an affine matrix (4, 4) puts them, axis by axis: numpy is quickest so."""
    return np.asarray(np.tensordot(matrix[:3, :3], corners_m, (1, 1)) + matrix[:3, 3, None, None])
