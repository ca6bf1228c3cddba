"""Search for a rendered view that is similar to a reference image.

Candidates are samples of the evaluation recipes, drawn at a small size. The candidate with the most similar histogram
and, if a pose is available, the most similar appearance of the craft is drawn at full size.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.compare.image_statistics import histogram_distance_dn, image_statistics, noise_dn
from flyaround.simulator.compare.references import resize_camera
from flyaround.simulator.imaging.image_formation import expose_scene
from flyaround.simulator.labels.boxes import amodal_box
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.scenario.poses import scene_with_pose

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.camera.detector.sensor import Sensor
    from flyaround.simulator.compare.references import Reference
    from flyaround.simulator.render.renderer import Renderer
    from flyaround.simulator.runtime.arrays import ByteArray, Float32Array
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target
    from flyaround.simulator.world.frames.pose import Pose

SMALL_PX = 240  # width of a candidate
CANDIDATES = 24  # views that are drawn for each reference
RECIPES = {True: "eval-black", False: "eval-earth"}  # recipe for a background of space, and of Earth
HISTOGRAM_DN = 32.0  # histogram distance that counts as much as a completely different craft
BRIGHT_PERCENT = 99.0  # percentile matched to the reference's by exposure
CLIPPED_DN = 250.0  # above this, values may be clipped
MIN_POSE_LIKENESS = 0.5  # likeness above which an uncertain pose is preferred to other views

# Range of the fitted exposure time [s].
MIN_EXPOSURE_S, MAX_EXPOSURE_S = 1e-6, 10.0


@dataclass(frozen=True)
class PoseEstimate:
    """Camera-from-target pose in a reference; if not ``sure``, it competes with other views by appearance."""

    pose: Pose
    sure: bool


@dataclass(frozen=True, eq=False)
class SimilarView:
    """Our counterpart of a reference.

    Parameters
    ----------
    scene : SceneState
        Scene at the reference's size and exposure.
    same_view : bool
        True if it has the reference's pose.
    likeness : float or None
        Correlation of the two images over the craft's box, small and blurred; None without a pose.
    """

    scene: SceneState
    same_view: bool
    likeness: float | None


def find_similar_view(
    renderer: Renderer,
    reference: Reference,
    target: Target,
    estimate: PoseEstimate | None,
    *,
    sensor: str | None = None,
    seed: int = 0,
) -> SimilarView:
    """Return the candidate view nearest to a reference.

    Parameters
    ----------
    renderer : Renderer
        Renderer of the images.
    reference : Reference
        Reference image.
    target : Target
        Target model.
    estimate : PoseEstimate or None
        Pose of the craft; without it, attitude and position are the candidates'.
    sensor : str, optional
        Preset for our image; by default, one as noisy as the reference.
    seed : int, optional
        Seed of the candidates.
    """
    space = image_statistics(reference.image).space
    plan = plan_recipe(RECIPES[space], CANDIDATES, seed=seed, quality="draft")
    small_camera = resize_camera(
        reference.camera, SMALL_PX, round(SMALL_PX * reference.camera.height_px / reference.camera.width_px)
    )
    plan = replace(plan, camera=small_camera, target=target)
    size = small_camera.width_px, small_camera.height_px
    small_reference = np.asarray(cv2.resize(reference.image, size, interpolation=cv2.INTER_AREA), np.uint8)
    ranked: list[tuple[float, SceneState, float | None]] = []
    for k in range(CANDIDATES):
        sample = plan.scene(k)
        for pose in _poses(estimate):
            scene = sample if pose is None else scene_with_pose(sample, target, pose, k)
            radiance = renderer.render(scene, target).radiance
            scene = matched_exposure(scene, radiance, reference.image)
            preview = np.clip(expose_scene(scene, radiance) * 255, 0, 255).astype(np.uint8)
            distance = (
                histogram_distance_dn(_histogram(preview), _histogram(small_reference), 256) / HISTOGRAM_DN
            )
            likeness = None if pose is None else _likeness(scene, target, preview, small_reference)
            score = distance + 1 - (MIN_POSE_LIKENESS if likeness is None else likeness)
            ranked.append((score, scene, likeness))
    _, scene, likeness = min(ranked, key=lambda r: r[0])
    scene = replace(
        scene,
        camera=reference.camera,
        quality="default",
        sensor=sensor_as_noisy_as(reference.image) if sensor is None else sensor_preset(sensor),
    )
    return SimilarView(scene, likeness is not None, likeness)


def sensor_as_noisy_as(image: ByteArray) -> Sensor:
    """Return SPEED's sensor with the Gaussian noise measured in an image."""
    return replace(sensor_preset("speed"), gaussian_variance=(noise_dn(image) / 255) ** 2)


def _poses(estimate: PoseEstimate | None) -> tuple[Pose | None, ...]:
    if estimate is None:
        return (None,)
    return (estimate.pose,) if estimate.sure else (estimate.pose, None)


def matched_exposure(scene: SceneState, radiance: Float32Array, image: ByteArray) -> SceneState:
    """Return the scene with the exposure that matches its bright end to the image's, above the black level."""
    black, bright = np.percentile(image, (1.0, BRIGHT_PERCENT))
    bright_end = (min(float(bright), CLIPPED_DN) - min(float(black), 64.0)) / 255
    rendered_end = float(
        np.percentile(expose_scene(replace(scene, exposure_s=1.0), radiance), BRIGHT_PERCENT)
    )
    if rendered_end <= 0 or bright_end <= 0:
        return scene
    return replace(
        scene, exposure_s=float(np.clip(bright_end / rendered_end, MIN_EXPOSURE_S, MAX_EXPOSURE_S))
    )


def _histogram(image: ByteArray) -> NDArray[np.float64]:
    return np.bincount(image.ravel(), minlength=256) / image.size


def _likeness(scene: SceneState, target: Target, rendered: ByteArray, reference: ByteArray) -> float:
    box = amodal_box(scene, target)
    if box is None:
        return 0.0
    x0, y0 = (max(int(v) - 3, 0) for v in box[:2])
    x1, y1 = (int(np.ceil(v)) + 3 for v in box[2:])
    patches = [
        cv2.GaussianBlur(image.astype(np.float32), (0, 0), 1.5)[y0:y1, x0:x1].ravel()
        for image in (rendered, reference)
    ]
    # a correlation of few or equal values says nothing
    if patches[0].size < 16 or min(c.std() for c in patches) < 1e-3:
        return 0.0
    return float(np.corrcoef(patches[0], patches[1])[0, 1])
