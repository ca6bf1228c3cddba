"""Keypoint labels: pixel position and the first reason why the point is not visible, if any."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.geometry.mesh import TriangleMesh
from flyaround.simulator.imaging.image_formation import noise_sigma
from flyaround.simulator.imaging.rolling_shutter import pose_at_rows
from flyaround.simulator.labels.truth import KeypointLabel, KeypointState
from flyaround.simulator.labels.visibility import hidden_from_direction, occluded_from_camera

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray, IntArray
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

# Visible share of the Sun's disc below which direct light is below the noise of every sensor preset.
ECLIPSE_THRESHOLD = 0.02

# Half side of the neighbourhood in which a keypoint's contrast is measured [px].
CONTRAST_RADIUS_PX = 2


def label_keypoints(
    scene: SceneState, target: Target, mesh: TriangleMesh, signal: Float32Array
) -> tuple[KeypointLabel, ...]:
    """Label all keypoints of a target.

    Parameters
    ----------
    scene : SceneState
        The frame's snapshot.
    target : Target
        Model of the target.
    mesh : TriangleMesh
        All triangles of ``target``.
    signal : (H, W) array
        Noise-free signal, 1 at full scale, not clipped.

    Returns
    -------
    tuple of KeypointLabel
        One label per keypoint; ``state`` is the first that applies of out_of_frame, self_occluded, eclipsed, shadowed,
        saturated, below_noise, visible.
    """
    scenes = keypoint_scenes(scene, target)
    pixels = project_keypoints(scenes, target)
    labels = []
    for keypoint, pixel, geometric in zip(
        target.keypoints, pixels, geometric_states(scene, target, mesh, scenes), strict=True
    ):
        state = geometric or radiometric_state(scene, pixel, signal)
        labels.append(
            KeypointLabel(
                name=keypoint.name,
                target_m=keypoint.position_m,
                pixel_px=pixel_or_none(pixel),
                state=state,
            )
        )
    return tuple(labels)


def pixel_or_none(pixel: FloatArray) -> tuple[float, float] | None:
    """Convert a projected point to the pixel position of a record.

    Returns
    -------
    tuple of float or None
        Column and row [px], also outside the image; None behind the camera, where the projection is NaN.
    """
    return (float(pixel[0]), float(pixel[1])) if np.isfinite(pixel).all() else None


def keypoint_scenes(scene: SceneState, target: Target) -> tuple[SceneState, ...]:
    """Return the scene of each keypoint: under a rolling shutter, at the time of its row."""
    return pose_at_rows(scene, _positions(target))


def project_keypoints(scenes: Sequence[SceneState], target: Target) -> FloatArray:
    """Project a target's keypoints to pixels (K, 2), each in its own scene; NaN behind the camera."""
    points = _positions(target)
    pixels = np.full((len(points), 2), np.nan)
    for scene, indices in _by_scene(scenes):
        pixels[indices] = scene.camera.project(scene.camera_from_target.apply(points[indices]))
    return pixels


def _positions(target: Target) -> FloatArray:
    return np.array([k.position_m for k in target.keypoints], float).reshape(-1, 3)


def _by_scene(scenes: Sequence[SceneState]) -> Iterator[tuple[SceneState, IntArray]]:
    """Yield each distinct scene (by identity) and its indices."""
    for scene in {id(s): s for s in scenes}.values():
        yield scene, np.flatnonzero([s is scene for s in scenes])


def geometric_states(
    scene: SceneState, target: Target, mesh: TriangleMesh, scenes: Sequence[SceneState] | None = None
) -> tuple[KeypointState | None, ...]:
    """Return the geometric state of each keypoint; None if it is lit and unoccluded, so that the image decides.

    Parameters
    ----------
    scene : SceneState
        Scene at mid-exposure.
    target : Target
        Target model.
    mesh : TriangleMesh
        Mesh of the target.
    scenes : sequence of SceneState, optional
        Result of `keypoint_scenes`, if already known.
    """
    scenes = keypoint_scenes(scene, target) if scenes is None else scenes
    pose = scene.camera_from_target
    points = _positions(target)
    inside = scene.camera.contains(project_keypoints(scenes, target))
    occluded = np.ones(len(points), bool)
    for row_scene, indices in _by_scene(scenes):
        in_image, camera_pose = indices[inside[indices]], row_scene.camera_from_target
        if in_image.size:
            occluded[in_image] = occluded_from_camera(mesh, points[in_image], camera_pose)
    shadowed = np.zeros(len(points), bool)
    if not scene.has_lamps and scene.sunlit_fraction >= ECLIPSE_THRESHOLD:
        candidates = np.flatnonzero(inside & ~occluded)
        to_sun = pose.R.T @ np.asarray(scene.sun_direction_camera)
        shadowed[candidates] = hidden_from_direction(mesh, points[candidates], to_sun)
    states: list[KeypointState | None] = []
    for k in range(len(points)):
        if not inside[k]:
            states.append("out_of_frame")
        elif occluded[k]:
            states.append("self_occluded")
        elif scene.has_lamps:  # a lamp at the camera illuminates every surface that the camera sees
            states.append(None)
        elif scene.sunlit_fraction < ECLIPSE_THRESHOLD:
            states.append("eclipsed")
        else:
            states.append("shadowed" if shadowed[k] else None)
    return tuple(states)


def radiometric_state(scene: SceneState, pixel: np.ndarray, signal: Float32Array) -> KeypointState:
    """Return the state of an unoccluded keypoint in the noise-free image: saturated, below_noise or visible.

    Parameters
    ----------
    scene : SceneState
        Scene at mid-exposure.
    pixel : (2,) array
        Projection.
    signal : (H, W) array
        Noise-free image, 1 at full scale.
    """
    u, v = (int(x) for x in np.rint(pixel))
    r = CONTRAST_RADIUS_PX
    patch = signal[max(v - r, 0) : v + r + 1, max(u - r, 0) : u + r + 1]
    if float(patch.min()) >= 1.0:
        return "saturated"
    clipped = np.clip(patch, 0, 1)
    if float(clipped.max() - clipped.min()) < noise_sigma(
        scene.sensor, float(clipped.mean()), scene.exposure_s
    ):
        return "below_noise"
    return "visible"
