"""Checks of the two labels that decide whether a frame is feasible.

``silhouette_inside``, the share of the silhouette inside the image, is recomputed from triangles filled by OpenCV.
``wireframe_step_share``, the share of the visible edges with a brightness step above the noise, is recomputed in double
precision from a noise-free image, on the edges that the labels' own code finds visible. Steps within the tolerance of
the threshold may count either way.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.dataset.check.geometry import (
    in_lens,
    project_with_opencv,
    silhouette_triangles,
    subdivide_for_lens,
)
from flyaround.simulator.geometry.triangle_fill import fill_triangles
from flyaround.simulator.imaging.image_formation import noise_sigma
from flyaround.simulator.labels.wireframe import view_edges
from flyaround.simulator.targets.joined_mesh import joined_mesh

if TYPE_CHECKING:
    from collections.abc import Iterator

    from flyaround.simulator.labels.truth import Truth
    from flyaround.simulator.runtime.arrays import ByteArray, FloatArray
    from flyaround.simulator.targets.model import Target

SILHOUETTE_GRID_PX = 2048  # longest side of the grid on which silhouettes are filled
LABEL_GRID_PX = 512  # longest side of the coarser grid that the label is computed on
AREA_TOLERANCE = 0.002  # relative tolerance of an area, for the pixels of its outline on that grid
# Tolerance of a silhouette's pixel count, in square roots of its outline's length: four standard deviations if each
# outline pixel is wrong by half a pixel at random.
OUTLINE_SIGMAS = 2.0
# Nearer targets are not checked: their label counts only surfaces within one image size of the image (docs/labels.md).
MIN_DISTANCE_M = 0.01
# Spacing of samples along an edge, and distance from it at which brightness is read on either side (docs/labels.md).
SPACING_PX, REACH_PX = (
    4.0,
    2.0,
)
DIRECTION_STEP = 1e-4  # step along an edge for its direction, in x / z
REMAP_GRID_PX = 1 / 32  # sub-pixel resolution of cv2.remap in some versions of OpenCV
FLOAT32_ROUNDING = 1e-5  # rounding of float32 coordinates


def check_silhouette_inside(truth: Truth, target: Target) -> list[str]:
    """Return the errors of the label ``silhouette_inside``: none, or one sentence."""
    mesh, camera = joined_mesh(target), truth.camera
    box = truth.box_amodal_px
    if (
        box is not None
        and min(box[:2]) >= 0
        and box[2] <= camera.width_px - 1
        and box[3] <= camera.height_px - 1
    ):
        # the box is checked against the mask elsewhere
        return (
            []
            if truth.silhouette_inside == 1
            else ["silhouette_inside is not 1, and all of the craft is inside"]
        )
    t = np.asarray(truth.t_camera_from_target_m)
    R = truth.scene.camera_from_target.R
    in_camera = mesh.positions_m @ R.T + t
    if in_camera[:, 2].min() <= MIN_DISTANCE_M:
        return []
    if not in_lens(camera, in_camera).all():
        return []  # beyond the lens's domain OpenCV's polynomial folds back
    q = truth.q_camera_from_target_wxyz
    if camera.distortion.is_none:
        corners_px = project_with_opencv(camera, mesh.positions_m, q, t)[mesh.triangles]
        # in a closed shell, front faces cover the whole silhouette
        corners_px = corners_px[silhouette_triangles(mesh, corners_px)]
    else:
        points = subdivide_for_lens(camera, mesh.positions_m[mesh.triangles], R, t).reshape(-1, 3)
        corners_px = project_with_opencv(camera, points, q, t).reshape(-1, 3, 2)
    low, high = corners_px.min(axis=(0, 1)), corners_px.max(axis=(0, 1))
    size = np.array([camera.width_px, camera.height_px])
    if np.all(low >= 0) and np.all(high <= size - 1):
        expected, tolerance = 1.0, 0.0
    elif np.any(high < -1) or np.any(low > size):
        expected, tolerance = 0.0, 0.0
    else:
        scale = min(4.0, SILHOUETTE_GRID_PX / float((high - low).max()))
        shape = tuple(int(n) + 3 for n in np.ceil((high - low) * scale)[::-1])
        # pixel (0, 0) of the fine grid is one pixel before the silhouette
        start = low - 1.0 / scale
        fine = np.zeros(shape, np.uint8)
        fill_triangles(fine, (corners_px - start) * scale - 0.5)
        area, part = _area(fine, start, scale, size)
        expected = part / area if area else 0.0
        # the label counts pixels on a grid no finer than the image
        coarser = min(1.0, LABEL_GRID_PX / float((high - low).max())) / scale
        outline = np.count_nonzero(fine - cv2.erode(fine, np.ones((3, 3), np.uint8))) * coarser
        tolerance = AREA_TOLERANCE + OUTLINE_SIGMAS * float(np.sqrt(outline)) / max(area * coarser**2, 1.0)
    if abs(truth.silhouette_inside - expected) > tolerance:
        message = (
            f"silhouette_inside is {truth.silhouette_inside:.4f}, the projected craft says {expected:.4f} "
            f"to {tolerance:.4f}"
        )
        return [message]
    return []


def _area(fine: ByteArray, start: FloatArray, scale: float, size: FloatArray) -> tuple[float, float]:
    """Return the area of a filled silhouette and its part inside the image; outline pixels count half."""
    inner = cv2.erode(fine, np.ones((3, 3), np.uint8))
    share = (fine.astype(float) + inner) / 510
    x, y = ((np.arange(n) + 0.5) / scale + s for n, s in zip(fine.shape[::-1], start, strict=True))
    on = ((x >= -0.5) & (x < size[0] - 0.5))[None, :] & ((y >= -0.5) & (y < size[1] - 0.5))[:, None]
    return float(share.sum()), float(share[on].sum())


def check_step_share(
    truth: Truth, target: Target, signal: FloatArray, absolute: float, relative: float = 0.0
) -> list[str]:
    """Return the errors of the label ``wireframe_step_share``: none, or one sentence.

    The label is the share of the visible wireframe across which the signal steps by at least one sigma of the noise.

    Parameters
    ----------
    truth : Truth
        Truth record of the frame.
    target : Target
        Target model.
    signal : (H, W) array
        Noise-free signal, 1 at full scale.
    absolute : float
        Absolute uncertainty of the signal.
    relative : float, optional
        Relative uncertainty of the signal.
    """
    clipped = np.clip(signal, 0, 1)
    level = float(clipped.mean())
    level_error = absolute + relative * level
    sigmas = [
        noise_sigma(truth.scene.sensor, x, truth.scene.exposure_s)
        for x in (max(level - level_error, 0.0), level + level_error)
    ]
    certain = possible = count = 0
    for pixels, normal in _samples(truth, target):
        sides = np.array([_sides(clipped, pixels, normal, grid_px) for grid_px in (0.0, REMAP_GRID_PX)])
        steps = np.abs(sides[:, 0] - sides[:, 1])
        uncertainty = 2 * (absolute + FLOAT32_ROUNDING) + relative * sides.sum(axis=1).max(axis=0)
        certain += int(np.count_nonzero(steps.min(axis=0) - uncertainty >= max(sigmas)))
        possible += int(np.count_nonzero(steps.max(axis=0) + uncertainty >= min(sigmas)))
        count += len(pixels)
    if not count:
        return (
            [] if truth.wireframe_step_share == 0 else ["wireframe_step_share is not 0, and no edge is seen"]
        )
    low, high = certain / count, possible / count
    if not low - 1e-9 <= truth.wireframe_step_share <= high + 1e-9:
        message = (
            f"wireframe_step_share is {truth.wireframe_step_share:.4f}, the noise-free picture says "
            f"{low:.4f} to {high:.4f}"
        )
        return [message]
    return []


def _samples(truth: Truth, target: Target) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield sample positions (S, 2) [px] along each visible edge interval, and the unit normals (S, 2) there."""
    camera, pose = truth.camera, truth.scene.camera_from_target
    still = (1.0, 0.0, 0.0, 0.0), np.zeros(3)
    # use the label's own visibility of edges: rays check it elsewhere
    for view in view_edges(camera, pose, target, joined_mesh(target)):
        ends_m = pose.apply(np.array([view.edge.a_m, view.edge.b_m]))
        # beyond OpenCV's domain, use the label's own lens
        inside = in_lens(camera, ends_m).all()
        ends_px = project_with_opencv(camera, ends_m, *still) if inside else camera.project(ends_m)
        length = float(np.hypot(*(ends_px[1] - ends_px[0])))
        if length < 1.0:
            continue
        rays = ends_m / ends_m[:, 2:]
        step = (rays[1] - rays[0]) * DIRECTION_STEP / np.linalg.norm(rays[1] - rays[0])
        for a, b in view.intervals:
            n = max(round((b - a) * length / SPACING_PX), 1)
            share = a + (np.arange(n) + 0.5) * (b - a) / n
            along = rays[0] + share[:, None] * (rays[1] - rays[0])
            along = along[in_lens(camera, along)]  # the others are outside the image
            if not len(along):
                continue
            before, pixels, after = (
                project_with_opencv(camera, along + sign * step, *still) for sign in (-1, 0, 1)
            )
            on = camera.contains(pixels)
            tangent = (after - before)[on]
            yield (
                pixels[on],
                np.stack([-tangent[:, 1], tangent[:, 0]], axis=1) / np.hypot(*tangent.T)[:, None],
            )


def _sides(image: FloatArray, pixels: FloatArray, normal: FloatArray, grid_px: float) -> FloatArray:
    """Return the (2, S) values of an image on the two sides of an edge.

    Parameters
    ----------
    image : (H, W) array
        Image.
    pixels : (S, 2) array
        Points on the edge [px].
    normal : (S, 2) array
        Unit normals of the edge.
    grid_px : float
        Sub-pixel grid of the look-up [px]; 0 for exact positions.
    """
    sides = [pixels + sign * REACH_PX * normal for sign in (-1, 1)]
    if grid_px:
        sides = [np.rint(side / grid_px) * grid_px for side in sides]
    return np.array([_interpolate(image, side) for side in sides])


def _interpolate(image: FloatArray, pixels: FloatArray) -> FloatArray:
    """Interpolate values (S,) at pixels (S, 2) bilinearly, clamped to the border."""
    height, width = image.shape
    x, y = (np.clip(pixels[:, k], 0, n - 1) for k, n in enumerate((width, height)))
    x0, y0 = (np.minimum(c.astype(int), max(n - 2, 0)) for c, n in ((x, width), (y, height)))
    x1, y1 = np.minimum(x0 + 1, width - 1), np.minimum(y0 + 1, height - 1)
    u, v = x - x0, y - y0
    above = image[y0, x0] * (1 - u) + image[y0, x1] * u
    below = image[y1, x0] * (1 - u) + image[y1, x1] * u
    return np.asarray(above * (1 - v) + below * v)
