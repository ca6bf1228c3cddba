"""Keypoint labels: pixel position and the first reason why the point cannot be used, if any."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from simulator.camera.develop import noise_sigma
from simulator.labels.occlusion import Mesh, hidden_from_direction, occluded_from_camera
from simulator.labels.truth import KeypointLabel, KeypointState

if TYPE_CHECKING:
    from simulator.arrays import Float32Array, FloatArray
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
    pixels = project_keypoints(scene, target)
    labels = []
    for keypoint, pixel, geometric in zip(
        target.keypoints, pixels, geometric_states(scene, target, mesh), strict=True
    ):
        state = geometric or _radiometric_state(scene, pixel, signal)
        place = (float(pixel[0]), float(pixel[1])) if np.isfinite(pixel).all() else None
        labels.append(
            KeypointLabel(name=keypoint.name, target_m=keypoint.position_m, pixel_px=place, state=state)
        )
    return tuple(labels)


def project_keypoints(scene: SceneState, target: Target) -> FloatArray:
    """Pixels (K, 2) of a target's keypoints, NaN behind the camera."""
    points = np.array([k.position_m for k in target.keypoints], float).reshape(-1, 3)
    return scene.camera.project(scene.camera_from_target.apply(points))


def geometric_states(scene: SceneState, target: Target, mesh: Mesh) -> tuple[KeypointState | None, ...]:
    """State of each keypoint by geometry alone; None where it is lit and in sight, and the picture decides."""
    pose = scene.camera_from_target
    points = np.array([k.position_m for k in target.keypoints], float).reshape(-1, 3)
    inside = scene.camera.contains(project_keypoints(scene, target))
    occluded = np.ones(len(points), bool)
    occluded[inside] = occluded_from_camera(mesh, points[inside], pose.R, pose.t_m)
    shadowed = hidden_from_direction(mesh, points, pose.R.T @ np.asarray(scene.sun_direction_camera))
    states: list[KeypointState | None] = []
    for k in range(len(points)):
        if not inside[k]:
            states.append("out_of_frame")
        elif occluded[k]:
            states.append("self_occluded")
        elif scene.sun_visible_fraction < ECLIPSED_BELOW:
            states.append("eclipsed")
        else:
            states.append("shadowed" if shadowed[k] else None)
    return tuple(states)


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
