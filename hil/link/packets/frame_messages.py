"""Messages about one frame: pixels to the board, pose and credit back, and the truth."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass, field
from typing import Any, ClassVar, Dict, Optional, Sequence, Tuple

from flyaround.hil.link.errors import PacketError
from flyaround.hil.link.packets.enums import Encoding, FieldTag, PixelFormat, Transfer
from flyaround.hil.link.packets.fields import (
    MAX_TEXT_BYTES,
    MAX_TRUTH_JSON_BYTES,
    REAL,
    FixedLayout,
    WireField,
    pack_json,
    pack_text,
    unpack_fixed,
    unpack_json,
    unpack_sentence,
    unpack_text,
    wire_enum,
    wire_text,
)
from flyaround.hil.link.packets.packet import PacketType
from flyaround.hil.link.packets.typed_fields import (
    FRAME_FIELDS,
    POSE_FIELDS,
    pack_covariance,
    pack_direction,
    pack_fields,
    pack_transfer,
    unpack_covariance,
    unpack_direction,
    unpack_fields,
    unpack_transfer,
)

# Maximum number of stages in an answer, and maximum duration of one [ms].
MAX_STAGES = 64

# Tolerance of a quaternion's length: accepts single precision and four printed digits, rejects a scaled one
QUATERNION_TOLERANCE = 1e-3
# Bounds beyond the Moon, and longer than a week; squares and sums of smaller values stay finite
MAX_POSITION_M = 1e9
MAX_STAGE_MS = 1e9

# Region of the detector: x, y, width, height [px].
ROI = struct.Struct("<HHHH")

Quat = Tuple[float, float, float, float]
Vec3 = Tuple[float, float, float]


@dataclass(frozen=True)
class FrameHeader:
    """Announcement of a frame: ``chunk_count`` chunks with a total of ``total_bytes``.

    Parameters
    ----------
    frame_id : int
        Number of the frame.
    width_px : int
        Image width.
    height_px : int
        Image height.
    bits : int
        Bits per pixel of the detector, right-aligned if the pixel format has room for more.
    encoding : Encoding
        Compression of the pixels.
    total_bytes : int
        Size of the frame's pixels as sent.
    chunk_count : int
        Number of FRAME_CHUNK packets that follow.
    exposure_s : float
        Exposure time.
    t_s : float
        Time of mid-exposure since the start of the scenario.
    host_send_ns : int
        The host's monotonic clock at the start of sending.
    epoch_utc : str
        Mid-exposure, ISO 8601, at most 40 characters.
    pixel_format : PixelFormat, optional
        Layout of the pixels.
    binning_x : int, optional
        Physical pixels per image pixel, horizontally.
    binning_y : int, optional
        Physical pixels per image pixel, vertically.
    roi_px : tuple of int, optional
        Region of the detector that was read: x, y, width, height in physical pixels; width and height are 0 if unknown.
    camera_frame : int, optional
        Frame counter of the camera, which may repeat because of a fault.
    exposure_start_ns : int, optional
        Start of the exposure, UTC nanoseconds since 1970-01-01T00:00:00 without leap seconds; 0 if unknown.
    exposure_end_ns : int, optional
        End of the exposure, likewise.
    sun_camera : Vec3, optional
        Unit vector to the Sun in the camera frame; None if the host does not send it.
    transfer : Transfer, optional
        Transfer function of the pixels.
    """

    TYPE: ClassVar[PacketType] = PacketType.FRAME_HEADER
    LAYOUT: ClassVar[FixedLayout] = FixedLayout(
        frame_id="I",
        width_px="H",
        height_px="H",
        pixel_format=wire_enum(PixelFormat, "I", "pixel format"),
        bits="B",
        encoding=wire_enum(Encoding, "B", "image encoding"),
        binning_x="B",
        binning_y="B",
        total_bytes="I",
        chunk_count="I",
        roi_px=WireField("8s", lambda roi_px: ROI.pack(*roi_px), ROI.unpack),
        camera_frame="Q",
        exposure_s=REAL,
        t_s=REAL,
        exposure_start_ns="Q",
        exposure_end_ns="Q",
        host_send_ns="Q",
        epoch_utc=wire_text(40),
    )

    frame_id: int
    width_px: int
    height_px: int
    bits: int
    encoding: Encoding
    total_bytes: int
    chunk_count: int
    exposure_s: float
    t_s: float
    host_send_ns: int
    epoch_utc: str
    pixel_format: PixelFormat = PixelFormat.Mono8
    binning_x: int = 1
    binning_y: int = 1
    roi_px: Tuple[int, int, int, int] = (0, 0, 0, 0)
    camera_frame: int = 0
    exposure_start_ns: int = 0
    exposure_end_ns: int = 0
    sun_camera: Optional[Vec3] = None
    transfer: Transfer = Transfer.LINEAR

    def encode(self) -> bytes:
        """Encode the message as a payload.

        Returns
        -------
        bytes
            Fixed fields, then the optional ones that are set.
        """
        sun, transfer = pack_direction(self.sun_camera), pack_transfer(self.transfer)
        fields = pack_fields(((FieldTag.SUN_CAMERA, sun), (FieldTag.TRANSFER, transfer)))
        return self.LAYOUT.pack(vars(self)) + fields

    @classmethod
    def decode(cls, data: bytes) -> FrameHeader:
        """Decode the message of a payload.

        Returns
        -------
        FrameHeader
            Message; optional fields that are absent have their defaults.

        Raises
        ------
        PacketError
            If the payload has another length or impossible values.
        """
        values = cls.LAYOUT.unpack(data, "FRAME_HEADER", tail=True)
        fields = unpack_fields(data[cls.LAYOUT.size :], FRAME_FIELDS, "FRAME_HEADER")
        if not math.isfinite(values["exposure_s"]) or not math.isfinite(values["t_s"]):
            raise PacketError(f"frame {values['frame_id']}: a FRAME_HEADER holds times that are not finite")
        return cls(
            **values,
            sun_camera=unpack_direction(fields.get(FieldTag.SUN_CAMERA)),
            transfer=unpack_transfer(fields.get(FieldTag.TRANSFER)),
        )


@dataclass(frozen=True)
class FrameChunk:
    """Part of a frame's encoded image, from byte ``offset``."""

    TYPE: ClassVar[PacketType] = PacketType.FRAME_CHUNK
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<IIII")

    frame_id: int
    index: int
    offset: int
    data: bytes

    def encode(self) -> bytes:
        """Encode the message as a payload.

        Returns
        -------
        bytes
            Fixed fields, then the bytes of the chunk.
        """
        return self.LAYOUT.pack(self.frame_id, self.index, self.offset, len(self.data)) + self.data

    @classmethod
    def decode(cls, data: bytes) -> FrameChunk:
        """Decode the message of a payload.

        Returns
        -------
        FrameChunk
            Message with a copy of the chunk's bytes.

        Raises
        ------
        PacketError
            If the payload has another length or impossible values.
        """
        frame_id, index, offset, size = unpack_fixed(cls.LAYOUT, data, "FRAME_CHUNK", tail=True)
        if len(data) - cls.LAYOUT.size != size:
            raise PacketError(f"a FRAME_CHUNK has {len(data) - cls.LAYOUT.size} bytes, expected {size}")
        return cls(frame_id, index, offset, data[cls.LAYOUT.size :])


@dataclass(frozen=True)
class PoseMessage:
    """Board to host: answer to one frame.

    Parameters
    ----------
    frame_id : int
        Number of the frame that is answered.
    accepted : bool
        True if the board considers the pose correct.
    reason : str, optional
        Reason for a declined frame.
    q_camera_from_target_wxyz : Quat, optional
        Attitude of the best pose, of length 1 within ``QUATERNION_TOLERANCE``; None without a pose. A declined answer
        may have one.
    t_camera_from_target_m : Vec3, optional
        Target position of the best pose, camera frame; None without a pose.
    confidence : float, optional
        Probability that the pose is correct, as estimated by the board, 0 to 1; 0 if it has no estimate.
    stages_ms : tuple of tuple of str and float, optional
        Name (at most 24 bytes) and duration of each stage, in order.
    receive_ns : int, optional
        Time of the complete reception of the frame, board's monotonic clock.
    start_ns : int, optional
        Start of the estimator, board's monotonic clock.
    end_ns : int, optional
        End of the estimator, board's monotonic clock.
    covariance : tuple of float, optional
        Upper triangle, row by row, of the covariance (6, 6) of rotation [rad] and translation [m], camera axes, 21
        numbers; None if the estimator has none or the host does not accept optional fields.
    """

    TYPE: ClassVar[PacketType] = PacketType.POSE
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<IBBHd4d3dQQQHH")
    STAGE: ClassVar[struct.Struct] = struct.Struct("<24sd")

    frame_id: int
    accepted: bool
    reason: str = ""
    q_camera_from_target_wxyz: Optional[Quat] = None
    t_camera_from_target_m: Optional[Vec3] = None
    confidence: float = 0.0
    stages_ms: Tuple[Tuple[str, float], ...] = ()
    receive_ns: int = 0
    start_ns: int = 0
    end_ns: int = 0
    covariance: Optional[Tuple[float, ...]] = None

    def encode(self) -> bytes:
        """Encode the message as a payload.

        Returns
        -------
        bytes
            Fixed fields, the first ``MAX_STAGES`` stages, the reason cut to ``MAX_TEXT_BYTES``, and the covariance
            if there is one.

        Raises
        ------
        PacketError
            If an accepted pose is missing or not finite.
        """
        has_pose = self.q_camera_from_target_wxyz is not None and self.t_camera_from_target_m is not None
        numbers = (
            (*self.q_camera_from_target_wxyz, *self.t_camera_from_target_m)  # type: ignore[misc]
            if has_pose
            else (0.0,) * 7
        )
        if not all(math.isfinite(x) for x in numbers) or (self.accepted and not has_pose):
            raise PacketError(f"frame {self.frame_id}: an accepted pose must be present and finite")
        reason = pack_text(self.reason, MAX_TEXT_BYTES)
        stages = self.stages_ms[:MAX_STAGES]
        _check_pose(self.frame_id, numbers, self.confidence, [ms for _, ms in stages], has_pose=has_pose)
        fixed = self.LAYOUT.pack(
            self.frame_id,
            self.accepted,
            has_pose,
            len(stages),
            self.confidence,
            *numbers,
            self.receive_ns,
            self.start_ns,
            self.end_ns,
            len(reason),
            0,
        )
        rows = (self.STAGE.pack(pack_text(name, 24), ms) for name, ms in stages)
        fields = pack_fields([(FieldTag.COVARIANCE, pack_covariance(self.covariance))])
        return b"".join((fixed, *rows, reason, fields))

    @classmethod
    def decode(cls, data: bytes) -> PoseMessage:
        """Decode the message of a payload.

        Returns
        -------
        PoseMessage
            Message; pose and covariance are None if they are absent, the reason is cut to ``MAX_TEXT_BYTES``.

        Raises
        ------
        PacketError
            If the payload has another length or impossible values.
        """
        values = unpack_fixed(cls.LAYOUT, data, "POSE", tail=True)
        frame_id, accepted, has_pose, stage_count, confidence = values[:5]
        numbers, (receive_ns, start_ns, end_ns, reason_bytes, _) = values[5:12], values[12:]
        offset = cls.LAYOUT.size + stage_count * cls.STAGE.size
        end = offset + reason_bytes
        if stage_count > MAX_STAGES or len(data) < end:
            raise PacketError(f"a POSE payload of {len(data)} bytes does not fit its own counts")
        if accepted > 1 or has_pose > 1 or (accepted and not has_pose):
            raise PacketError(f"frame {frame_id}: a POSE contradicts itself")
        stages = tuple(
            (unpack_text(name), float(ms))
            for name, ms in cls.STAGE.iter_unpack(data[cls.LAYOUT.size : offset])
        )
        _check_pose(frame_id, numbers, confidence, [ms for _, ms in stages], has_pose=bool(has_pose))
        fields = unpack_fields(data[end:], POSE_FIELDS, "POSE")
        return cls(
            frame_id,
            bool(accepted),
            unpack_sentence(data[offset:end]),
            numbers[:4] if has_pose else None,
            numbers[4:] if has_pose else None,
            confidence,
            stages,
            receive_ns,
            start_ns,
            end_ns,
            unpack_covariance(fields.get(FieldTag.COVARIANCE)),
        )


def _check_pose(
    frame_id: int, numbers: Sequence[float], confidence: float, stages_ms: Sequence[float], *, has_pose: bool
) -> None:
    """Raise PacketError for an impossible pose; it is neither scored nor repaired."""
    if not all(math.isfinite(x) for x in (*numbers, confidence, *stages_ms)):
        raise PacketError(f"frame {frame_id}: a POSE holds numbers that are not finite")
    length = math.hypot(*numbers[:4])
    if has_pose and abs(length - 1.0) > QUATERNION_TOLERANCE:
        raise PacketError(
            f"frame {frame_id}: the quaternion of a POSE has length {length:.6g}: make it 1"
            f" (within {QUATERNION_TOLERANCE:g})"
        )
    if any(abs(x) > MAX_POSITION_M for x in numbers[4:]):
        raise PacketError(
            f"frame {frame_id}: the position of a POSE is beyond {MAX_POSITION_M:g} m: send metres"
        )
    if not 0.0 <= confidence <= 1.0:
        raise PacketError(f"frame {frame_id}: the confidence of a POSE is {confidence:g}: it must be 0 to 1")
    if any(not 0.0 <= ms <= MAX_STAGE_MS for ms in stages_ms):
        raise PacketError(
            f"frame {frame_id}: a stage of a POSE has a negative duration, or one over {MAX_STAGE_MS:g} ms"
        )


@dataclass(frozen=True)
class Credit:
    """Board to host: frames up to ``frame_id`` are released; ``window`` frames may be in transit."""

    TYPE: ClassVar[PacketType] = PacketType.CREDIT
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<IHH")

    frame_id: int
    window: int

    def encode(self) -> bytes:
        """Encode the message as a payload.

        Returns
        -------
        bytes
            Payload of 8 bytes.
        """
        return self.LAYOUT.pack(self.frame_id, self.window, 0)

    @classmethod
    def decode(cls, data: bytes) -> Credit:
        """Decode the message of a payload.

        Returns
        -------
        Credit
            Last frame that is released, and number of frames that may be in transit.

        Raises
        ------
        PacketError
            If the payload has another length.
        """
        return cls(*unpack_fixed(cls.LAYOUT, data, "CREDIT")[:2])


@dataclass(frozen=True)
class TruthMessage:
    """Host to loggers or, inline, to the board: ground truth of a frame."""

    TYPE: ClassVar[PacketType] = PacketType.TRUTH
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<II")

    frame_id: int
    truth: Dict[str, Any] = field(default_factory=dict)

    def encode(self) -> bytes:
        """Encode the message as a payload.

        Returns
        -------
        bytes
            Fixed fields, then the truth as JSON.
        """
        data = pack_json(self.truth)
        return self.LAYOUT.pack(self.frame_id, len(data)) + data

    @classmethod
    def decode(cls, data: bytes) -> TruthMessage:
        """Decode the message of a payload.

        Returns
        -------
        TruthMessage
            Message with the truth as a dictionary.

        Raises
        ------
        PacketError
            If the payload has another length or impossible values.
        """
        frame_id, size = unpack_fixed(cls.LAYOUT, data, "TRUTH", tail=True)
        if len(data) - cls.LAYOUT.size != size:
            raise PacketError(f"a TRUTH payload has {len(data) - cls.LAYOUT.size} bytes, expected {size}")
        return cls(frame_id, unpack_json(data[cls.LAYOUT.size :], MAX_TRUTH_JSON_BYTES))
