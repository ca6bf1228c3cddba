"""Ray cast of the exported mesh through every pixel: trimesh reads the .glb, Embree casts, OpenCV applies the lens.


No code is shared with rendering or labelling: the mesh is the exported file; pose, camera and label images are those of
the record.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from flyaround.simulator.targets.glb.write import glb_bytes
from tools.validation.datasets.rounded_raster import shown_parts

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.labels.truth import Truth
    from flyaround.simulator.targets.model import Target

_TURNED_BACK = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Rotation from glTF's y up to the model's z up."""

# A raster rounds corners to 1/256 px, so a ray through the pixel's centre may differ at outlines, cracks and thin rods.
# If it differs, rays on three rings around the centre are cast; if those differ too, rasterisation is repeated for that
# pixel in integers, because most rays miss faces thinner than 1/256 px.
_RINGS_PX = (0.03, 0.1, 0.5)
_DIRECTIONS = 12  # rays per ring
_COPLANAR_M = 2e-3  # a decal and the surface below it
_NEAR_M = 1e-3  # depth below which a face is not projected


@dataclass(frozen=True)
class Disagreement:
    """Disagreement of ray casting with a frame's labels [pixels].

    Parameters
    ----------
    n_on : int
        Pixels of the mask.
    n_rays : int
        Pixels tested.
    mask : int
        Pixels whose mask label neither a ray near the pixel's centre nor raster rounding explains.
    parts : int
        Pixels whose part label neither a ray near the pixel's centre nor raster rounding explains.
    twice : int
        Pixels in the visible masks of two parts, in the mask and in no part, or in a part and not in the mask.
    """

    n_on: int
    n_rays: int
    mask: int
    parts: int
    twice: int


class ExportedMesh:
    """An exported target, prepared for ray casting.

    Parameters
    ----------
    target : Target
        Target to write to a .glb file in memory, which trimesh reads.
    """

    def __init__(self, target: Target) -> None:
        scene = trimesh.load(io.BytesIO(glb_bytes(target)), file_type="glb", process=False)
        vertices, faces, parts, first = [], [], [], 0
        for number, mesh in enumerate(scene.geometry.values(), start=1):
            vertices.append(mesh.vertices)
            faces.append(mesh.faces + first)
            parts.append(np.full(len(mesh.faces), number))
            first += len(mesh.vertices)
        # every node is a child of one root, which rotates z up to y up: mesh coordinates are the model's coordinates
        _check_root(scene)
        self.n_parts = len(parts)
        self._parts = np.concatenate(parts)
        self._mesh = trimesh.Trimesh(np.concatenate(vertices), np.concatenate(faces), process=False)
        self._rays = RayMeshIntersector(self._mesh)

    def first_parts(self, truth: Truth, pixels_px: NDArray[Any]) -> NDArray[Any]:
        """Return the part hit first by the ray through each pixel (K, 2); 0 for none."""
        origins, directions = _rays(truth, pixels_px)
        hit = self._rays.intersects_first(origins, directions)
        return np.where(hit >= 0, self._parts[hit], 0)

    def near_parts(self, truth: Truth, pixel_px: NDArray[Any]) -> set[int]:
        """Return the parts hit first by the ray through one pixel, or within a decal's height behind; 0 for none."""
        origins, directions = _rays(truth, pixel_px[None])
        places, _, triangles = self._rays.intersects_location(origins, directions, multiple_hits=True)
        if not len(places):
            return {0}
        far = np.linalg.norm(places - origins[0], axis=1)
        return set(self._parts[triangles[far <= far.min() + _COPLANAR_M]].tolist())

    def rounded_parts(self, truth: Truth, pixel_px: NDArray[Any]) -> set[int]:
        """Return the parts that a raster may show at one pixel, 0 for none; with a lens, at its undistorted place."""
        R, t_m, K = _rotation(truth), np.array(truth.t_camera_from_target_m), _matrix(truth)
        depth_m = self._mesh.vertices @ R[2] + t_m[2]
        in_front = np.all(depth_m[self._mesh.faces] > _NEAR_M, axis=1)
        projected = cv2.projectPoints(self._mesh.vertices, cv2.Rodrigues(R)[0], t_m, K, np.zeros(5))[
            0
        ].reshape(-1, 2)
        faces = self._mesh.faces[in_front]
        lens = bool(truth.camera.distortion.coefficients)
        plain_px = (_without_lens(truth, pixel_px[None]) @ K[:2, :2].T + K[:2, 2])[0] if lens else pixel_px
        return shown_parts(
            projected[faces] - plain_px, depth_m[faces], self._parts[in_front], _COPLANAR_M, lens=lens
        )


def _check_root(scene: Any) -> None:  # noqa: ANN401 - a scene of trimesh
    name = scene.graph.nodes_geometry[0]
    turn = scene.graph.get(name)[0]
    if not np.allclose(_TURNED_BACK @ turn[:3, :3], np.eye(3), atol=1e-6) or np.any(turn[:3, 3]):
        raise RuntimeError("the exported file's root is not the rotation from z up to y up")


def _matrix(truth: Truth) -> NDArray[Any]:
    c = truth.camera
    return np.array([[c.fx_px, 0, c.cx_px], [0, c.fy_px, c.cy_px], [0, 0, 1]])


def _rotation(truth: Truth) -> NDArray[Any]:
    w, x, y, z = truth.q_camera_from_target_wxyz
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _rays(truth: Truth, pixels_px: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return origins and directions of the rays in the model frame."""
    R = _rotation(truth)
    directions = np.insert(_without_lens(truth, pixels_px), 2, 1.0, axis=1) @ R  # R transposed, times columns
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.broadcast_to(-R.T @ np.array(truth.t_camera_from_target_m), directions.shape), directions


def _without_lens(truth: Truth, pixels_px: NDArray[Any]) -> NDArray[Any]:
    """Return the intersections of rays through pixels (K, 2) with the plane at depth 1."""
    camera, K = truth.camera, _matrix(truth)
    lens = np.array(camera.distortion.coefficients or [0.0] * 5)
    pixels = np.ascontiguousarray(pixels_px, float).reshape(-1, 1, 2)
    if camera.distortion.model == "kannala_brandt":
        return np.asarray(cv2.fisheye.undistortPoints(pixels, K, lens).reshape(-1, 2))
    stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-12)
    return np.asarray(cv2.undistortPoints(pixels, K, lens, R=None, P=None, criteria=stop).reshape(-1, 2))


def compare(
    truth: Truth, mask: NDArray[np.uint8], parts: NDArray[np.uint16], mesh: ExportedMesh
) -> Disagreement:
    """Compare every pixel around the craft with the ray cast."""
    height, width = mask.shape
    near = np.argwhere(cv2.dilate(((mask > 0) | (parts > 0)).astype(np.uint8), np.ones((17, 17), np.uint8)))
    all_pixels = np.argwhere(np.ones((height, width), bool))[:: max(height * width // 20_000, 1)]
    pixels = np.unique(np.concatenate([near, all_pixels]), axis=0)[:, ::-1]
    cast_parts = mesh.first_parts(truth, pixels)
    labelled, on = parts[pixels[:, 1], pixels[:, 0]], mask[pixels[:, 1], pixels[:, 0]] > 0
    wrong_mask = [
        p
        for p, has in zip(pixels[on != (cast_parts > 0)], on[on != (cast_parts > 0)], strict=True)
        if not _is_seen(truth, mesh, p, bool(has))
    ]
    is_other_part = on & (cast_parts > 0) & (labelled != cast_parts)
    wrong_parts = [
        p
        for p, part in zip(pixels[is_other_part], labelled[is_other_part], strict=True)
        if not _shows(truth, mesh, p, int(part))
    ]
    # a mask of each part, as in formats with several objects
    times = sum((parts == k).astype(np.uint8) for k in range(1, mesh.n_parts + 1))
    n_repeated = int(np.count_nonzero(times != (mask > 0)))
    return Disagreement(
        int(np.count_nonzero(mask)), len(pixels), len(wrong_mask), len(wrong_parts), n_repeated
    )


def _about(pixel: NDArray[Any]) -> NDArray[Any]:
    angles = np.arange(_DIRECTIONS) * 2 * np.pi / _DIRECTIONS
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.concatenate([pixel + r * ring for r in _RINGS_PX])


def _is_seen(truth: Truth, mesh: ExportedMesh, pixel: NDArray[Any], on: bool) -> bool:  # noqa: FBT001 - the label
    """Return True if a ray near a pixel's centre agrees with the mask, or raster rounding explains the difference."""
    if np.any((mesh.first_parts(truth, _about(pixel)) > 0) == on):
        return True
    return any((part > 0) == on for part in mesh.rounded_parts(truth, pixel))


def _shows(truth: Truth, mesh: ExportedMesh, pixel: NDArray[Any], part: int) -> bool:
    """Return True if a ray at or near a pixel hits a part first or just behind the first, or rounding may show it."""
    if part in mesh.near_parts(truth, pixel.astype(float)) or np.any(
        mesh.first_parts(truth, _about(pixel)) == part
    ):
        return True
    if any(part in mesh.near_parts(truth, p) for p in _about(pixel)):
        return True
    return part in mesh.rounded_parts(truth, pixel)
