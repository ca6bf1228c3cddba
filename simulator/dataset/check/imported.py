"""Checks, by OpenCV's projection, of an imported image's labels, which follow from pose, camera and model."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.simulator.dataset.check.geometry import (
    PIXEL_TOLERANCE_PX,
    check_box_by_edges,
    in_lens,
    project_with_opencv,
)
from flyaround.simulator.dataset.check.mask_statistics import box_with_opencv, is_binary
from flyaround.simulator.labels.feasible import infeasible_reason
from flyaround.simulator.labels.layers import pixel_hash
from flyaround.simulator.targets.joined_mesh import joined_mesh
from flyaround.simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.dataset.card import DatasetCard
    from flyaround.simulator.labels.imported import ImportedTruth
    from flyaround.simulator.runtime.arrays import ByteArray
    from flyaround.simulator.targets.model import Target


def check_imported(
    k: int,
    truth: ImportedTruth,
    image: NDArray[Any],
    mask: ByteArray,
    card: DatasetCard,
    target: Target | None,
) -> list[str]:
    """Return all faults of imported frame k, one sentence each."""
    size = (truth.camera.height_px, truth.camera.width_px)
    if image.shape[:2] != size or mask.shape != size:
        return [f"image is {image.shape[:2]}, mask {mask.shape}, camera says {size}"]
    reason = infeasible_reason(truth.silhouette_inside, 1.0, truth.box_amodal_px)
    box = box_with_opencv(mask)
    faults = {
        "the image is not the one that the record describes": truth.image_sha256 != pixel_hash(image),
        "the mask is not the one that the record describes": truth.mask_sha256 != pixel_hash(mask),
        "camera differs from the card's": truth.camera != card.camera,
        f"frame_index is {truth.frame_index} in the record of frame {k}": truth.frame_index != k,
        "mask has values other than 0 and 255": not is_binary(mask),
        "quaternion is not of unit length": abs(np.linalg.norm(truth.q_camera_from_target_wxyz) - 1) > 1e-9,
        f"box_px {truth.box_px} is not the mask's {box}": truth.box_px != box,
        "feasible is not what silhouette_inside says": (truth.feasible, truth.infeasible_reason)
        != (reason == "", reason),
        "keypoints differ from the card's": [(p.name, tuple(p.target_m)) for p in truth.keypoints]
        != list(card.target.keypoints.items()),
    }
    return [fault for fault, is_wrong in faults.items() if is_wrong] + _check_places(truth, target)


def _check_places(truth: ImportedTruth, target: Target | None) -> list[str]:
    """Check keypoints and the box of all vertices against OpenCV's projection."""
    q, t = truth.q_camera_from_target_wxyz, np.asarray(truth.t_camera_from_target_m)
    faults = []
    projected = [p for p in truth.keypoints if p.pixel_px is not None]
    if projected:
        points, pixels = np.array([p.target_m for p in projected]), np.array([p.pixel_px for p in projected])
        usable = in_lens(truth.camera, points @ matrix_from_quat(q).T + t)
        error = np.abs(project_with_opencv(truth.camera, points, q, t) - pixels)[usable].max(initial=0.0)
        if not error <= PIXEL_TOLERANCE_PX:
            faults.append(f"a keypoint is {error:.3g} px from its projection")
        faults += [
            f"keypoint {p.name} at {p.pixel_px} is labelled {p.state}"
            for p, inside in zip(projected, truth.camera.contains(pixels), strict=True)
            if (p.state == "out_of_frame") == bool(inside)
        ]
    if target is not None and truth.box_amodal_px is not None:
        faults += check_box_by_edges(truth, joined_mesh(target))
    return faults
