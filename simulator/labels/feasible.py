"""Whether a frame can be solved at all: enough of the silhouette inside, enough wireframe above the noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from simulator.camera.develop import noise_sigma

if TYPE_CHECKING:
    from collections.abc import Iterable

    from simulator.arrays import Float32Array, FloatArray
    from simulator.camera.model import Camera
    from simulator.labels.wireframe import EdgeView
    from simulator.scene.state import SceneState

SILHOUETTE_SHARE = 0.9
STEP_SHARE = 0.4
SAMPLE_SPACING_PX = 4.0
STEP_REACH_PX = 2.0


def visible_samples(views: Iterable[EdgeView], camera: Camera) -> tuple[FloatArray, FloatArray]:
    """Points on the visible wireframe inside the image, about every four pixels.

    Returns
    -------
    pixels (S, 2), and the edge's normal in the image at each (S, 2).
    """
    pixels, normals = [], []
    for view in views:
        length = view.length_px
        if length < 1.0:
            continue
        direction = (view.ends_px[1] - view.ends_px[0]) / length
        for a, b in view.stretches:
            n = max(round((b - a) * length / SAMPLE_SPACING_PX), 1)
            points = view.at(a + (np.arange(n) + 0.5) / n * (b - a))
            points = points[camera.contains(points)]
            pixels.append(points)
            normals.append(np.broadcast_to([-direction[1], direction[0]], points.shape))
    if not pixels:
        return np.empty((0, 2)), np.empty((0, 2))
    return np.concatenate(pixels), np.concatenate(normals)


def wireframe_step_share(scene: SceneState, views: Iterable[EdgeView], signal: Float32Array) -> float:
    """Share of the visible wireframe's length whose step in the noise-free image reaches one sigma.

    Parameters
    ----------
    views : the target's edges as the camera sees them.
    signal : (H, W) noise-free signal, 1 at full scale.

    Returns
    -------
    0..1; 0 when no edge is visible.
    """
    pixels, normals = visible_samples(views, scene.camera)
    if len(pixels) == 0:
        return 0.0
    clipped = np.clip(signal, 0, 1)
    reach = STEP_REACH_PX * normals
    left, right = (_sample(clipped, pixels + sign * reach) for sign in (-1, 1))
    step = np.abs(right - left)
    sigma = noise_sigma(scene.sensor, float(clipped.mean()), scene.exposure_s)
    return float(np.mean(step >= sigma))


def _sample(image: Float32Array, pixels: FloatArray) -> FloatArray:
    """Bilinear values of an image at pixel positions (S, 2)."""
    x, y = (pixels[:, k].astype(np.float32).reshape(-1, 1) for k in (0, 1))
    values = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(values, float).ravel()
