"""Feasibility of a frame: enough of the silhouette inside, enough wireframe above the noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.imaging.image_formation import noise_sigma
from flyaround.simulator.labels.wireframe import distort_pixels

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.labels.truth import Box, InfeasibleReason
    from flyaround.simulator.labels.wireframe import ProjectedEdge
    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray
    from flyaround.simulator.scene.state import SceneState

# Minimum share of the silhouette inside the image, and of the wireframe's length with a visible step: definitions of
# docs/labels.md, on which published figures depend.
SILHOUETTE_SHARE = 0.9
STEP_SHARE = 0.4

# Distance between samples along an edge [px].
SAMPLE_SPACING_PX = 4.0

# Distance to either side of an edge at which its step is measured [px].
STEP_OFFSET_PX = 2.0
TANGENT_STEP_PX = 0.5  # step along a curved edge to find its direction

# Longest side of the target's box below which a frame is too far away to be solved [px].
TOO_FAR_PX = 40.0


def visible_samples(views: Sequence[ProjectedEdge], camera: Camera) -> tuple[FloatArray, FloatArray]:
    """Return points on the visible wireframe inside the image, about every four pixels.

    Returns
    -------
    tuple of array
        Pixels (S, 2), and the edge's normal in the image at each (S, 2), exact for a distorted edge.
    """
    ends = np.array([view.ends_px for view in views]).reshape(-1, 2, 2)
    lengths = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    rows = [(k, a, b) for k in np.flatnonzero(lengths >= 1.0).tolist() for a, b in views[k].intervals]
    if not rows:
        return np.empty((0, 2)), np.empty((0, 2))
    edge_index = np.array([k for k, _, _ in rows])
    start, stop = np.array([(a, b) for _, a, b in rows]).T
    count = np.maximum(np.rint((stop - start) * lengths[edge_index] / SAMPLE_SPACING_PX), 1).astype(int)
    interval = np.repeat(np.arange(len(rows)), count)
    position = np.arange(len(interval)) - np.repeat(np.cumsum(count) - count, count)
    share = start[interval] + (position + 0.5) / count[interval] * (stop - start)[interval]
    straight = np.array([v.ends_px if v.straight_px is None else v.straight_px for v in views])[edge_index]
    tangent = (straight[:, 1] - straight[:, 0])[interval]
    pixels = straight[interval, 0] + share[:, None] * tangent
    tangent /= np.hypot(*tangent.T)[:, None]
    lens = views[0].lens
    if lens is not None:
        # the direction between ends far outside the image is not the tangent of a curved edge inside it
        before, after = (
            distort_pixels(lens, pixels + along * tangent) for along in (-TANGENT_STEP_PX, TANGENT_STEP_PX)
        )
        pixels, tangent = distort_pixels(lens, pixels), after - before
        tangent /= np.hypot(*tangent.T)[:, None]
    inside = camera.contains(pixels)
    return pixels[inside], np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)[inside]


def wireframe_step_share(
    scene: SceneState, views: Sequence[ProjectedEdge], signal: Float32Array, level: float
) -> float:
    """Return the share of the visible wireframe's length whose step in the noise-free image reaches one sigma.

    Parameters
    ----------
    scene : SceneState
        Scene at mid-exposure.
    views : sequence of ProjectedEdge
        Projected edges of the target.
    signal : (H, W) array
        Noise-free signal, 1 at full scale.
    level : float
        Mean of the signal from `mean_level`.

    Returns
    -------
    float
        0..1; 0 when no edge is visible.
    """
    pixels, normals = visible_samples(views, scene.camera)
    if len(pixels) == 0:
        return 0.0
    offset = STEP_OFFSET_PX * normals
    # the signal is needed around the samples only, in coordinates of that window
    height, width = signal.shape
    low = np.clip(np.floor(pixels.min(axis=0)) - 4, 0, [width - 1, height - 1]).astype(int)
    high = np.clip(np.ceil(pixels.max(axis=0)) + 5, low + 1, [width, height]).astype(int)
    clipped = np.clip(signal[low[1] : high[1], low[0] : high[0]], 0, 1)
    one_side, other_side = (_sample(clipped, pixels + sign * offset - low) for sign in (-1, 1))
    step = np.abs(other_side - one_side)
    sigma = noise_sigma(scene.sensor, level, scene.exposure_s)
    return float(np.mean(step >= sigma))


def mono_signal(signal: Float32Array) -> Float32Array:
    """Average the clipped bands of a signal.

    Returns
    -------
    (H, W) array
        Mean of the bands of a signal (H, W, 3), 0 to 1, float32; a single band is returned itself, not clipped.
    """
    if signal.ndim == 2:
        return signal
    return np.asarray(np.clip(signal, 0, 1).mean(axis=2), np.float32)


def mean_level(signal: Float32Array) -> float:
    """Return the mean of a signal (H, W), clipped to the detector's scale.

    OpenCV is used because it releases Python's global lock; this runs beside other threads.
    """
    low, high, _, _ = cv2.minMaxLoc(signal)
    clipped = signal if low >= 0 and high <= 1 else np.clip(signal, 0, 1)
    return float(cv2.mean(clipped)[0])


def _sample(image: Float32Array, pixels: FloatArray) -> FloatArray:
    """Interpolate an image bilinearly at pixel positions (S, 2)."""
    x, y = (pixels[:, k].astype(np.float32).reshape(-1, 1) for k in (0, 1))
    values = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(values, float).ravel()


def infeasible_reason(silhouette_inside: float, step_share: float, amodal: Box | None) -> InfeasibleReason:
    """Return why a frame is infeasible.

    Returns
    -------
    str
        ``cropped`` before all else, then ``too_far`` for a small craft or ``dark``; empty if the frame is feasible.
    """
    if silhouette_inside < SILHOUETTE_SHARE:
        return "cropped"
    if step_share >= STEP_SHARE:
        return ""
    small = amodal is not None and max(amodal[2] - amodal[0], amodal[3] - amodal[1]) < TOO_FAR_PX
    return "too_far" if small else "dark"
