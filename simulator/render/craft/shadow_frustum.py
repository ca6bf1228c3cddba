"""The light's view of a craft: the box of its shadow map, and the part that the camera's view needs."""

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
"""Half the width of the box, over the radius of the craft."""
_TURN_RAD = 0.38  # rotation of the box about the light


def light_matrix(center_m: FloatArray, radius_m: float, along: FloatArray) -> FloatArray:
    """Return the (4, 4) clip matrix of an orthographic box around a sphere, seen along a unit vector.

    The box is rotated about the light: edges of a craft follow its axes, and one along the map's rows would lie half a
    texel off over its whole length.
    """
    x, y, z = orthonormal_basis(along)
    c, s = math.cos(_TURN_RAD), math.sin(_TURN_RAD)
    view = np.eye(4)
    view[:3, :3] = c * x + s * y, c * y - s * x, z
    view[:3, 3] = -view[:3, :3] @ center_m
    half = radius_m * WIDER
    # near and far are swapped: OpenGL's depth grows against the view's z, ours with it
    return np.asarray(create_orthogonal_projection(-half, half, -half, half, half, -half).T @ view)


_LARGEST = 0.85  # share of the box above which a window is not worth a change
_STEP = 2**0.25  # ratio of consecutive window sizes
_GRID = 32  # positions of a window's centre across its width; whole texels of every map
_MARGIN = 1 + 4 / _GRID  # for the filter's reach and the rounding of the centre
_ROOM = 1.02  # margin around the craft: at least five texels on each side, for the filter's reach
_PATCH = 0.1  # size of a patch, over the mesh's radius
_MOST_SPLITS = 8  # times that a triangle's edges are halved
_CORNERS = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])


@dataclass(frozen=True)
class ShadowFrustum:
    """A square in the map's clip coordinates: centre and half width; ``0, 0, 1`` is the whole map."""

    x: float = 0.0
    y: float = 0.0
    half: float = 1.0

    @property
    def matrix(self) -> FloatArray:
        """(4, 4) matrix from the whole box's clip coordinates to the window's; depth is kept, for blockers outside."""
        matrix = np.eye(4)
        matrix[:2, :2] /= self.half
        matrix[:2, 3] = -self.x / self.half, -self.y / self.half
        return matrix


@dataclass(frozen=True, eq=False)
class SurfacePatches:
    """The surface in cubes of one size.

    Parameters
    ----------
    corners_m : (8, 3, P) array
        Corners of the boxes, target frame.
    normals : (P, 3) array
        Mean unit normal of each.
    spread_rad : (P,) array
        Largest angle between the mean normal and a normal in the box.
    """

    corners_m: FloatArray
    normals: FloatArray
    spread_rad: FloatArray

    @staticmethod
    def of(mesh: GpuMesh, positions_m: FloatArray) -> SurfacePatches:
        """Return the patches of a mesh with vertices (K, 3)."""
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
        """Return (P,) True where a surface in a box may face a point."""
        middle = self.corners_m.mean(axis=0).T
        radius = np.linalg.norm(self.corners_m[7].T - middle, axis=1)
        to = place_m - middle
        distance = np.maximum(np.linalg.norm(to, axis=1), 1e-9)
        angle = np.arccos(np.clip(np.einsum("ij,ij->i", to, self.normals) / distance, -1, 1))
        own = np.arcsin(np.clip(radius / distance, 0, 1))
        return np.asarray(angle < np.pi / 2 + self.spread_rad + own)


def frustum_around(points_m: FloatArray, light_from_target: FloatArray) -> ShadowFrustum:
    """Return the window that holds a craft seen from the Sun: a third smaller than its sphere's box, or half of it.

    It depends only on the Sun's direction in the craft's frame, so no shadow edge crawls on an approach.

    Parameters
    ----------
    points_m : (3, K) array
        Points whose convex hull holds the craft, target frame.
    light_from_target : (4, 4) array
        Matrix to the clip coordinates of the whole box.
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
    """Return the window that holds every surface that the image may show.

    A point's blockers lie on its ray to the Sun, in the same window. Sizes and positions are quantised, so that
    neighbouring frames share the map's texels and no shadow edge crawls.

    Parameters
    ----------
    camera_from_target : (4, 4) array
        Transform from the target to the camera frame.
    light_from_target : (4, 4) array
        Transform from the target to the light's clip coordinates of the whole box.
    closed : bool
        True if surfaces that face away from the camera are hidden.
    widest : float, optional
        Least width of the window over the greatest height of a blocker above a visible surface, because the filter
        reads a fixed number of texels, which must hold the penumbra.
    """
    x, y, z = _placed(patches.corners_m, camera_from_target)
    before = np.maximum(z, 1e-3)
    visible = np.ones(z.shape[1], bool)
    for along, length, middle_px, focal_px in (
        (x, camera.width_px, camera.cx_px, camera.fx_px),
        (y, camera.height_px, camera.cy_px, camera.fy_px),
    ):
        slope = along / before
        visible &= slope.max(axis=0) > (-0.5 - middle_px) / focal_px
        visible &= slope.min(axis=0) < (length - 0.5 - middle_px) / focal_px
    # a box that reaches behind the camera may be anywhere in the image
    visible |= z.min(axis=0) <= 1e-3
    visible &= z.max(axis=0) > 0
    if closed:
        R = camera_from_target[:3, :3]
        visible &= patches.facing(-R.T @ camera_from_target[:3, 3])
    if not visible.any():
        return ShadowFrustum()
    light = _placed(patches.corners_m, light_from_target)
    visible_light = light[:, :, visible].reshape(3, -1)
    (*low, _), (*high, deepest) = visible_light.min(axis=1), visible_light.max(axis=1)
    extent = np.subtract(high, low)
    half_width = float(extent.max()) / 2 * _MARGIN
    middle = np.add(low, high) / 2
    if widest > 0:
        over = np.all(np.abs(light[:2].mean(axis=1) - middle[:, None]) < half_width + _PATCH, axis=0)
        half_width = max(half_width, widest * float(deepest - light[2][:, over].min()) / 2)
    half = float(_STEP ** np.ceil(np.log(half_width) / np.log(_STEP)))
    if half >= _LARGEST:
        return ShadowFrustum()
    grid = 2 * half / _GRID
    x, y = np.round(middle / grid) * grid
    return ShadowFrustum(float(x), float(y), half)


def _placed(corners_m: FloatArray, matrix: FloatArray) -> FloatArray:
    """Transform corners (8, 3, P) by an affine matrix (4, 4) to (3, 8, P); axis by axis is fastest in NumPy."""
    return np.asarray(np.tensordot(matrix[:3, :3], corners_m, (1, 1)) + matrix[:3, 3, None, None])
