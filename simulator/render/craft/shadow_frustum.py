"""Light-space volume of a craft's shadow map: the whole craft, or only the part that the image shows."""

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

BOX_MARGIN = 1.02
"""Half the width of the box, over the radius of the craft."""
_TURN_RAD = 0.38  # rotation of the box about the light


def light_matrix(center_m: FloatArray, radius_m: float, along: FloatArray) -> FloatArray:
    """Return the (4, 4) clip matrix of an orthographic box around a sphere.

    The box is rotated about the light. Many edges of a craft follow its axes, and the shadow of an edge along the map's
    rows would be half a texel off over its whole length.

    Parameters
    ----------
    center_m : (3,) array
        Centre of the sphere, target frame [m].
    radius_m : float
        Radius of the sphere [m].
    along : (3,) array
        Unit vector in which the light travels, target frame.
    """
    x, y, z = orthonormal_basis(along)
    c, s = math.cos(_TURN_RAD), math.sin(_TURN_RAD)
    view = np.eye(4)
    view[:3, :3] = c * x + s * y, c * y - s * x, z
    view[:3, 3] = -view[:3, :3] @ center_m
    half = radius_m * BOX_MARGIN
    # near and far are swapped: OpenGL's depth grows against the view's z, ours with it
    return np.asarray(create_orthogonal_projection(-half, half, -half, half, half, -half).T @ view)


_MAX_HALF_WIDTH = 0.85  # share of the box above which a window is not worth a change
_STEP = 2**0.25  # ratio of consecutive window sizes
_GRID = 32  # positions of a window's centre across its width; whole texels of every map
_MARGIN = 1 + 4 / _GRID  # for the filter's reach and the rounding of the centre
_CRAFT_MARGIN = 1.02  # margin around the craft: at least five texels on each side, for the filter's reach
_PATCH_SIZE = 0.1  # size of a patch, over the mesh's radius
_MAX_SPLITS = 8  # times that a triangle's edges are halved
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
    """Bounding boxes of the surface's patches: triangles in one cube of a grid that face a similar direction.

    Parameters
    ----------
    corners_m : (8, 3, P) array
        Corners of the boxes, target frame.
    normals : (P, 3) array
        Mean unit normal of each patch.
    spread_rad : (P,) array
        Largest angle between the mean normal and a normal of the patch.
    """

    corners_m: FloatArray
    normals: FloatArray
    spread_rad: FloatArray

    @staticmethod
    def from_mesh(mesh: GpuMesh, positions_m: FloatArray) -> SurfacePatches:
        """Divide a mesh with vertices (K, 3) [m] into patches."""
        triangles, normals = positions_m[mesh.triangles].astype(float), mesh.planes[:, :3].astype(float)
        size = _PATCH_SIZE * mesh.radius_m
        for _ in range(_MAX_SPLITS):
            is_long = np.ptp(triangles, axis=1).max(axis=1) > size
            if not is_long.any():
                break
            middles = (triangles[is_long] + np.roll(triangles[is_long], -1, axis=1)) / 2
            corner_triangles = [
                np.stack([triangles[is_long, k], middles[:, k], middles[:, k - 1]], axis=1) for k in range(3)
            ]
            triangles = np.concatenate([triangles[~is_long], middles, *corner_triangles])
            normals = np.concatenate([normals[~is_long], *[normals[is_long]] * 4])
        cell = np.floor((triangles.mean(axis=1) - mesh.center_m) / size).astype(int)
        side = 2 * np.abs(normals).argmax(axis=1) + (normals.max(axis=1) > -normals.min(axis=1))
        _, patch = np.unique(np.column_stack([cell, side]), axis=0, return_inverse=True)
        order = np.argsort(patch.ravel(), kind="stable")
        starts = np.flatnonzero(np.diff(patch.ravel()[order], prepend=-1))
        lowest = np.minimum.reduceat(triangles.min(axis=1)[order], starts)
        highest = np.maximum.reduceat(triangles.max(axis=1)[order], starts)
        mean = np.add.reduceat(normals[order], starts)
        mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-9)
        patch_number = np.repeat(np.arange(len(starts)), np.diff(starts, append=len(order)))
        cosine = np.minimum.reduceat(np.einsum("ij,ij->i", normals[order], mean[patch_number]), starts)
        corners = np.where(_CORNERS[..., None] == 0, lowest.T, highest.T)
        return SurfacePatches(corners, mean, np.arccos(np.clip(cosine, -1, 1)))

    def facing(self, viewpoint_m: FloatArray) -> BoolArray:
        """Return a mask (P,) of the patches with a surface that may face a point (3,) [m]."""
        middle = self.corners_m.mean(axis=0).T
        radius = np.linalg.norm(self.corners_m[7].T - middle, axis=1)
        offset = viewpoint_m - middle
        distance = np.maximum(np.linalg.norm(offset, axis=1), 1e-9)
        angle = np.arccos(np.clip(np.einsum("ij,ij->i", offset, self.normals) / distance, -1, 1))
        angular_radius = np.arcsin(np.clip(radius / distance, 0, 1))
        return np.asarray(angle < np.pi / 2 + self.spread_rad + angular_radius)


def frustum_around(points_m: FloatArray, light_from_target: FloatArray) -> ShadowFrustum:
    """Return the window that just holds the craft as seen from the Sun.

    It is narrower than the box around the craft's sphere, least of all along a diagonal of the craft. It depends only
    on the Sun's direction in the craft's frame, so no shadow edge crawls on an approach.

    Parameters
    ----------
    points_m : (3, K) array
        Points whose convex hull holds the craft, target frame [m].
    light_from_target : (4, 4) array
        Matrix to the clip coordinates of the whole box.
    """
    points = light_from_target[:2, :3] @ points_m + light_from_target[:2, 3:]
    lowest, highest = points.min(axis=1), points.max(axis=1)
    half = float((highest - lowest).max()) / 2 * _CRAFT_MARGIN
    x, y = (lowest + highest) / 2
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
    """Return the window that holds every surface that may be visible in the image.

    A point's blockers lie on its ray to the Sun, and therefore in the same window. Sizes and positions are quantised,
    so that successive frames share the map's texels and no shadow edge crawls.

    Parameters
    ----------
    patches : SurfacePatches
        Patches of the target's surface.
    camera : Camera
        The camera.
    camera_from_target : (4, 4) array
        Transform from the target to the camera frame.
    light_from_target : (4, 4) array
        Transform from the target to the light's clip coordinates of the whole box.
    closed : bool
        True if surfaces that face away from the camera are hidden.
    widest : float, optional
        Smallest ratio of the window's width to the height of a blocker above a visible surface. The filter reads a
        fixed number of texels, which must hold the penumbra.
    """
    x, y, z = _transform(patches.corners_m, camera_from_target)
    depth = np.maximum(z, 1e-3)
    visible = np.ones(z.shape[1], bool)
    for coordinate, length, middle_px, focal_px in (
        (x, camera.width_px, camera.cx_px, camera.fx_px),
        (y, camera.height_px, camera.cy_px, camera.fy_px),
    ):
        slope = coordinate / depth
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
    in_light = _transform(patches.corners_m, light_from_target)
    visible_in_light = in_light[:, :, visible].reshape(3, -1)
    (*low, _), (*high, deepest) = visible_in_light.min(axis=1), visible_in_light.max(axis=1)
    extent = np.subtract(high, low)
    half_width = float(extent.max()) / 2 * _MARGIN
    middle = np.add(low, high) / 2
    if widest > 0:
        is_over_window = np.all(
            np.abs(in_light[:2].mean(axis=1) - middle[:, None]) < half_width + _PATCH_SIZE, axis=0
        )
        half_width = max(half_width, widest * float(deepest - in_light[2][:, is_over_window].min()) / 2)
    half = float(_STEP ** np.ceil(np.log(half_width) / np.log(_STEP)))
    if half >= _MAX_HALF_WIDTH:
        return ShadowFrustum()
    grid = 2 * half / _GRID
    x, y = np.round(middle / grid) * grid
    return ShadowFrustum(float(x), float(y), half)


def _transform(corners_m: FloatArray, matrix: FloatArray) -> FloatArray:
    """Transform corners (8, 3, P) by an affine matrix (4, 4) to (3, 8, P), the layout that is fastest in NumPy."""
    return np.asarray(np.tensordot(matrix[:3, :3], corners_m, (1, 1)) + matrix[:3, 3, None, None])
