"""Image regions, cut out and undistorted for comparison with the rendered target."""

from __future__ import annotations

from typing import Tuple

import cv2
import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.camera import CameraIntrinsics, undistorted_rays
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.image.edge_field import shrink
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget

Array = np.ndarray
Box = Tuple[int, int, int, int]

# Rendered pixels per patch pixel, in each direction.
OVERSAMPLING = 2

# Model error of the synthetic view as a share of full scale. It bounds the noise from below; without it, bright images
# would reject every pose.
MODEL_ERROR_SHARE = 0.02

# Distortion is smooth, so it is evaluated at every eighth pixel and interpolated; margin around the box [px].
DISTORTION_STEP_PX, DISTORTION_MARGIN_PX = 8, 16


def cut_patch(target: PreparedTarget, frame: Observation, box: Box, longest_px: int) -> ImagePatch:
    """Cut a region of the image as a pinhole camera would show it.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    frame : Observation
        Image with its noise and background.
    box : tuple of int
        Region: x0, y0, x1, y1 in the pixels of ``target.camera.pinhole``.
    longest_px : int
        Longest side of the patch.

    Returns
    -------
    ImagePatch
        Region reduced by area averaging, float32, undistorted if the camera has distortion.
    """
    if target.camera.distorted:
        # most boxes lie within the first one of their region
        kept = next((k for k in frame.undistorted if _contains(k[0], box)), None)
        if kept is None:
            kept = (box, undistort(frame.image, target.camera, box))
            frame.undistorted.append(kept)
        (left, top, _, _), image = kept
        gray, factor = shrink(image, box[0] - left, box[1] - top, box[2] - left, box[3] - top, longest_px)
        limits = box[2:]
    else:
        gray, factor = shrink(frame.image, *box, longest_px)
        limits = frame.image.shape[1::-1]
    full_scale = 255.0 if frame.image.dtype == np.uint8 else float(frame.image.max())
    background_level = frame.background if frame.background >= 0 else None
    h, w = gray.shape
    x_factor = (min(box[2], limits[0]) - box[0]) / w
    y_factor = (min(box[3], limits[1]) - box[1]) / h
    sigma = max(frame.noise, MODEL_ERROR_SHARE * full_scale) / factor
    return ImagePatch(
        gray,
        sigma,
        float(box[0]),
        float(box[1]),
        x_factor,
        OVERSAMPLING,
        full_scale,
        background_level,
        y_factor / x_factor,
        sun=frame.sun_camera,
    )


def undistort(image: Array, camera: CameraIntrinsics, box: Box) -> Array:
    """Return the region (h, w) of the pinhole camera's image; black outside the original image."""
    w, h = box[2] - box[0], box[3] - box[1]
    x = box[0] + (np.arange(-DISTORTION_STEP_PX, w + DISTORTION_MARGIN_PX, DISTORTION_STEP_PX) - camera.cx_px)
    y = box[1] + (np.arange(-DISTORTION_STEP_PX, h + DISTORTION_MARGIN_PX, DISTORTION_STEP_PX) - camera.cy_px)
    u, v = np.meshgrid(x / camera.fx_px, y / camera.fy_px)
    distorted_u, distorted_v = camera.distort(u, v)
    pixels = np.stack(
        [distorted_u * camera.fx_px + camera.cx_px, distorted_v * camera.fy_px + camera.cy_px], axis=-1
    )
    grid_from_pixel = np.array([[1 / DISTORTION_STEP_PX, 0.0, 1.0], [0.0, 1 / DISTORTION_STEP_PX, 1.0]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    sources = cv2.warpAffine(pixels.astype(np.float32), grid_from_pixel, (w, h), flags=flags)
    # OpenCV takes both coordinates in one array, which its annotations do not say
    pixel = cv2.remap(image, sources, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)  # type: ignore[call-overload]
    return np.asarray(pixel)


def _contains(outer: Box, inner: Box) -> bool:
    """Return True if ``inner`` lies within ``outer``."""
    return outer[0] <= inner[0] and outer[1] <= inner[1] and outer[2] >= inner[2] and outer[3] >= inner[3]


def pinhole_box(camera: CameraIntrinsics, box: Box) -> Box:
    """Return the bounding box, in pixels of the pinhole, of a box of the image."""
    if not camera.distorted:
        return box
    s = np.linspace(0.0, 1.0, 9)
    x, y = box[0] + s * (box[2] - box[0]), box[1] + s * (box[3] - box[1])
    rim = [(a, b) for a in x for b in (y[0], y[-1])] + [(a, b) for a in (x[0], x[-1]) for b in y]
    rays = undistorted_rays(camera, np.array(rim))
    p = rays * (camera.fx_px, camera.fy_px) + (camera.cx_px, camera.cy_px)
    p = p[np.isfinite(p).all(axis=1)]
    # a fisheye's pinhole image is unbounded: keep about twice the image's size
    size = np.array([camera.width_px, camera.height_px])
    low, high = (
        np.clip(p.min(axis=0), -0.5 * size, 1.5 * size),
        np.clip(p.max(axis=0), -0.5 * size, 1.5 * size),
    )
    return int(low[0]), int(low[1]), int(max(high[0], low[0] + 32)), int(max(high[1], low[1] + 32))


def target_box(target: PreparedTarget, q: Array, t: Array) -> Box:
    """Return the bounding box of the target at a pose, with a margin.

    Returns
    -------
    tuple of int
        Box x0, y0, x1, y1 in pixels of the pinhole's image, without column x1 and row y1. It is at least 32 pixels wide
        and high, and clipped to the view of the camera.
    """
    camera = target.camera
    p = camera.pinhole.pixels(target.model.ends_m @ quat.matrix(q).T + t)
    (x0, y0), (x1, y1) = p.min(axis=0), p.max(axis=0)
    m = 8 + 0.06 * max(x1 - x0, y1 - y0)
    a, b, c, d = pinhole_box(camera, (0, 0, camera.width_px, camera.height_px))
    left, top = int(np.clip(x0 - m, a, c - 32)), int(np.clip(y0 - m, b, d - 32))
    return left, top, int(np.clip(x1 + m, left + 32, c)), int(np.clip(y1 + m, top + 32, d))
