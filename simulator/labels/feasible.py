"""Whether a frame can be solved at all: enough of the silhouette inside, enough wireframe above the noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from simulator.camera.develop import noise_sigma

if TYPE_CHECKING:
    from simulator.arrays import BoolArray, Float32Array, FloatArray
    from simulator.scene.state import SceneState
    from simulator.targets.model import Target

SILHOUETTE_SHARE = 0.9
STEP_SHARE = 0.4
SAMPLE_SPACING_PX = 4.0
STEP_REACH_PX = 2.0
DEPTH_TOLERANCE_M = 0.01


def wireframe_samples(scene: SceneState, target: Target) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points along the edges that face the camera, about every four pixels.

    Returns
    -------
    pixels (S, 2), image normals (S, 2), camera depths (S,) [m].
    """
    pose = scene.camera_from_target
    camera_in_target = pose.inverse().t_m
    pixels, normals, depths = [], [], []
    for edge in target.wireframe:
        ends = np.array([edge.a_m, edge.b_m])
        if edge.normals:
            view = np.asarray(camera_in_target) - ends.mean(axis=0)
            if max(float(view @ np.asarray(n)) for n in edge.normals) <= 0:
                continue
        in_camera = pose.apply(ends)
        if in_camera[:, 2].min() < 0.05:
            continue
        a, b = scene.camera.project(in_camera)
        length = float(np.hypot(*(b - a)))
        if length < 1.0:
            continue
        n = max(int(length / SAMPLE_SPACING_PX), 1)
        s = (np.arange(n) + 0.5) / n
        points = in_camera[0] + s[:, None] * (in_camera[1] - in_camera[0])
        direction = (b - a) / length
        pixels.append(scene.camera.project(points))
        normals.append(np.broadcast_to([-direction[1], direction[0]], (n, 2)))
        depths.append(points[:, 2])
    if not pixels:
        return np.empty((0, 2)), np.empty((0, 2)), np.empty(0)
    return np.concatenate(pixels), np.concatenate(normals), np.concatenate(depths)


def visible_samples(pixels: FloatArray, depths_m: FloatArray, depth_map_m: Float32Array) -> BoolArray:
    """Which samples the rendered depth does not hide.

    A sample is seen when, in the 3 x 3 pixels around it, some depth is not nearer than its own (an edge
    lies between its own surface and the background).
    """
    height, width = depth_map_m.shape
    filled = np.where(np.isnan(depth_map_m), np.float32(1e9), depth_map_m)
    farthest = cv2.dilate(filled, np.ones((3, 3), np.uint8))
    u, v = np.rint(pixels).astype(int).T
    inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
    seen = np.zeros(len(pixels), bool)
    seen[inside] = farthest[v[inside], u[inside]] >= depths_m[inside] - DEPTH_TOLERANCE_M
    return seen


def wireframe_step_share(
    scene: SceneState, target: Target, depth_map_m: Float32Array, signal: Float32Array
) -> float:
    """Share of the visible wireframe's length whose step in the noise-free image reaches one sigma.

    Parameters
    ----------
    signal : (H, W) noise-free signal, 1 at full scale.

    Returns
    -------
    0..1; 0 when no edge is visible.
    """
    pixels, normals, depths = wireframe_samples(scene, target)
    seen = visible_samples(pixels, depths, depth_map_m)
    if not seen.any():
        return 0.0
    clipped = np.clip(signal, 0, 1)
    reach = STEP_REACH_PX * normals[seen]
    left, right = (_sample(clipped, pixels[seen] + sign * reach) for sign in (-1, 1))
    step = np.abs(right - left)
    sigma = noise_sigma(scene.sensor, float(clipped.mean()))
    return float(np.mean(step >= sigma))


def _sample(image: Float32Array, pixels: FloatArray) -> FloatArray:
    """Bilinear values of an image at pixel positions (S, 2)."""
    x, y = (pixels[:, k].astype(np.float32).reshape(-1, 1) for k in (0, 1))
    values = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(values, float).ravel()
