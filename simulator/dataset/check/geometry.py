"""Checks of projected labels with OpenCV: keypoints, pose, boxes, silhouette.

Only the pose of each row under a rolling shutter is that of the labels.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import msgspec
import numpy as np

from flyaround.simulator.dataset.check.mask_statistics import nonzero_pixels
from flyaround.simulator.geometry.triangle_fill import FILL_SCALE, fill_triangles
from flyaround.simulator.imaging.rolling_shutter import pose_at_rows
from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.targets.joined_mesh import joined_mesh
from flyaround.simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_from_rotvec,
    rotation_angle_rad,
    rotvec_from_quat,
)

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.dataset.card import DatasetCard
    from flyaround.simulator.geometry.mesh import TriangleMesh
    from flyaround.simulator.labels.imported import ImportedTruth
    from flyaround.simulator.labels.truth import Truth
    from flyaround.simulator.runtime.arrays import BoolArray, ByteArray, FloatArray, IntArray
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

# Exported pixels are float64 in JSON: only rounding in the projection may differ.
PIXEL_TOLERANCE_PX = 1e-6

# Tolerances of rounding of a recomputed pose: attitude [rad], and position over range.
POSE_TOLERANCE_RAD = 1e-6
POSE_TOLERANCE_RELATIVE = 1e-6
# The outline filled on the CPU and the raster's may differ by one pixel, not by two.
OUTLINE_TOLERANCE_PX = 1
# termination of OpenCV's iterative undistortion
ITERATIONS = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-12)
# Spacing of the points of edges from which bounds are taken under a lens, and largest bow between two of them. The
# limit on points is for edges that reach far beyond the lens's domain.
EDGE_STEP_PX, EDGE_STEP_BOW_PX, MAX_EDGE_POINTS = 2.0, 0.02, 4096
MAX_EDGE_SAG_PX = 0.1  # largest distance of an edge's midpoint from the line between its ends
# least covered share of a pixel in the inner and in the outer mask
INNER_COVERAGE, OUTER_COVERAGE = 0.9, 0.1  # a tenth is left to the sampling of a pixel


def project_with_opencv(
    camera: Camera, points_m: FloatArray, q_wxyz: tuple[float, ...], t_m: FloatArray
) -> FloatArray:
    """Project target points to pixels with OpenCV, independently of `Camera.project`.

    Returns
    -------
    (K, 2) array
        Columns and rows [px] in the order of the points; those behind the camera are projected too.
    """
    # not cv2.Rodrigues of the matrix: within 1e-5 rad of no turn or half a turn its vector is off by 1e-6 rad
    rotation = rotvec_from_quat(q_wxyz)
    coefficients = np.array(camera.distortion.coefficients or [0.0] * 5)
    if camera.distortion.model == "kannala_brandt":
        projected, _ = cv2.fisheye.projectPoints(
            points_m.reshape(-1, 1, 3), rotation, t_m.reshape(3, 1), camera.K, coefficients
        )
    else:
        projected, _ = cv2.projectPoints(points_m, rotation, t_m, camera.K, coefficients)
    return np.asarray(projected, float).reshape(-1, 2)


def in_lens(camera: Camera, points_camera_m: FloatArray) -> BoolArray:
    """Return (K,) True for points (K, 3) within the lens's domain; beyond it OpenCV's polynomial folds back."""
    if camera.distortion.is_none:
        return np.ones(len(points_camera_m), bool)
    xy = points_camera_m[:, :2] / points_camera_m[:, 2:]
    # at the limit itself the inverse is ill-conditioned
    return np.asarray(np.hypot(*xy.T) <= 0.999 * camera.domain.limit)


def rays_with_opencv(camera: Camera, pixels_px: FloatArray) -> FloatArray:
    """Return (K, 2) x/z, y/z at pixels (K, 2), with OpenCV's inverse distortion."""
    coefficients = np.array(camera.distortion.coefficients or [0.0] * 5)
    pixels = pixels_px.reshape(-1, 1, 2)
    if camera.distortion.model == "kannala_brandt":
        rays = cv2.fisheye.undistortPoints(pixels, camera.K, coefficients)
    else:
        rays = cv2.undistortPoints(pixels, camera.K, coefficients, R=None, P=None, criteria=ITERATIONS)
    return np.asarray(rays, float).reshape(-1, 2)


def check_box_by_edges(truth: Truth | ImportedTruth, mesh: TriangleMesh) -> list[str]:
    """Check the amodal box against OpenCV's projection of all vertices and, under a lens, of points along all edges.

    A lens bows straight edges, so that their ends do not suffice. Points beyond its domain can only enlarge the box.
    """
    camera, box = truth.camera, truth.box_amodal_px
    R = matrix_from_quat(truth.q_camera_from_target_wxyz)
    in_camera = mesh.positions_m @ R.T + truth.t_camera_from_target_m
    if box is None or in_camera[:, 2].min() <= 0:
        return [f"box_amodal_px is {box}, the craft is not all before the camera"]
    rays = in_camera[:, :2] / in_camera[:, 2:]
    corners = rays[np.zeros((0, 3), int) if camera.distortion.is_none else mesh.triangles]
    way = np.roll(corners, -1, axis=1) - corners
    length_px = np.linalg.norm(way * (camera.fx_px, camera.fy_px), axis=2)
    count = np.minimum(length_px / EDGE_STEP_PX, MAX_EDGE_POINTS).astype(int).ravel()  # between the ends
    position = 1 + np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    share = position / np.repeat(count + 1, count)
    along = np.repeat(corners.reshape(-1, 2), count, axis=0)
    along += share[:, None] * np.repeat(way.reshape(-1, 2), count, axis=0)
    points = np.column_stack([np.concatenate([rays, along]), np.ones(len(rays) + len(along))])
    inside = in_lens(camera, points)
    pixels = project_with_opencv(camera, points[inside], (1.0, 0.0, 0.0, 0.0), np.zeros(3))
    low, high = pixels.min(axis=0, initial=np.inf), pixels.max(axis=0, initial=-np.inf)
    bow_px = 0.0 if camera.distortion.is_none else EDGE_STEP_BOW_PX
    excess = np.concatenate([low - box[:2], box[2:] - high])
    # far outside the image, coordinates are large and rounding errors grow with them
    rounding = PIXEL_TOLERANCE_PX * np.maximum(1, np.abs([*low, *high]) / 1e3)
    if np.all(excess >= -rounding) and (not inside.all() or np.all(excess <= rounding + bow_px)):
        return []
    expected = tuple(round(float(x), 3) for x in (*low, *high))
    return [f"box_amodal_px {box} is not the projected craft's {expected}"]


def check_keypoints(truth: Truth, card: DatasetCard) -> list[str]:
    """Check names, projections, the pose that they imply, and out-of-frame states."""
    faults = []
    variation = truth.scene.target.variation
    nominal = card.target.keypoints
    if not isinstance(variation, msgspec.UnsetType):
        nominal = {name: vec3(variation.deform(position)) for name, position in nominal.items()}
    if {k.name: tuple(k.target_m) for k in truth.keypoints} != {n: tuple(p) for n, p in nominal.items()}:
        faults.append("keypoints differ from the card's")
    elif [k.name for k in truth.keypoints] != list(card.target.keypoints):
        faults.append("keypoints are in another order than the card's")
    projected = [k for k in truth.keypoints if k.pixel_px is not None]
    if not projected:
        return faults
    points = np.array([k.target_m for k in projected])
    pixels = np.array([k.pixel_px for k in projected])
    # remove the motion during a rolling shutter: the pose is that of mid-exposure
    at_rows = _projected(truth, points, pose_at_rows(truth.scene, points))
    at_middle = _projected(truth, points, (truth.scene,) * len(points))
    pose = truth.scene.camera_from_target
    usable = in_lens(truth.camera, pose.apply(points))
    error = float(np.abs(at_rows - pixels)[usable].max(initial=0.0))
    if not error <= PIXEL_TOLERANCE_PX:
        faults.append(f"a keypoint is {error:.3g} px from its projection")
        return faults
    if usable.sum() >= 4:
        faults += _check_pose(truth, points[usable], (pixels - at_rows + at_middle)[usable])
    inside = truth.camera.contains(pixels)
    faults += [
        f"keypoint {k.name} at {k.pixel_px} is labelled {k.state}"
        for k, is_inside in zip(projected, inside, strict=True)
        if (k.state == "out_of_frame") == bool(is_inside)
    ]
    faults += [
        f"keypoint {k.name} is behind the camera and labelled {k.state}"
        for k in truth.keypoints
        if k.pixel_px is None and k.state != "out_of_frame"
    ]
    return faults


def _projected(truth: Truth, points: FloatArray, scenes: tuple[SceneState, ...]) -> FloatArray:
    out = np.empty((len(points), 2))
    for scene in {id(s): s for s in scenes}.values():
        selected = [s is scene for s in scenes]
        # the record's own pose if the scene is its mid-exposure: the two are compared elsewhere
        is_own_scene = scene is truth.scene
        q = truth.q_camera_from_target_wxyz if is_own_scene else scene.q_camera_from_target_wxyz
        t = truth.t_camera_from_target_m if is_own_scene else scene.t_camera_from_target_m
        out[selected] = project_with_opencv(truth.camera, points[selected], q, np.asarray(t))
    return out


def _check_pose(truth: Truth, points: FloatArray, pixels: FloatArray) -> list[str]:
    """Check the labelled pose by PnP on the keypoints, with the label as initial value."""
    t = np.asarray(truth.t_camera_from_target_m)
    coefficients = np.array(truth.camera.distortion.coefficients or [0.0] * 5)
    if truth.camera.distortion.model == "kannala_brandt":  # solvePnP has no fish-eye model, so it gets rays
        rays = rays_with_opencv(truth.camera, pixels)
        pixels = rays * (truth.camera.fx_px, truth.camera.fy_px) + (truth.camera.cx_px, truth.camera.cy_px)
        coefficients = np.zeros(5)
    _, rotation, translation = cv2.solvePnP(
        points,
        pixels,
        truth.camera.K,
        coefficients,
        rotvec_from_quat(truth.q_camera_from_target_wxyz),
        t.reshape(3, 1).copy(),
        True,
        cv2.SOLVEPNP_ITERATIVE,
    )
    angle = rotation_angle_rad(
        quat_from_rotvec(np.asarray(rotation).ravel()), truth.q_camera_from_target_wxyz
    )
    shift = float(np.linalg.norm(np.asarray(translation).ravel() - t) / np.linalg.norm(t))
    if angle > POSE_TOLERANCE_RAD or shift > POSE_TOLERANCE_RELATIVE:
        return [f"pose from keypoints is off by {angle:.2g} rad and {shift:.2g} of the range"]
    return []


def check_visible_on_mask(truth: Truth, mask: ByteArray) -> list[str]:
    """Check that visible keypoints lie within 3 px of the mask; a few tips thinner than a pixel may not."""
    near = cv2.dilate(mask, np.ones((7, 7), np.uint8))
    n_visible, wrong_names = 0, []
    for k in truth.keypoints:
        if k.state in {"visible", "shadowed", "eclipsed", "saturated"} and k.pixel_px is not None:
            n_visible += 1
            u, v = (int(x) for x in np.rint(k.pixel_px))
            if not near[np.clip(v, 0, mask.shape[0] - 1), np.clip(u, 0, mask.shape[1] - 1)]:
                wrong_names.append(k.name)
    if mask.any() and len(wrong_names) > 3 and 2 * len(wrong_names) > n_visible:
        return [f"keypoints {', '.join(wrong_names)} are seen but lie off the mask"]
    return []


def check_box_3d(truth: Truth, target: Target) -> list[str]:
    """Check the bounding box of the mesh in three dimensions, and the projection of its corners."""
    if not truth.box_3d_target_m:
        return []
    positions = np.concatenate([part.positions_m for part in target.parts]).astype(float)
    corners = np.array(truth.box_3d_target_m)
    bits = np.arange(8)[:, None] >> np.array([2, 1, 0]) & 1
    expected = np.where(bits, positions.max(axis=0), positions.min(axis=0))
    if corners.shape != (8, 3) or not np.allclose(corners, expected, rtol=0, atol=1e-9):
        return ["box_3d_target_m is not the box about the mesh"]
    in_camera = corners @ matrix_from_quat(truth.q_camera_from_target_wxyz).T + truth.t_camera_from_target_m
    in_front = in_camera[:, 2] > 1e-9
    if len(truth.box_3d_px) != 8 or [p is not None for p in truth.box_3d_px] != list(in_front):
        return ["box_3d_px does not tell which corners are before the camera"]
    if not in_front.any():
        return []
    projected = project_with_opencv(
        truth.camera,
        corners[in_front],
        truth.q_camera_from_target_wxyz,
        np.asarray(truth.t_camera_from_target_m),
    )
    error = np.abs(projected - np.array([p for p in truth.box_3d_px if p is not None]))
    error[~in_lens(truth.camera, in_camera[in_front])] = 0
    # far off the axis pixel numbers are large, and so are their last digits
    if np.any(error > PIXEL_TOLERANCE_PX * np.maximum(1, np.abs(projected) / 1e3)):
        return [f"a corner of box_3d_px is {error.max():.3g} px from its projection"]
    return []


def differing_pixels(
    truth: Truth, mask: ByteArray, target: Target, origin_px: tuple[int, int] = (0, 0)
) -> IntArray:
    """Return (K, 2) mask pixels x, y that differ from the triangles filled on the CPU by more than an outline.

    Parameters
    ----------
    truth : Truth
        Truth record of the frame.
    mask : (H, W) array
        Mask of the target.
    target : Target
        Target model.
    origin_px : tuple of int, optional
        The mask's first pixel in the image (an amodal mask starts outside).
    """
    mesh = joined_mesh(target)
    R = matrix_from_quat(truth.q_camera_from_target_wxyz)
    t = np.asarray(truth.t_camera_from_target_m)
    if (mesh.positions_m @ R[2] + t[2]).min() <= 1e-3:  # a vertex behind the camera has no projection
        return np.zeros((0, 2), np.int64)

    def on_image(points_m: FloatArray) -> FloatArray:
        pixels = truth.camera.project(points_m @ R.T + t)
        return _rolling_shutter_pixels(truth, pixels, points_m) - origin_px

    corners_px, triangles = on_image(mesh.positions_m)[mesh.triangles], mesh.triangles
    front = silhouette_triangles(mesh, corners_px)
    corners_px, triangles = corners_px[front], triangles[front]
    if not truth.camera.distortion.is_none:
        corners_m = subdivide_for_lens(truth.camera, mesh.positions_m[triangles], R, t)
        corners_px = on_image(corners_m.reshape(-1, 3)).reshape(-1, 3, 2)
    inner, outer = filled_silhouette(corners_px, mask.shape)
    # most of the image is zero in all of them
    x, y, width, height = cv2.boundingRect(cv2.bitwise_or(mask, outer))
    window = np.s_[max(y - 1, 0) : y + height + 1, max(x - 1, 0) : x + width + 1]
    mask, inner, outer = mask[window], inner[window], outer[window]
    reach = np.ones((2 * OUTLINE_TOLERANCE_PX + 1,) * 2, np.uint8)
    extra = (mask > 0) & (np.asarray(cv2.dilate(outer, reach)) == 0)
    missing = (np.asarray(cv2.erode(inner, reach, borderValue=0)) > 0) & (mask == 0)
    first = np.array([window[1].start, window[0].start])
    return np.asarray(nonzero_pixels((extra | missing).view(np.uint8)) + first)


def silhouette_triangles(mesh: TriangleMesh, corners_px: FloatArray) -> BoolArray:
    """Return (M,) True for projected triangles (M, 3, 2) that contribute to the silhouette.

    Back faces of a closed shell are omitted, because its front faces cover the same pixels.
    """
    if mesh.in_shell is None:
        return np.ones(len(corners_px), bool)
    return np.asarray(~mesh.in_shell | (_twice_area(corners_px) <= 0))


def _twice_area(corners_px: FloatArray) -> FloatArray:
    """Return (M,) twice the area of triangles (M, 3, 2), negative if the corners are counter-clockwise in the image."""
    e1, e2 = corners_px[:, 1] - corners_px[:, 0], corners_px[:, 2] - corners_px[:, 0]
    return np.asarray(e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0])


def subdivide_for_lens(camera: Camera, corners_m: FloatArray, R: FloatArray, t_m: FloatArray) -> FloatArray:
    """Subdivide the target's triangles (M, 3, 3) until the lens bends none of their edges visibly.

    Parameters
    ----------
    camera : Camera
        Camera of the image.
    corners_m : (M, 3, 3) array
        Triangles in the camera frame [m].
    R : (3, 3) array
        Rotation from the target to the camera frame.
    t_m : (3,) array
        Translation from the target to the camera frame [m]; all triangles lie in front of the camera.
    """
    straight = []
    for _ in range(8):
        middles_m = (corners_m + np.roll(corners_m, -1, axis=1)) / 2
        ends, between = (camera.project(points @ R.T + t_m) for points in (corners_m, middles_m))
        edges, offset = np.roll(ends, -1, axis=1) - ends, between - ends
        cross_product = np.abs(edges[..., 0] * offset[..., 1] - edges[..., 1] * offset[..., 0])
        is_bent = np.any(cross_product > MAX_EDGE_SAG_PX * np.hypot(edges[..., 0], edges[..., 1]), axis=1)
        straight.append(corners_m[~is_bent])
        if not is_bent.any():
            break
        (a, b, c), (ab, bc, ca) = corners_m[is_bent].swapaxes(0, 1), middles_m[is_bent].swapaxes(0, 1)
        corners_m = np.concatenate(
            [np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    else:
        straight.append(corners_m)
    return np.concatenate(straight)


def _rolling_shutter_pixels(truth: Truth, pixels: FloatArray, positions_m: FloatArray) -> FloatArray:
    """Return the pixels of points under a rolling shutter: each is projected at the read-out time of its own row."""
    if len(truth.row_poses) < 2:
        return pixels
    first, last = truth.row_poses[0], truth.row_poses[-1]
    ends = [
        project_with_opencv(
            truth.camera, positions_m, pose.q_camera_from_target_wxyz, np.asarray(pose.t_camera_from_target_m)
        )
        for pose in (first, last)
    ]
    per_row = (ends[1] - ends[0]) / (last.row_px - first.row_px)
    middle = (truth.camera.height_px - 1) / 2
    row = (pixels[:, 1] - per_row[:, 1] * middle) / (1 - per_row[:, 1])
    row = np.clip(row, -0.5, truth.camera.height_px - 0.5)
    return np.asarray(pixels + per_row * (row - middle)[:, None])


def filled_silhouette(corners_px: FloatArray, shape: tuple[int, ...]) -> tuple[ByteArray, ByteArray]:
    """Fill projected triangles (M, 3, 2) on a grid FILL_SCALE times finer; return an inner and an outer mask.

    OpenCV also fills the pixels that a border only touches, which closes gaps narrower than a fine pixel. The outer
    mask keeps this result. The inner mask is eroded by one fine pixel, which opens the gaps again.
    """
    height, width = shape
    low = np.clip(np.floor(corners_px.min(axis=(0, 1))) - 4, 0, (width, height)).astype(int)
    high = np.clip(np.ceil(corners_px.max(axis=(0, 1))) + 5, 0, (width, height)).astype(int)
    inner, outer = np.zeros((2, height, width), np.uint8)
    if np.any(high <= low):
        return inner, outer
    fine = np.zeros(((high[1] - low[1]) * FILL_SCALE, (high[0] - low[0]) * FILL_SCALE), np.uint8)
    # a coarse pixel's centre is at (FILL_SCALE - 1) / 2 on the finer grid
    corners = (corners_px - low) * FILL_SCALE + (FILL_SCALE - 1) / 2
    fill_triangles(fine, corners)
    size = (int(high[0] - low[0]), int(high[1] - low[1]))
    eroded = cv2.erode(fine, np.ones((3, 3), np.uint8))
    for bound, grid, share in ((inner, eroded, INNER_COVERAGE), (outer, fine, OUTER_COVERAGE)):
        coarse = cv2.resize(grid, size, interpolation=cv2.INTER_AREA)
        bound[low[1] : high[1], low[0] : high[0]] = np.where(
            coarse >= 255 * share, np.uint8(255), np.uint8(0)
        )
    return inner, outer
