"""Visible intervals of each model edge: analytic hidden-line removal against the mesh.

The inverse depths of an edge and of a triangle are linear in the image. Therefore a triangle hides a single interval of
an edge, bounded by the triangle's sides and by the point of equal inverse depth. The union of these intervals over all
triangles is the hidden part of the edge.

References
----------
Appel (1967), The notion of quantitative invisibility and the machine rendering of solids. Cyrus and Beck (1978),
Generalized two- and three-dimensional clipping, for the part of an edge inside a triangle.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.camera.lens.camera_model import Distortion
from flyaround.simulator.labels.visibility import SURFACE_TOLERANCE_M, project_for_camera
from flyaround.simulator.runtime.memory import cached_per_object

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.geometry.mesh import TriangleMesh
    from flyaround.simulator.runtime.arrays import BoolArray, FloatArray, IntArray
    from flyaround.simulator.targets.model import Edge, Target
    from flyaround.simulator.world.frames.pose import Pose

MIN_DEPTH_M = 0.05  # minimum depth of an edge in front of the camera

ROD_RADIUS_FACTOR = 1.2
"""Distance from a rod's axis, in radii, within which a surface counts as the rod's own. Rods may taper."""

END_ON_SINE = 0.1
"""Sine of the angle between a rod and the line of sight below which the rod is seen end-on."""

MAX_NEARER_SHARE = 0.9  # largest shift of an edge towards the camera, over its distance: it stays in front


@dataclass(frozen=True, eq=False)
class ProjectedEdge:
    """One projected edge.

    Parameters
    ----------
    edge : Edge
        The model's edge.
    ends_px : (2, 2) array
        Projected ends, not clipped to the image.
    inverse_depth : (2,) array
        Inverse depth of the ends, linear along the projected edge [m-1].
    intervals : tuple of tuple of float
        Visible intervals, as shares 0..1 of the edge's undistorted projection.
    straight_px : (2, 2) array, optional
        Ends without lens distortion; None if the lens does not distort.
    lens : Camera, optional
        Camera, if its lens distorts; else None.
    """

    edge: Edge
    ends_px: FloatArray
    inverse_depth: FloatArray
    intervals: tuple[tuple[float, float], ...]
    straight_px: FloatArray | None = None
    lens: Camera | None = None

    @property
    def length_px(self) -> float:
        """Length of the whole projected edge."""
        return float(np.hypot(*(self.ends_px[1] - self.ends_px[0])))

    def at(self, share: FloatArray) -> FloatArray:
        """Return pixels (S, 2) at shares (S,) of the projected edge."""
        a, b = self.ends_px if self.straight_px is None else self.straight_px
        straight = np.asarray(a + share[:, None] * (b - a))
        return straight if self.lens is None else distort_pixels(self.lens, straight)


def distort_pixels(camera: Camera, straight_px: FloatArray) -> FloatArray:
    """Apply the lens distortion to pixels (S, 2) of an undistorted projection."""
    xy = (straight_px - (camera.cx_px, camera.cy_px)) / (camera.fx_px, camera.fy_px)
    return camera.project(np.concatenate([xy, np.ones((len(xy), 1))], axis=1))


def view_edges(
    camera: Camera, camera_from_target: Pose, target: Target, mesh: TriangleMesh
) -> tuple[ProjectedEdge, ...]:
    """Return all edges of a target in front of the camera, with their visible stretches.

    An edge whose faces all face away has no visible interval. A rod's edge is its axis, which its own surface hides, so
    it is tested against surfaces nearer than the rod; an oblique line of sight meets that surface farther before the
    axis.

    Parameters
    ----------
    camera : Camera
        Camera of the image.
    camera_from_target : Pose
        Pose of the target in the camera frame.
    target : Target
        Target model.
    mesh : TriangleMesh
        All triangles of ``target``.

    Returns
    -------
    tuple of ProjectedEdge
        Ends [px] and visible intervals of each edge.
    """
    arrays = _edge_arrays(target)
    in_camera = camera_from_target.apply(arrays.ends_m)
    in_front = np.flatnonzero(in_camera[..., 2].min(axis=1) >= MIN_DEPTH_M)
    in_camera = in_camera[in_front]
    # occlusion depends on rays only, so it is computed without distortion, where lines are straight
    is_distorted = not camera.distortion.is_none
    straight = replace(camera, distortion=Distortion()) if is_distorted else camera
    pixels = straight.project(in_camera)
    ends_px = camera.project(in_camera) if is_distorted else pixels
    inverse = 1 / in_camera[..., 2]
    distance = np.linalg.norm(in_camera, axis=2)
    surface_offset_m = arrays.radius_m[in_front, None] / np.maximum(_sine_to_sight(in_camera), END_ON_SINE)
    nearer = inverse / (
        1
        - np.minimum(
            (SURFACE_TOLERANCE_M + ROD_RADIUS_FACTOR * surface_offset_m) / distance, MAX_NEARER_SHARE
        )
    )
    facing = np.flatnonzero(arrays.facing(np.asarray(camera_from_target.inverse().t_m))[in_front])
    intervals: list[tuple[tuple[float, float], ...]] = [()] * len(in_front)
    projected = project_for_camera(mesh, camera_from_target)
    image_plane = in_camera[facing, :, :2] * inverse[facing, :, None]
    for k, visible in zip(facing, projected.visible_intervals(image_plane, nearer[facing]), strict=True):
        intervals[k] = visible
    edges = target.wireframe
    return tuple(
        ProjectedEdge(
            edges[n], ends_px[k], inverse[k], intervals[k], *((pixels[k], camera) if is_distorted else ())
        )
        for k, n in enumerate(in_front)
    )


def _sine_to_sight(ends_m: FloatArray) -> FloatArray:
    """Return the (E, 2) sine of the angle between each edge (E, 2, 3) and the line of sight to its ends, camera
    frame.
    """
    edge_vectors = ends_m[:, 1:] - ends_m[:, :1]
    product = np.linalg.norm(np.cross(ends_m, edge_vectors), axis=2)
    length = np.linalg.norm(edge_vectors, axis=2) * np.linalg.norm(ends_m, axis=2)
    return np.asarray(product / np.maximum(length, 1e-12))


@dataclass(frozen=True, eq=False)
class _EdgeArrays:
    """A target's edges as arrays, target frame.

    Parameters
    ----------
    ends_m : (E, 2, 3) array
        Ends.
    radius_m : (E,) array
        Radius of rods, else 0.
    planes : (P, 4) array
        Faces that meet at the edges: outward unit normal, and negated distance from the origin [m].
    edge_index : (P,) array
        Edge of each plane.
    """

    ends_m: FloatArray
    radius_m: FloatArray
    planes: FloatArray
    edge_index: IntArray

    def facing(self, eye_m: FloatArray) -> BoolArray:
        """Return (E,) True where a face of an edge faces the eye; True for an edge without faces."""
        faces_eye = np.ones(len(self.ends_m), bool)
        faces_eye[self.edge_index] = False
        faces_eye[self.edge_index[self.planes @ np.append(eye_m, 1.0) > 0]] = True
        return faces_eye


@cached_per_object
def _edge_arrays(target: Target) -> _EdgeArrays:
    edges = target.wireframe
    edge_index = np.array([k for k, edge in enumerate(edges) for _ in edge.normals], np.int64)
    normals = np.array([normal for edge in edges for normal in edge.normals], float).reshape(-1, 3)
    ends = np.array([(edge.a_m, edge.b_m) for edge in edges], float).reshape(-1, 2, 3)
    # an end of the edge gives the planes' offsets, because it lies in the planes of both faces
    distance = (normals * ends[edge_index, 0]).sum(axis=1)
    radius = np.array([edge.radius_m for edge in edges], float)
    return _EdgeArrays(ends, radius, np.column_stack([normals, -distance]), edge_index)
