"""The truth record of one frame: the machine-read JSON beside every image."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol

import msgspec

from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.arrays import Quat, Vec3
from flyaround.simulator.runtime.untrusted_files import read_regular, refuse_deep, without_mark
from flyaround.simulator.scene.limits import scene_problem
from flyaround.simulator.scene.record import SceneRecord
from flyaround.simulator.world.frames.pose import Pose

if TYPE_CHECKING:
    from flyaround.simulator.scene.state import SceneState

MAX_BYTES = 64_000_000  # size limit of a record; wireframe and row poses take the most

KeypointState = Literal[
    "out_of_frame", "self_occluded", "eclipsed", "shadowed", "saturated", "below_noise", "visible"
]
InfeasibleReason = Literal["", "cropped", "dark", "too_far"]
Box = tuple[float, float, float, float]


class KeypointLabel(msgspec.Struct, frozen=True, kw_only=True):
    """One keypoint: position on the model, position in the image, and state."""

    name: str
    target_m: Vec3
    pixel_px: tuple[float, float] | None
    state: KeypointState


class FlowLabel(msgspec.Struct, frozen=True, kw_only=True):
    """Target of the optical flow: time and pose of the next frame."""

    t_s: float
    q_camera_from_target_wxyz: Quat
    t_camera_from_target_m: Vec3


class WireLabel(msgspec.Struct, frozen=True, kw_only=True):
    """One edge of the wireframe: projected ends, and visible shares 0..1.

    The ends are not clipped to the image; an edge that reaches behind the camera is omitted. With lens distortion,
    shares are of the undistorted projection.
    """

    name: str
    ends_px: tuple[tuple[float, float], tuple[float, float]]
    visible: tuple[tuple[float, float], ...]


class RowPose(msgspec.Struct, frozen=True, kw_only=True):
    """Pose of the craft at the mid-exposure of one row of a rolling shutter, ``dt_s`` from the image's."""

    row_px: int
    dt_s: float
    q_camera_from_target_wxyz: Quat
    t_camera_from_target_m: Vec3


class Software(msgspec.Struct, frozen=True, kw_only=True):
    """Version and renderer that drew the frame."""

    flyaround: str
    gl_renderer: str


class Truth(msgspec.Struct, frozen=True, kw_only=True, dict=True):
    """The ground truth of one frame, at mid-exposure.

    ``scene`` holds every SceneState field, which suffices to draw the same bytes again. The hashes are of the pixels,
    row by row, as written (RGB order, little-endian), not of the PNG files.
    """

    schema: Literal["flyaround.truth"] = "flyaround.truth"
    version: Literal[1] = 1
    epoch_utc: str
    t_s: float
    frame_index: int
    seed: int
    q_camera_from_target_wxyz: Quat
    t_camera_from_target_m: Vec3
    camera: Camera
    keypoints: tuple[KeypointLabel, ...]
    box_px: Box | None
    box_amodal_px: Box | None
    sun_direction_camera: Vec3
    sun_visible_fraction: float
    feasible: bool
    infeasible_reason: InfeasibleReason
    silhouette_inside: float
    wireframe_step_share: float
    image_sha256: str
    mask_sha256: str
    record: SceneRecord = msgspec.field(name="scene")
    software: Software
    exposure_s: float | None = None
    earth_direction_camera: Vec3 | None = None
    box_3d_target_m: tuple[Vec3, ...] = ()
    box_3d_px: tuple[tuple[float, float] | None, ...] = ()
    parts: tuple[str, ...] = ()
    layers: tuple[str, ...] = ()
    layer_sha256: dict[str, str] = msgspec.field(default_factory=dict)
    amodal_origin_px: tuple[int, int] | None = None
    flow: FlowLabel | None = None
    wireframe: tuple[WireLabel, ...] = ()
    row_poses: tuple[RowPose, ...] = ()

    @cached_property
    def scene(self) -> SceneState:
        """The scene that was drawn."""
        return self.record.scene()


def truth_to_json(truth: Truth) -> bytes:
    """Write the record as indented JSON.

    Returns
    -------
    bytes
        UTF-8 text that ends with a line feed; floats round-trip exactly.
    """
    return msgspec.json.format(msgspec.json.encode(truth), indent=1) + b"\n"


def truth_document(truth: Truth) -> dict[str, Any]:
    """Convert the record to a document of plain values.

    Returns
    -------
    dict of str to object
        Values that JSON can hold, by the keys of the record's file; a new dictionary.
    """
    return dict(msgspec.json.decode(msgspec.json.encode(truth)))


def read_truth(path: str | Path) -> Truth:
    """Read and validate a truth record.

    Returns
    -------
    Truth
        Validated record.

    Raises
    ------
    UserError
        If the file is missing, is not JSON, or a field is wrong.
    """
    path = Path(path)
    return parse_truth(read_record_bytes(path), path)


def parse_truth(data: bytes, path: Path) -> Truth:
    """Parse a truth record from its text; ``path`` names it in messages.

    Raises
    ------
    UserError
        If it is not JSON, or a field is wrong.
    """
    try:
        truth = msgspec.json.decode(data, type=Truth)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        if b'"flyaround.imported"' in data[:200]:
            raise UserError(
                f"{path} belongs to an imported image, which has no scene; give a .json written by "
                "render or capture"
            ) from error
        raise UserError(
            f"{path} is not a truth record: {error}; give a .json written by render or capture"
        ) from error
    flow = () if truth.flow is None else (truth.flow,)
    problem = pose_problem(truth, *flow, *truth.row_poses) or scene_problem(truth.scene)
    if problem is not None:
        raise UserError(f"{path} is not a truth record: {problem}; give a .json written by render or capture")
    return truth


class LabelledPose(Protocol):
    """A part of a record that states a pose of the target."""

    @property
    def q_camera_from_target_wxyz(self) -> Quat:
        """Attitude of the target, scalar first."""

    @property
    def t_camera_from_target_m(self) -> Vec3:
        """Position of the target's origin in the camera frame [m]."""


def pose_problem(*poses: LabelledPose) -> str | None:
    """Return why one of the poses is not a pose, such as a quaternion of another length; None if all are."""
    for pose in poses:
        try:
            Pose("camera", "target", pose.q_camera_from_target_wxyz, pose.t_camera_from_target_m)
        except ValueError as error:
            return str(error)
    return None


def read_record_bytes(path: Path) -> bytes:
    """Read the text of a record, limited in length and nesting.

    Raises
    ------
    UserError
        If it cannot be read or is not a record.
    """
    try:
        data = without_mark(read_regular(path, MAX_BYTES), str(path))
    except OSError as error:
        raise UserError(
            f"cannot read truth {path}: {error.strerror or error}; give a .json written by render or capture"
        ) from error
    refuse_deep(data, str(path))
    return data
