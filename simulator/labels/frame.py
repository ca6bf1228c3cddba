"""One frame: scene -> radiance -> detector -> image, with its truth from the same instant."""

from __future__ import annotations

import hashlib
import time
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import TYPE_CHECKING

import numpy as np

from simulator.arrays import ByteArray, Float32Array
from simulator.camera.develop import digitise, expose
from simulator.labels.feasible import SILHOUETTE_SHARE, STEP_SHARE, wireframe_step_share
from simulator.labels.keypoints import label_keypoints
from simulator.labels.occlusion import mesh_of
from simulator.labels.truth import Box, InfeasibleReason, Software, Truth
from simulator.scene.bands import sunlight_balance

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from simulator.render.renderer import Rendered, Renderer
    from simulator.scene.state import SceneState
    from simulator.targets.model import Target

# A pixel belongs to the target when at least half of it is covered.
MASK_COVERAGE = 0.5
TOO_FAR_PX = 40.0


@dataclass(frozen=True, eq=False)
class Frame:
    """What a sink receives.

    Parameters
    ----------
    scene : the snapshot that was drawn.
    image : (H, W) or (H, W, 3) digital numbers, RGB order.
    radiance : linear band radiance before the detector [W m-2 sr-1].
    truth : the label record, or None when labels were not asked for.
    mask : (H, W) uint8, 255 on the target, or None. depth_m : (H, W) camera z, NaN outside, or None.
    stage_ms : wall time of each stage: the frame's ledger.
    """

    scene: SceneState
    image: NDArray[np.unsignedinteger]
    radiance: Float32Array
    truth: Truth | None = None
    mask: ByteArray | None = None
    depth_m: Float32Array | None = None
    stage_ms: dict[str, float] = field(default_factory=dict)


def take_frame(renderer: Renderer, scene: SceneState, target: Target, *, labels: bool = True) -> Frame:
    """Draw, expose, digitise and label one scene. A pure function of the scene and the target."""
    start = time.perf_counter()
    rendered = renderer.render(scene, target, labels=labels)
    drawn = time.perf_counter()
    signal = expose(rendered.radiance, scene.sensor, scene.exposure_s, sunlight_balance(scene.bands))
    image = digitise(signal, scene.sensor, scene.seed, scene.frame_index)
    developed = time.perf_counter()
    stage_ms = {"render": (drawn - start) * 1e3, "sensor": (developed - drawn) * 1e3}
    stage_ms.update({f"render.{name}": ms for name, ms in rendered.stage_ms.items()})
    if not labels:
        return Frame(scene, image, rendered.radiance, stage_ms=stage_ms)
    mono = signal if signal.ndim == 2 else signal.mean(axis=2)
    if rendered.coverage is None:
        raise RuntimeError("the renderer was asked for labels and gave no coverage")
    mask = np.where(rendered.coverage >= MASK_COVERAGE, np.uint8(255), np.uint8(0))
    truth = label_frame(renderer, scene, target, rendered, mono, image, mask)
    stage_ms["labels"] = (time.perf_counter() - developed) * 1e3
    return Frame(scene, image, rendered.radiance, truth, mask, rendered.depth_m, stage_ms)


def label_frame(
    renderer: Renderer,
    scene: SceneState,
    target: Target,
    rendered: Rendered,
    signal: Float32Array,
    image: NDArray[np.unsignedinteger],
    mask: ByteArray,
) -> Truth:
    """The truth record of a drawn scene.

    Parameters
    ----------
    signal : (H, W) noise-free signal, 1 at full scale.
    image : what the detector gives. mask : (H, W) 0 or 255.
    """
    share = wireframe_step_share(scene, target, mesh_of(target), signal)
    amodal = amodal_box(scene, target)
    reason = infeasible_reason(float(rendered.silhouette_inside), share, amodal)
    return Truth(
        epoch_utc=scene.epoch_utc,
        t_s=scene.t_s,
        frame_index=scene.frame_index,
        seed=scene.seed,
        q_camera_from_target_wxyz=scene.q_camera_from_target_wxyz,
        t_camera_from_target_m=scene.t_camera_from_target_m,
        camera=scene.camera,
        keypoints=label_keypoints(scene, target, mesh_of(target), signal),
        box_px=mask_box(mask),
        box_amodal_px=amodal,
        sun_direction_camera=scene.sun_direction_camera,
        sun_visible_fraction=scene.sun_visible_fraction,
        feasible=reason == "",
        infeasible_reason=reason,
        silhouette_inside=float(rendered.silhouette_inside),
        wireframe_step_share=share,
        image_sha256=pixel_hash(image),
        mask_sha256=pixel_hash(mask),
        scene=scene,
        software=Software(flyaround=version("flyaround"), gl_renderer=renderer.info.renderer),
    )


def infeasible_reason(silhouette_inside: float, step_share: float, amodal: Box | None) -> InfeasibleReason:
    """Why a frame cannot be solved, or nothing: cropped first, then dark or, for a small target, too far."""
    if silhouette_inside < SILHOUETTE_SHARE:
        return "cropped"
    if step_share >= STEP_SHARE:
        return ""
    small = amodal is not None and max(amodal[2] - amodal[0], amodal[3] - amodal[1]) < TOO_FAR_PX
    return "too_far" if small else "dark"


def pixel_hash(image: NDArray[np.unsignedinteger]) -> str:
    """SHA-256 of an image's pixels, whatever file they are kept in."""
    return hashlib.sha256(np.ascontiguousarray(image).data).hexdigest()


def mask_box(mask: ByteArray) -> Box | None:
    """x0 y0 x1 y1 of a mask at pixel edges: a one-pixel mask at (3, 4) gives 2.5 3.5 3.5 4.5."""
    columns = np.flatnonzero(mask.any(axis=0))
    rows = np.flatnonzero(mask.any(axis=1))
    if columns.size == 0:
        return None
    return (
        float(columns[0]) - 0.5,
        float(rows[0]) - 0.5,
        float(columns[-1]) + 0.5,
        float(rows[-1]) + 0.5,
    )


def amodal_box(scene: SceneState, target: Target) -> Box | None:
    """Bounds of all projected vertices, not clipped to the image; None when part is behind the camera."""
    in_camera = scene.camera_from_target.apply(mesh_of(target).positions_m)
    if in_camera[:, 2].min() <= 1e-3:
        return None
    pixels = scene.camera.project(in_camera)
    x0, y0 = pixels.min(axis=0)
    x1, y1 = pixels.max(axis=0)
    return (float(x0), float(y0), float(x1), float(y1))
