"""Re-verify every label of a data set from its files alone, by means that did not make them.

Pixels by ``cv2.projectPoints``, the pose by PnP on the exported keypoints, the mask against a silhouette
filled by OpenCV on the CPU, boxes against the mask, images against the camera, exports against the records.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from simulator.dataset.card import DatasetCard, read_card
from simulator.dataset.native import frame_paths, is_whole, read_png
from simulator.dataset.speed import FOLDER as SPEED_FOLDER
from simulator.errors import UserError
from simulator.labels.frame import amodal_box, infeasible_reason, mask_box, pixel_hash
from simulator.labels.keypoints import geometric_states
from simulator.labels.occlusion import mesh_of
from simulator.labels.truth import Truth, read_truth
from simulator.targets.library import load_target
from simulator.world.rotation import matrix_from_quat, quat_from_rotvec, rotation_angle_rad

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from simulator.arrays import ByteArray, FloatArray
    from simulator.targets.model import Target

# Exported pixels carry float64 through JSON: only rounding in the projection may differ.
PIXEL_TOLERANCE_PX = 1e-6
POSE_TOLERANCE_RAD = 1e-6
POSE_TOLERANCE_RELATIVE = 1e-6
# Both round coverage at one half, on different sample grids: the outline may differ by one pixel, never two.
OUTLINE_TOLERANCE_PX = 1
FILL_SCALE = 4
FILL_SHIFT = 4
# Between these shares of a pixel, five samples a pixel (draft quality) may round to either side of one half.
SURELY_COVERED, SURELY_TOUCHED = 0.9, 0.1


@dataclass(frozen=True)
class Fault:
    """One wrong label: which frame (None: the card), and what is wrong."""

    frame: int | None
    what: str


@dataclass(frozen=True)
class CheckReport:
    """Outcome of a check."""

    n_frames: int
    n_labels: int
    faults: tuple[Fault, ...]


def check_dataset(
    folder: Path, progress: Callable[[int, int], None] = lambda _done, _of: None
) -> CheckReport:
    """Check every frame of a data set.

    Raises
    ------
    UserError
        If the folder is not a data set.
    """
    card = read_card(folder)
    faults: list[Fault] = []
    target: Target | None = load_target(card.target.name)
    if target is not None and target.sha256 != card.target.sha256:
        faults.append(
            Fault(
                None,
                f"target {card.target.name} here is not the one drawn; masks were not compared",
            )
        )
        target = None
    frames = [k for k in range(card.n_frames) if is_whole(folder, k)]
    faults += _check_count(folder, card, len(frames))
    readable = []
    if card.complete:
        faults += [Fault(k, "files are missing") for k in range(card.n_frames) if not is_whole(folder, k)]
    n_labels = 0
    for done, k in enumerate(frames):
        try:
            truth = read_truth(frame_paths(folder, k).truth)
            image = read_png(frame_paths(folder, k).image)
            mask = read_png(frame_paths(folder, k).mask)
        except UserError as error:
            faults.append(Fault(k, str(error)))
            continue
        readable.append(k)
        found = check_frame(k, truth, image, np.asarray(mask, np.uint8), card, target)
        faults += [Fault(k, what) for what in found]
        n_labels += len(truth.keypoints) + 4
        progress(done + 1, len(frames))
    if (folder / SPEED_FOLDER).is_dir():
        faults += _check_speed(folder, readable)
    return CheckReport(len(frames), n_labels, tuple(faults))


def _check_count(folder: Path, card: DatasetCard, n_whole: int) -> list[Fault]:
    """The card's number of frames against the files."""
    faults = []
    surplus = [p.stem for p in (folder / "images").glob("*.json") if int(p.stem) >= card.n_frames]
    if surplus:
        faults.append(Fault(None, f"images/ holds {len(surplus)} frames beyond the card's {card.n_frames}"))
    if n_whole == 0:
        faults.append(Fault(None, "there is no whole frame to check"))
    return faults


def check_frame(
    k: int,
    truth: Truth,
    image: NDArray[np.unsignedinteger],
    mask: ByteArray,
    card: DatasetCard,
    target: Target | None,
) -> list[str]:
    """Everything wrong with frame k, a sentence each."""
    wrong: list[str] = []
    size = (truth.camera.height_px, truth.camera.width_px)
    if image.shape[:2] != size or mask.shape != size:
        return [f"image is {image.shape[:2]}, mask {mask.shape}, camera says {size}"]
    if truth.image_sha256 != pixel_hash(image):
        wrong.append("the image is not the one that the record describes")
    if truth.mask_sha256 != pixel_hash(mask):
        wrong.append("the mask is not the one that the record describes")
    wrong += _check_bookkeeping(k, truth, card)
    if truth.camera != card.camera:
        wrong.append("camera differs from the card's")
    if not np.isin(mask, (0, 255)).all():
        wrong.append("mask has values other than 0 and 255")
    if abs(float(np.linalg.norm(truth.q_camera_from_target_wxyz)) - 1) > 1e-9:
        wrong.append("quaternion is not of unit length")
    if truth.box_px != mask_box(mask):
        wrong.append(f"box_px {truth.box_px} is not the mask's {mask_box(mask)}")
    scene = truth.scene
    if (scene.q_camera_from_target_wxyz, scene.t_camera_from_target_m) != (
        truth.q_camera_from_target_wxyz,
        truth.t_camera_from_target_m,
    ):
        wrong.append("pose differs from the scene's")
    if not np.allclose(truth.sun_direction_camera, scene.sun_direction_camera, atol=1e-9):
        wrong.append("sun_direction_camera differs from the scene's Sun")
    wrong += _check_keypoints(truth, card)
    wrong += _check_visible_on_mask(truth, mask)
    if target is not None:
        wrong += _check_silhouette(truth, mask, target)
        wrong += _check_geometry(truth, target)
    return wrong


def _check_bookkeeping(k: int, truth: Truth, card: DatasetCard) -> list[str]:
    """What the record says twice, it says alike."""
    scene = truth.scene
    wrong: list[str] = []
    twice = ("epoch_utc", "t_s", "seed", "frame_index", "camera", "sun_visible_fraction")
    wrong += [
        f"{name} differs from the scene's" for name in twice if getattr(truth, name) != getattr(scene, name)
    ]
    if truth.frame_index != k:
        wrong.append(f"frame_index is {truth.frame_index} in the record of frame {k}")
    if truth.seed != card.seed:
        wrong.append(f"seed is {truth.seed}, the card's is {card.seed}")
    reason = infeasible_reason(truth.silhouette_inside, truth.wireframe_step_share, truth.box_amodal_px)
    if (truth.feasible, truth.infeasible_reason) != (reason == "", reason):
        wrong.append(
            f"feasible is {truth.feasible} ({truth.infeasible_reason or 'no reason'}), its shares say otherwise"
        )
    return wrong


def _check_geometry(truth: Truth, target: Target) -> list[str]:
    """The amodal box and the keypoints' geometric states, worked out again from the mesh."""
    wrong = []
    amodal = amodal_box(truth.scene, target)
    if (amodal is None) != (truth.box_amodal_px is None) or (
        amodal is not None and not np.allclose(amodal, truth.box_amodal_px or (), atol=PIXEL_TOLERANCE_PX)
    ):
        wrong.append(f"box_amodal_px {truth.box_amodal_px} is not the projected craft's {amodal}")
    states = geometric_states(truth.scene, target, mesh_of(target))
    for keypoint, state in zip(truth.keypoints, states, strict=False):
        by_picture = keypoint.state in {"visible", "saturated", "below_noise"}
        if (state is None) != by_picture or (state is not None and state != keypoint.state):
            wrong.append(
                f"keypoint {keypoint.name} is labelled {keypoint.state}, the mesh says {state or 'in sight'}"
            )
    return wrong


def _check_keypoints(truth: Truth, card: DatasetCard) -> list[str]:
    wrong = []
    known = card.target.keypoints
    if {k.name: tuple(k.target_m) for k in truth.keypoints} != {n: tuple(p) for n, p in known.items()}:
        wrong.append("keypoints differ from the card's")
    ahead = [k for k in truth.keypoints if k.pixel_px is not None]
    if len(ahead) < 4:
        return wrong
    points = np.array([k.target_m for k in ahead])
    pixels = np.array([k.pixel_px for k in ahead])
    R = matrix_from_quat(truth.q_camera_from_target_wxyz)
    t = np.asarray(truth.t_camera_from_target_m)
    distortion = np.array(truth.camera.distortion.coefficients or [0.0] * 5)
    projected, _ = cv2.projectPoints(points, cv2.Rodrigues(R)[0], t, truth.camera.K, distortion)
    error = float(np.abs(np.asarray(projected).reshape(-1, 2) - pixels).max())
    if not error <= PIXEL_TOLERANCE_PX:
        wrong.append(f"a keypoint is {error:.3g} px from its projection")
        return wrong
    # from the label itself as the start: the question is whether the pixels agree with the pose to 1e-6
    _, rotation, translation = cv2.solvePnP(
        points,
        pixels,
        truth.camera.K,
        distortion,
        cv2.Rodrigues(R)[0],
        t.reshape(3, 1).copy(),
        True,
        cv2.SOLVEPNP_ITERATIVE,
    )
    angle = rotation_angle_rad(
        quat_from_rotvec(np.asarray(rotation).ravel()), truth.q_camera_from_target_wxyz
    )
    shift = float(np.linalg.norm(np.asarray(translation).ravel() - t) / np.linalg.norm(t))
    if angle > POSE_TOLERANCE_RAD or shift > POSE_TOLERANCE_RELATIVE:
        wrong.append(f"pose from keypoints is off by {angle:.2g} rad and {shift:.2g} of the range")
    inside = truth.camera.contains(pixels)
    wrong += [
        f"keypoint {k.name} at {k.pixel_px} is labelled {k.state}"
        for k, is_inside in zip(ahead, inside, strict=True)
        if (k.state == "out_of_frame") == bool(is_inside)
    ]
    return wrong


def _check_visible_on_mask(truth: Truth, mask: ByteArray) -> list[str]:
    """A keypoint that is seen lies within 3 px of the mask (far rods cover less than half a pixel)."""
    near = cv2.dilate(mask, np.ones((7, 7), np.uint8))
    wrong = []
    for k in truth.keypoints:
        if k.state in {"visible", "shadowed", "eclipsed", "saturated"} and k.pixel_px is not None:
            u, v = (int(x) for x in np.rint(k.pixel_px))
            if not near[np.clip(v, 0, mask.shape[0] - 1), np.clip(u, 0, mask.shape[1] - 1)]:
                wrong.append(f"keypoint {k.name} is {k.state} but lies off the mask")
    return wrong


def _check_silhouette(truth: Truth, mask: ByteArray, target: Target) -> list[str]:
    """The mask against the projected triangles filled on the CPU, outline tolerance aside."""
    mesh = mesh_of(target)
    R = matrix_from_quat(truth.q_camera_from_target_wxyz)
    in_camera = mesh.positions_m @ R.T + np.asarray(truth.t_camera_from_target_m)
    if in_camera[:, 2].min() <= 1e-3:
        return []
    inner, outer = _filled_silhouette(truth.camera.project(in_camera)[mesh.triangles], mask.shape)
    reach = np.ones((2 * OUTLINE_TOLERANCE_PX + 1,) * 2, np.uint8)
    extra = int(np.count_nonzero((mask > 0) & (np.asarray(cv2.dilate(outer, reach)) == 0)))
    missing = int(np.count_nonzero((np.asarray(cv2.erode(inner, reach)) > 0) & (mask == 0)))
    if extra or missing:
        return [f"mask has {extra} pixels outside the projected craft and lacks {missing} inside it"]
    return []


def _filled_silhouette(corners_px: FloatArray, shape: tuple[int, ...]) -> tuple[ByteArray, ByteArray]:
    """Projected triangles (M, 3, 2) filled on a grid FILL_SCALE times finer: surely inside, and perhaps inside.

    OpenCV fills the pixels a border touches too, which closes slots narrower than a pixel: ``outer`` has them
    closed, ``inner`` has one fine pixel taken off every border, which opens them.
    """
    height, width = shape
    low = np.clip(np.floor(corners_px.min(axis=(0, 1))) - 4, 0, (width, height)).astype(int)
    high = np.clip(np.ceil(corners_px.max(axis=(0, 1))) + 5, 0, (width, height)).astype(int)
    inner, outer = np.zeros((2, height, width), np.uint8)
    if np.any(high <= low):
        return inner, outer
    fine = np.zeros(((high[1] - low[1]) * FILL_SCALE, (high[0] - low[0]) * FILL_SCALE), np.uint8)
    # a coarse pixel's centre is at (FILL_SCALE - 1) / 2 on the finer grid
    at = (corners_px - low) * FILL_SCALE + (FILL_SCALE - 1) / 2
    for triangle in np.rint(at * 2**FILL_SHIFT).astype(np.int32):
        cv2.fillConvexPoly(fine, triangle, 255, cv2.LINE_8, FILL_SHIFT)
    size = (int(high[0] - low[0]), int(high[1] - low[1]))
    eroded = cv2.erode(fine, np.ones((3, 3), np.uint8))
    for place, grid, share in ((inner, eroded, SURELY_COVERED), (outer, fine, SURELY_TOUCHED)):
        coarse = cv2.resize(grid, size, interpolation=cv2.INTER_AREA)
        place[low[1] : high[1], low[0] : high[0]] = np.where(
            coarse >= 255 * share, np.uint8(255), np.uint8(0)
        )
    return inner, outer


def _check_speed(folder: Path, frames: list[int]) -> list[Fault]:
    path = folder / SPEED_FOLDER / "train.json"
    try:
        labels = {
            row["filename"]: (tuple(row["q_vbs2tango"]), tuple(row["r_Vo2To_vbs_true"]))
            for row in json.loads(path.read_text())
        }
    except (OSError, ValueError, KeyError, TypeError) as error:
        return [Fault(None, f"{path} cannot be read: {error}")]
    faults = []
    for k in frames:
        name = f"img{k:06d}.jpg"
        if name not in labels:
            faults.append(Fault(k, "is missing from the SPEED export"))
            continue
        truth = read_truth(frame_paths(folder, k).truth)
        if labels[name] != (truth.q_camera_from_target_wxyz, truth.t_camera_from_target_m):
            faults.append(Fault(k, "has another pose in the SPEED export"))
        if not (folder / SPEED_FOLDER / "images" / "train" / name).is_file():
            faults.append(Fault(k, "has no image in the SPEED export"))
    return faults
