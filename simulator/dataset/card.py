"""dataset.json: the card that describes a data set without further documents."""

from __future__ import annotations

import os
import platform
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import msgspec

from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.dataset.record_fields import RECORD_FIELDS
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.part_classes import target_classes
from flyaround.simulator.runtime.untrusted_files import (
    read_regular,
    refuse_deep,
    refuse_link_out,
    without_mark,
)
from flyaround.simulator.targets.model import PartClass

if TYPE_CHECKING:
    from flyaround.simulator.targets.model import Target

CARD_NAME = "dataset.json"
MAX_BYTES = 64_000_000  # size limit, for a card with every frame of a large set in quarantine

CONVENTIONS = {
    "quaternions": "Hamilton, scalar first; q_a_from_b rotates a vector given in b into a",
    "pose": "x_camera = R(q_camera_from_target_wxyz) x_target + t_camera_from_target_m, metres",
    "camera_frame": "x right, y down, z forward (OpenCV)",
    "pixels": "pixel (0, 0) is the centre of the top-left pixel (OpenCV)",
    "box_px": "x0 y0 x1 y1 of the visible mask at pixel edges, clipped to the image; "
    "a one-pixel mask at (3, 4) is 2.5 3.5 3.5 4.5",
    "box_amodal_px": "x0 y0 x1 y1 of the whole projected craft, not clipped",
    "image": "digital numbers from 0 to 2^image_bits - 1; of more than 8 bits in the low bits of a 16 bit PNG",
    "mask": "8 bit PNG, 255 where the target covers the pixel's centre",
    "keypoint_states": "first that applies: out_of_frame self_occluded eclipsed shadowed saturated "
    "below_noise visible",
    "epoch_utc": "mid-exposure",
    "sun_direction_camera": "unit vector from the target to the apparent Sun, camera frame",
    "earth_direction_camera": "unit vector from the target to the Earth's centre, camera frame",
    "layers": "NNNNNN.NAME.png or .exr, those named in labels. depth: camera z [m], float32, NaN off the target. "
    "normals: X Y Z, camera frame, unit, towards the camera, float16, zero off the target. parts: number of the part "
    "from 1 in the order of target.parts, whose classes are target.part_classes, 0 off the target. "
    "amodal: mask of the whole target, also beyond the image; "
    "its first pixel is amodal_origin_px. flow: U V, way to the next frame [px], float32, NaN off the target. "
    "clean: the image without noise",
    "speed": "q_vbs2tango is q_camera_from_target_wxyz; r_Vo2To_vbs_true is t_camera_from_target_m",
}

LAYOUT = (
    "images/NNNNNN.png image, images/NNNNNN.mask.png mask, images/NNNNNN.LAYER.png or .exr layers, "
    "images/NNNNNN.SENSOR.npz of sensors, "
    "images/NNNNNN.json truth, FORMAT/ each of formats; split.json frames of each split, where there is one"
)


class CardTarget(msgspec.Struct, frozen=True, kw_only=True):
    """The drawn model, with its keypoints in the model frame [m]; ``part_classes`` in the order of ``parts``."""

    name: str
    sha256: str
    parts: tuple[str, ...] = ()
    part_classes: tuple[PartClass, ...] = ()
    keypoints: dict[str, tuple[float, float, float]]

    @classmethod
    def from_target(cls, target: Target) -> CardTarget:
        """Describe a target model.

        Returns
        -------
        CardTarget
            Name, hash, parts with their classes, and keypoints in the target frame [m].
        """
        return cls(
            name=target.name,
            sha256=target.sha256,
            parts=tuple(part.name for part in target.parts),
            part_classes=target_classes(target),
            keypoints={k.name: k.position_m for k in target.keypoints},
        )


class CardMachine(msgspec.Struct, frozen=True, kw_only=True):
    """The machine that drew the images: "same bytes" holds for the same renderer."""

    flyaround: str
    python: str
    numpy: str
    opencv: str
    gl_vendor: str
    gl_renderer: str
    gl_version: str
    cpu: str


class StereoCard(msgspec.Struct, frozen=True, kw_only=True):
    """Geometry of a stereo pair, in the cards of both cameras; the second's data set is the subfolder ``second/``.

    Parameters
    ----------
    camera : {"first", "second"}
        Camera of this data set.
    position_m : tuple of float
        Position of the second camera in the first's axes.
    turn_deg : tuple of float
        Rotation vector from the first's axes to the second's.
    q_second_from_first_wxyz : tuple of float
        The same as a quaternion.
    """

    camera: Literal["first", "second"]
    position_m: tuple[float, float, float]
    turn_deg: tuple[float, float, float]
    q_second_from_first_wxyz: tuple[float, float, float, float]


class CardQuarantine(msgspec.Struct, frozen=True, kw_only=True):
    """A frame in ``quarantine/``, and the reason."""

    frame: int
    reason: str


class DatasetCard(msgspec.Struct, frozen=True, kw_only=True):
    """The data-set card."""

    schema: Literal["flyaround.dataset"] = "flyaround.dataset"
    version: Literal[1] = 1
    scenario_name: str
    scenario: dict[str, Any]
    seed: int
    n_frames: Annotated[int, msgspec.Meta(ge=1, le=10_000_000)]
    every_s: float | None
    complete: bool
    quarantined: tuple[CardQuarantine, ...] = ()
    formats: tuple[str, ...]
    labels: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()
    split: tuple[int, int, int] | None = None
    camera: Camera
    image_bits: Annotated[int, msgspec.Meta(ge=1, le=16)] | None = None
    target: CardTarget
    machine: CardMachine
    stereo: StereoCard | None = None
    conventions: dict[str, str] = msgspec.field(default_factory=lambda: dict(CONVENTIONS))
    record_fields: dict[str, str] = msgspec.field(default_factory=lambda: dict(RECORD_FIELDS))
    layout: str = LAYOUT
    licence: str = (
        "images and labels made with Flyaround belong to whoever made them; Earth imagery: NASA Visible Earth"
    )

    @property
    def is_of_this_version(self) -> bool:
        """True if this version wrote the data set."""
        return self.machine.flyaround == version("flyaround")


def describe_machine(gl_vendor: str, gl_renderer: str, gl_version: str) -> CardMachine:
    """Return the machine section of the card.

    Returns
    -------
    CardMachine
        Versions of Flyaround, Python and libraries, the given description of the driver, and the processor with its
        threads.
    """
    cpu = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                cpu = line.split(":", 1)[1].strip()
                break
    return CardMachine(
        flyaround=version("flyaround"),
        python=platform.python_version(),
        numpy=version("numpy"),
        opencv=version("opencv-contrib-python-headless"),
        gl_vendor=gl_vendor,
        gl_renderer=gl_renderer,
        gl_version=gl_version,
        cpu=f"{cpu}, {os.cpu_count()} threads",
    )


def read_card(folder: Path) -> DatasetCard:
    """Read and validate the card of a data set.

    Returns
    -------
    DatasetCard
        Validated card.

    Raises
    ------
    UserError
        If the folder is no data set or the card is damaged.
    """
    path = folder / CARD_NAME
    refuse_link_out(path, folder)
    try:
        data = read_regular(path, MAX_BYTES)
    except OSError as error:
        raise UserError(
            f"{folder} is not a data set: cannot read {path.name} ({error.strerror}); "
            "give a folder written by capture, or make one of another's with flyaround convert"
        ) from error
    return decode_card(data, str(path))


def decode_card(data: bytes, source: str) -> DatasetCard:
    """Return the card in a file's bytes.

    Raises
    ------
    UserError
        If it is damaged.
    """
    data = without_mark(data, source)
    refuse_deep(data, source)
    try:
        return msgspec.json.decode(data, type=DatasetCard)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise UserError(
            f"{source} is damaged: {error}; run capture again with --resume to rewrite it"
        ) from error


def card_to_json(card: DatasetCard) -> bytes:
    """Return the card as indented JSON."""
    return msgspec.json.format(msgspec.json.encode(card), indent=1) + b"\n"
