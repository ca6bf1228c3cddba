"""The record of an imported image: its pose and what follows from it, without a scene."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import msgspec

from flyaround.simulator.camera.lens.camera_model import Camera, camera_problem
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.truth import (
    Box,
    InfeasibleReason,
    KeypointLabel,
    Truth,
    parse_truth,
    pose_problem,
    read_record_bytes,
)
from flyaround.simulator.runtime.arrays import Quat, Vec3


class ImportedTruth(msgspec.Struct, frozen=True, kw_only=True):
    """Record of an imported image with a pose; the other fields are those of `Truth`.

    Its illumination is unknown: a keypoint's ``state`` is geometric, out_of_frame, self_occluded or visible. The mask
    is the model's silhouette at the pose, and a frame is feasible unless it is cropped.

    Attributes
    ----------
    source : str
        The image's name in the original set.
    t_s : float
        Seconds from the first image of a sequence; 0 if the set has no times.
    """

    schema: Literal["flyaround.imported"] = "flyaround.imported"
    version: Literal[1] = 1
    source: str
    t_s: float = 0.0
    frame_index: int
    q_camera_from_target_wxyz: Quat
    t_camera_from_target_m: Vec3
    camera: Camera
    keypoints: tuple[KeypointLabel, ...]
    box_px: Box | None
    box_amodal_px: Box | None
    feasible: bool
    infeasible_reason: InfeasibleReason
    silhouette_inside: float
    image_sha256: str
    mask_sha256: str
    box_3d_target_m: tuple[Vec3, ...] = ()
    box_3d_px: tuple[tuple[float, float] | None, ...] = ()


LabelRecord = Truth | ImportedTruth
"""The record of a data set's frame, drawn or imported."""


class _Kind(msgspec.Struct, frozen=True):
    schema: str = ""


def read_label_record(path: str | Path) -> LabelRecord:
    """Read and validate the record of a frame, drawn or imported.

    Returns
    -------
    Truth or ImportedTruth
        Record, by the schema that the file names.

    Raises
    ------
    UserError
        If the file is missing, is not JSON, or a field is wrong.
    """
    path = Path(path)
    return parse_label_record(read_record_bytes(path), path)


def parse_label_record(data: bytes, path: Path) -> LabelRecord:
    """Parse the record from its text; ``path`` names it in errors.

    Returns
    -------
    Truth or ImportedTruth
        Record, by the schema that the text names.

    Raises
    ------
    UserError
        If it is not a record, as in `read_label_record`.
    """
    try:
        if msgspec.json.decode(data, type=_Kind).schema != "flyaround.imported":
            return parse_truth(data, path)
        record = msgspec.json.decode(data, type=ImportedTruth)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise UserError(
            f"{path} is not a label record: {error}; give a .json written by capture or convert"
        ) from error
    problem = pose_problem(record) or camera_problem(record.camera)
    if problem is not None:
        raise UserError(
            f"{path} is not a label record: {problem}; give a .json written by capture or convert"
        )
    return record
