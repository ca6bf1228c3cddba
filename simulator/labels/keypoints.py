"""Keypoint labels: pixel position and the first reason why the point cannot be used, if any."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from simulator.camera.develop import noise_sigma
from simulator.labels.occlusion import Mesh, hidden_from_direction, occluded_from_camera
from simulator.labels.truth import KeypointLabel, KeypointState

if TYPE_CHECKING:
    from simulator.arrays import Float32Array
    from simulator.scene.state import SceneState
    from simulator.targets.model import Target

# Below this share of the Sun's disc the direct light is under the noise of any recipe.
ECLIPSED_BELOW = 0.02
CONTRAST_RADIUS_PX = 2


def label_keypoints(
    scene: SceneState, target: Target, mesh: Mesh, signal: Float32Array
) -> tuple[KeypointLabel, ...]:
    """Labels of all keypoints of a target.

    Parameters
    ----------
    scene : the frame's snapshot.
    target, mesh : the model and its joined triangles.
    signal : (H, W) noise-free signal, 1 at full scale, not clipped.

    Returns
    -------
    One label per keypoint; ``state`` is the first that applies of out_of_frame, self_occluded, eclipsed,
    shadowed, saturated, below_noise, visible.
    """
    pose = scene.camera_from_target
    points = np.array([k.position_m for k in target.keypoints], float).reshape(-1, 3)
    in_camera = pose.apply(points)
    pixels = scene.camera.project(in_camera)
    inside = scene.camera.contains(pixels)
    occluded = np.ones(len(points), bool)
    front = in_camera[:, 2] > 0
    occluded[front] = occluded_from_camera(mesh, points[front], pose.R, pose.t_m)
    to_sun = pose.R.T @ np.asarray(scene.sun_direction_camera)
    shadowed = hidden_from_direction(mesh, points, to_sun)
    labels = []
    for k, keypoint in enumerate(target.keypoints):
        state: KeypointState
        if not inside[k]:
            state = "out_of_frame"
        elif occluded[k]:
            state = "self_occluded"
        elif scene.sun_visible_fraction < ECLIPSED_BELOW:
            state = "eclipsed"
        elif shadowed[k]:
            state = "shadowed"
        else:
            state = _radiometric_state(scene, pixels[k], signal)
        pixel = (float(pixels[k, 0]), float(pixels[k, 1])) if front[k] else None
        labels.append(
            KeypointLabel(name=keypoint.name, target_m=keypoint.position_m, pixel_px=pixel, state=state)
        )
    return tuple(labels)


def _radiometric_state(scene: SceneState, pixel: np.ndarray, signal: Float32Array) -> KeypointState:
    u, v = (int(x) for x in np.rint(pixel))
    r = CONTRAST_RADIUS_PX
    patch = signal[max(v - r, 0) : v + r + 1, max(u - r, 0) : u + r + 1]
    if float(patch.min()) >= 1.0:
        return "saturated"
    clipped = np.clip(patch, 0, 1)
    if float(clipped.max() - clipped.min()) < noise_sigma(scene.sensor, float(clipped.mean())):
        return "below_noise"
    return "visible"
