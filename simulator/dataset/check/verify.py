"""Verification of the labels of a data set from its files alone.

Pixels by ``cv2.projectPoints``, the pose by PnP on the exported keypoints, the mask against a silhouette filled by
OpenCV on the CPU, boxes against the mask, redrawn images, exports against the records. The package's docstring says
where the check shares code with the labels.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.dataset.card import CARD_NAME, DatasetCard, read_card
from flyaround.simulator.dataset.check.card_facts import check_card, check_frames_listed, check_manifest
from flyaround.simulator.dataset.check.clean_twin import check_clean
from flyaround.simulator.dataset.check.export_contents import refuse_repeated_keys
from flyaround.simulator.dataset.check.exports import ExportsCheck
from flyaround.simulator.dataset.check.feasibility import check_silhouette_inside
from flyaround.simulator.dataset.check.geometry import check_box_3d, check_keypoints, check_visible_on_mask
from flyaround.simulator.dataset.check.imported import check_imported
from flyaround.simulator.dataset.check.keypoint_states import check_amodal_box, check_states
from flyaround.simulator.dataset.check.layers import check_against_mesh, check_layers
from flyaround.simulator.dataset.check.mask_statistics import box_with_opencv, is_binary
from flyaround.simulator.dataset.check.recomputed_scenes import check_scenes
from flyaround.simulator.dataset.check.redraw import SHARE as REDRAWN_SHARE
from flyaround.simulator.dataset.check.redraw import Redrawn, check_pictures, fresh_seed, sample
from flyaround.simulator.dataset.check.row_poses import check_rows
from flyaround.simulator.dataset.check.signal import check_states_by_signal, check_steps_by_signal
from flyaround.simulator.dataset.check.wireframe import check_wireframe
from flyaround.simulator.dataset.formats.labelled_frame import frame_from_folder
from flyaround.simulator.dataset.formats.native import frame_paths, is_frame_complete, read_layer
from flyaround.simulator.dataset.split import SplitAssigner
from flyaround.simulator.dataset.stereo import pair_faults, second_folder
from flyaround.simulator.dataset.storage.manifest import MANIFEST_NAME
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.feasible import infeasible_reason
from flyaround.simulator.labels.imported import ImportedTruth, read_label_record
from flyaround.simulator.labels.layers import pixel_hash
from flyaround.simulator.labels.truth import Truth
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.ephemeris.eclipse import sun_fraction_past_bodies
from flyaround.simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from flyaround.simulator.dataset.check.ray_casting import Layers
    from flyaround.simulator.runtime.arrays import ByteArray
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target
    from flyaround.simulator.world.frames.pose import Pose


@dataclass(frozen=True)
class Fault:
    """One wrong label: the frame (None: the card), and what is wrong."""

    frame: int | None
    what: str


@dataclass(frozen=True)
class CheckReport:
    """Result of a check.

    Parameters
    ----------
    n_frames : int
        Number of frames.
    n_labels : int
        Number of label values that were checked.
    faults : tuple of Fault
        Faults found.
    n_redrawn : int, optional
        Number of frames redrawn from their records.
    not_redrawn : str, optional
        Reason if none was, although requested.
    redraw_seed : int, optional
        Seed of the redrawn sample, to repeat it.
    n_exported : int, optional
        Frames whose contents were compared in each export.
    not_checked : tuple of str, optional
        Impossible checks, with the reason.
    """

    n_frames: int
    n_labels: int
    faults: tuple[Fault, ...]
    n_redrawn: int = 0
    not_redrawn: str = ""
    redraw_seed: int = 0
    n_exported: int = 0
    not_checked: tuple[str, ...] = ()


def check_dataset(
    folder: str | Path,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
    *,
    redraw: float = REDRAWN_SHARE,
    redraw_seed: int | None = None,
    whole_exports: bool = False,
) -> CheckReport:
    """Check every frame of a data set, and redraw some images; both sets of a stereo pair are checked.

    Parameters
    ----------
    folder : str or Path
        Data set.
    progress : callable, optional
        Called with the number done, and the total.
    redraw : float, optional
        Share of the frames to redraw from their records, at least three; 0 for none. Without OpenGL none is, and the
        report says so.
    redraw_seed : int, optional
        Seed of the sample; by default unpredictable, so that nobody who alters a data set can know it beforehand.
    whole_exports : bool, optional
        True to compare the contents of all frames in the exports instead of a sample.

    Returns
    -------
    CheckReport
        Faults by frame, and what could not be checked.

    Raises
    ------
    UserError
        If the folder is not a data set.
    """
    folder = Path(folder)
    card = read_card(folder)
    faults: list[Fault] = []
    try:
        refuse_repeated_keys((folder / CARD_NAME).read_bytes(), CARD_NAME)
    except UserError as error:
        faults.append(Fault(None, str(error)))
    target: Target | None = load_target(card.target.name)
    if target is not None and target.sha256 != card.target.sha256:
        faults.append(
            Fault(
                None,
                f"target {card.target.name} here differs from the rendered one; masks were not compared",
            )
        )
        target = None
    frames = [k for k in range(card.n_frames) if is_frame_complete(folder, k)]
    faults += _check_count(folder, card, len(frames))
    seed = fresh_seed() if redraw_seed is None else redraw_seed
    readable = []
    poses: dict[int, Pose] = {}
    exports = ExportsCheck(folder, card, frames, seed, whole=whole_exports)
    is_second = card.stereo is not None and card.stereo.camera == "second"
    assigner = None if card.split is None or is_second else SplitAssigner(card.split)
    layers_of_frames: list[tuple[str, ...]] = []
    scenes: dict[int, SceneState] = {}
    if card.complete:
        faults += [
            Fault(k, "files are missing") for k in range(card.n_frames) if not is_frame_complete(folder, k)
        ]
    redrawn = sample(frames, redraw, seed)
    n_labels = n_imported = 0
    previous: Truth | None = None
    for n_done, k in enumerate(frames):
        frame = frame_from_folder(folder, k, exports.splits.get(k, ""))  # decoded once for all checks
        try:
            truth = read_label_record(frame_paths(folder, k).truth)
            refuse_repeated_keys(frame.read("json"), str(frame_paths(folder, k).truth))
            image, mask = frame.image, frame.mask
            if assigner is not None:
                assigner.assign(frame)
            if isinstance(truth, ImportedTruth):
                imported = check_imported(k, truth, image, mask, card, target)
                faults += [Fault(k, what) for what in imported]
                n_imported += 1
                n_labels += len(truth.keypoints) + 7
                progress(n_done + 1, len(frames))
                continue
            layers = {name: read_layer(folder / "images", f"{k:06d}", name) for name in truth.layer_sha256}
            frame.decoded.update(layers)
        except UserError as error:
            faults.append(Fault(k, str(error)))
            continue
        readable.append(k)
        poses[k] = frame.pose
        exports.take(frame)
        layers_of_frames.append(truth.layers)
        scenes[k] = truth.scene
        faults += _check_flow_to(k, truth, previous)
        previous = truth
        craft = None if target is None else truth.scene.target.drawn(target)
        faults_of_frame = check_frame(k, truth, image, mask, card, craft, layers)
        faults += [Fault(k, what) for what in faults_of_frame]
        n_labels += len(truth.keypoints) + len(truth.layers) + 7
        progress(n_done + 1, len(frames) + len(redrawn))
    redrawn_images = Redrawn(0, (), "the pictures were imported" if n_imported and redrawn else "")
    readable_drawn = [k for k in redrawn if k in readable]
    if target is not None and readable_drawn:
        steps = itertools.count(len(frames) + 1)
        redrawn_images = check_pictures(
            folder, readable_drawn, target, lambda: progress(next(steps), len(frames) + len(redrawn))
        )
        faults += [Fault(k, what) for k, what in redrawn_images.faults]
    faults += [Fault(None, what) for what in check_card(card, target, layers_of_frames)]
    is_all = len(readable) + n_imported == card.n_frames
    assigned = assigner.numbers if assigner is not None and is_all else {}
    faults += [Fault(None, what) for what in check_frames_listed(card, exports.splits, assigned, folder)]
    faults += [Fault(k, what) for k, what in check_manifest(folder, card, frames)]
    unlisted = () if (folder / MANIFEST_NAME).is_file() else (f"there is no {MANIFEST_NAME}",)
    planned = check_scenes(card, scenes, seed)
    faults += [Fault(k, what) for k, what in planned.faults]
    compared = exports.finish(poses)
    faults += [Fault(k, what) for k, what in compared.faults]
    report = CheckReport(
        len(frames),
        n_labels,
        tuple(faults),
        redrawn_images.n_frames,
        redrawn_images.reason,
        seed,
        compared.n_frames,
        (*planned.not_checked, *compared.not_checked, *unlisted),
    )
    faults += [Fault(k, what) for k, what in pair_faults(folder, card)]
    other = second_folder(folder, card)
    if other is None or not (other / CARD_NAME).is_file():
        return replace(report, faults=tuple(faults))
    second = check_dataset(other, progress, redraw=redraw, redraw_seed=seed, whole_exports=whole_exports)
    faults += [Fault(fault.frame, f"second camera: {fault.what}") for fault in second.faults]
    return CheckReport(
        report.n_frames + second.n_frames,
        report.n_labels + second.n_labels,
        tuple(faults),
        report.n_redrawn + second.n_redrawn,
        report.not_redrawn or second.not_redrawn,
        seed,
        report.n_exported + second.n_exported,
        tuple(dict.fromkeys([*report.not_checked, *second.not_checked])),
    )


def _check_flow_to(k: int, truth: Truth, previous: Truth | None) -> list[Fault]:
    """Check that the previous frame's flow leads to this frame."""
    if previous is None or previous.flow is None or previous.frame_index != truth.frame_index - 1:
        return []
    flow = previous.flow
    if (flow.t_s, flow.q_camera_from_target_wxyz, flow.t_camera_from_target_m) != (
        truth.t_s,
        truth.q_camera_from_target_wxyz,
        truth.t_camera_from_target_m,
    ):
        return [Fault(k - 1, "the optical flow leads to another time or pose than the next frame's")]
    return []


def _check_count(folder: Path, card: DatasetCard, n_complete: int) -> list[Fault]:
    """Check the card's number of frames against the files."""
    faults = []
    numbers = [p.stem for p in (folder / "images").glob("*.json") if p.stem.isdecimal()]
    unexpected = [number for number in numbers if int(number) >= card.n_frames]
    if unexpected:
        faults.append(
            Fault(None, f"images/ holds {len(unexpected)} frames beyond the card's {card.n_frames}")
        )
    if n_complete == 0:
        faults.append(Fault(None, "the data set has no complete frame"))
    return faults


def check_frame(
    k: int,
    truth: Truth,
    image: NDArray[np.unsignedinteger],
    mask: ByteArray,
    card: DatasetCard,
    target: Target | None,
    layers: Layers | None = None,
) -> list[str]:
    """Return all faults of frame k, one sentence each.

    Parameters
    ----------
    k : int
        Number of the frame.
    truth : Truth
        Truth record of the frame.
    image : (H, W) or (H, W, 3) array
        Digital numbers of the image.
    mask : (H, W) array
        Mask of the target.
    card : DatasetCard
        Card of the data set.
    target : Target or None
        Target model; None if it is not available.
    layers : Layers, optional
        Label layers of the frame by name, as drawn or read.

    Returns
    -------
    list of str
        Faults; empty if there are none.
    """
    layers = layers or {}
    problems: list[str] = []
    size = (truth.camera.height_px, truth.camera.width_px)
    if image.shape[:2] != size or mask.shape != size:
        return [f"image is {image.shape[:2]}, mask {mask.shape}, camera says {size}"]
    if truth.image_sha256 != pixel_hash(image):
        problems.append("the image is not the one that the record describes")
    if truth.mask_sha256 != pixel_hash(mask):
        problems.append("the mask is not the one that the record describes")
    problems += _check_bookkeeping(k, truth, card)
    if truth.camera != card.camera:
        problems.append("camera differs from the card's")
    if not is_binary(mask):
        problems.append("mask has values other than 0 and 255")
    if abs(float(np.linalg.norm(truth.q_camera_from_target_wxyz)) - 1) > 1e-9:
        problems.append("quaternion is not of unit length")
    box = box_with_opencv(mask)
    if truth.box_px != box:
        problems.append(f"box_px {truth.box_px} is not the mask's {box}")
    scene = truth.scene
    if (scene.q_camera_from_target_wxyz, scene.t_camera_from_target_m) != (
        truth.q_camera_from_target_wxyz,
        truth.t_camera_from_target_m,
    ):
        problems.append("pose differs from the scene's")
    problems += _check_directions(truth)
    problems += check_rows(truth)
    problems += check_keypoints(truth, card)
    problems += check_visible_on_mask(truth, mask)
    layer_faults = check_layers(truth, mask, layers, target)
    problems += layer_faults
    if not layer_faults and "clean" in layers:
        problems += check_clean(truth, image, mask, layers["clean"])
        problems += check_states_by_signal(truth, layers["clean"])
    if target is not None:
        if not layer_faults:
            problems += check_against_mesh(truth, mask, layers, target)
        problems += check_wireframe(truth, target)
        problems += check_states(truth, target)
        problems += check_amodal_box(truth, target)
        problems += check_box_3d(truth, target)
        problems += check_silhouette_inside(truth, target)
        if not layer_faults and "clean" in layers:
            problems += check_steps_by_signal(truth, target, layers["clean"])
    return problems


def _check_directions(truth: Truth) -> list[str]:
    """Check Sun, Earth, eclipse and exposure against the positions in the scene."""
    scene, problems = truth.scene, []
    to_camera = matrix_from_quat(scene.q_camera_from_eci_wxyz)
    target, sun = np.asarray(scene.r_target_eci_m), np.asarray(scene.r_sun_eci_m)
    for name, label, direction in (
        ("sun_direction_camera", truth.sun_direction_camera, sun - target),
        ("earth_direction_camera", truth.earth_direction_camera, -target),
    ):
        if label is not None and not np.allclose(
            label, to_camera @ direction / np.linalg.norm(direction), atol=1e-9
        ):
            problems.append(f"{name} is not the direction that the scene's positions give")
    visible_share = sun_fraction_past_bodies(scene.bodies, target, sun)
    if abs(truth.sun_visible_fraction - visible_share) > 1e-9:
        problems.append("sun_visible_fraction is not what Earth and Moon leave of the Sun's disc")
    if truth.exposure_s is not None and truth.exposure_s != scene.exposure_s:
        problems.append("exposure_s differs from the scene's")
    return problems


def _check_bookkeeping(k: int, truth: Truth, card: DatasetCard) -> list[str]:
    """Check that fields recorded twice agree."""
    scene = truth.scene
    problems: list[str] = []
    duplicated = ("epoch_utc", "t_s", "seed", "frame_index", "camera", "sun_visible_fraction")
    problems += [
        f"{name} differs from the scene's"
        for name in duplicated
        if getattr(truth, name) != getattr(scene, name)
    ]
    if truth.frame_index != k:
        problems.append(f"frame_index is {truth.frame_index} in the record of frame {k}")
    if truth.seed != card.seed:
        problems.append(f"seed is {truth.seed}, the card's is {card.seed}")
    if card.image_bits not in (None, truth.scene.sensor.bits):
        problems.append(f"its image has {truth.scene.sensor.bits} bits, the card says {card.image_bits}")
    reason = infeasible_reason(truth.silhouette_inside, truth.wireframe_step_share, truth.box_amodal_px)
    if (truth.feasible, truth.infeasible_reason) != (reason == "", reason):
        problems.append(
            f"feasible is {truth.feasible} ({truth.infeasible_reason or 'no reason'}), its shares say otherwise"
        )
    return problems
