"""Messages between the run and the link process, and the shared memory of the pixels."""

from __future__ import annotations

import math
import mmap
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, Literal

import msgspec
import numpy as np

from flyaround.hil.link.session import SILENCE_S
from flyaround.simulator.runtime.untrusted_files import refuse_not_finite
from flyaround.simulator.scenario.faults import NO_FAULTS, Faults

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.hil.host.frame_record import FrameRecord
    from flyaround.hil.link.packets.messages import HelloAck
    from flyaround.simulator.runtime.arrays import Vec3
    from flyaround.simulator.scenario.faults import LineFault

Compression = Literal["auto", "raw", "zstd", "png"]
PixelFormatName = Literal["auto", "Mono8", "Mono10", "Mono12p", "Mono16", "RGB8"]
TruthWhere = Literal["off", "separate", "inline"]
RunMode = Literal["lockstep", "realtime"]
Count = Annotated[int, msgspec.Meta(ge=0)]


@dataclass(frozen=True, kw_only=True)
class LinkConfig:
    """Settings of the link process, fixed for a run.

    Parameters
    ----------
    url : str
        Address for the board; port 0 chooses a free one.
    mode : RunMode
        Pace of the run.
    truth : TruthWhere
        Destination of the ground truth.
    timeout_s : float
        Time-out of a frame's pose, and of the run for a lost board.
    truth_url : str, optional
        Address for truth loggers; None without a truth endpoint.
    compression : Compression, optional
        Requested compression; auto chooses a fast one for the line.
    pixel_format : PixelFormatName, optional
        Requested pixel format; auto chooses one that holds the image without loss.
    silence_s : float, optional
        Silence after which a board that requests the time is considered lost.
    max_misses : int, optional
        Number of consecutive unanswered frames after which a board counts as lost; 0 for no limit.
    faults : Faults, optional
        Faults of the run; those of the line are inserted between board and link.
    adds_faults : bool, optional
        True if faults of the line may be added during the run.
    utc_minus_monotonic_ns : int, optional
        Offset between this machine's clocks, read once per run.
    key : bytes, optional
        Key that boards and truth loggers must prove to know; None disables authentication.

    Raises
    ------
    UserError
        If a time is not finite.
    """

    url: str
    mode: RunMode
    truth: TruthWhere
    timeout_s: float
    truth_url: str | None = None
    compression: Compression = "auto"
    pixel_format: PixelFormatName = "auto"
    silence_s: float = SILENCE_S
    max_misses: int = 3
    faults: Faults = NO_FAULTS
    adds_faults: bool = False
    utc_minus_monotonic_ns: int = 0
    key: bytes | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        refuse_not_finite(vars(self), "the link")


@dataclass(frozen=True)
class Terms:
    """Terms from the first frame: terms of the handshake, and the size of a slot."""

    ack: HelloAck
    n_slots: int
    slot_bytes: int


@dataclass(frozen=True)
class Readout:
    """Region of the detector that an image shows: x, y, width, height in physical pixels, zeros if unknown."""

    roi_px: tuple[int, int, int, int] = (0, 0, 0, 0)
    binning: int = 1


@dataclass(frozen=True, kw_only=True)
class FrameJob:
    """Frame to send: its record so far, and its pixels.

    Parameters
    ----------
    record : FrameRecord
        Record with the time at which the camera hands the image over, on the monotonic clock shared by all processes of
        this machine.
    bits : int
        Bits per pixel of the detector.
    truth : dict, optional
        Truth record for the truth endpoint or, inline, for the board.
    camera_frame : int
        Frame counter of the camera.
    readout : Readout
        Region of the detector that was read.
    sun_camera : (3,) tuple, optional
        Unit vector to the Sun in the camera frame, for boards that accept optional fields.
    slot : int
        Slot of the pixels, set when they are handed over.
    shape : tuple of int
        Shape of the image.
    dtype : str
        Data type of the pixels.
    """

    record: FrameRecord
    bits: int
    truth: dict[str, Any] | None = None
    camera_frame: int = 0
    readout: Readout = Readout()
    sun_camera: Vec3 | None = None
    slot: int = 0
    shape: tuple[int, ...] = ()
    dtype: str = ""


@dataclass(frozen=True)
class AddLineFault:
    """Additional fault of the line, effective immediately."""

    fault: LineFault


@dataclass(frozen=True)
class Close:
    """Request to end the session with a goodbye to board and loggers."""

    reason: str


@dataclass(frozen=True)
class Listening:
    """Confirmation that the ports are open."""

    url: str
    truth_url: str | None


@dataclass(frozen=True)
class BoardGreeted:
    """Admission of a board after its HELLO; its estimator may not be ready yet."""


class Board(msgspec.Struct, frozen=True, kw_only=True):
    """Board that answered last, from its HELLO."""

    name: str
    model: str
    model_sha256: str = ""
    method: str
    encoding: str
    window: int


@dataclass(frozen=True)
class BoardUp:
    """Board is ready after the handshake."""

    peer: str
    board: Board
    takes_fields: bool = False


@dataclass(frozen=True)
class BoardDown:
    """Board is lost or was refused."""

    reason: str


@dataclass(frozen=True)
class SlotFree:
    """Slot whose pixels are no longer needed."""

    slot: int


class LinkTotals(msgspec.Struct, frozen=True, kw_only=True):
    """Counts of the link; ``protocol_mistakes`` are intact packets that violate the protocol.

    ``mistakes`` counts them by kind.
    """

    packets_sent: Count = 0
    packets_received: Count = 0
    packets_corrupt: Count = 0
    protocol_mistakes: Count = 0
    mistakes: dict[str, Count] = {}
    sequence_gaps: Count = 0
    sessions: Count = 0
    late_poses: Count = 0
    clock_round_trip_ms: float | None = None
    clock_round_trip_ms_p50: float | None = None
    clock_round_trip_ms_p99: float | None = None
    clock_round_trip_ms_max: float | None = None
    clock_offset_bound_ms: float | None = None
    clock_drift_ppm: float | None = None
    clock_drift_ppm_sigma: float | None = None


class FrameSlots:
    """Pixels in memory shared by two processes, in ``n_slots`` slots, which bound the queue.

    The memory is an anonymous file (`flyaround.simulator.runtime.carrier`), so nothing remains when a process dies.
    """

    def __init__(self, fd: int, n_slots: int, slot_bytes: int) -> None:
        self._slot_bytes = slot_bytes
        self._map = mmap.mmap(fd, n_slots * slot_bytes)

    def view(self, slot: int, shape: tuple[int, ...], dtype: str) -> NDArray[np.generic]:
        """Return the slot as an image that shares its memory."""
        count = math.prod(shape)
        offset = slot * self._slot_bytes
        return np.frombuffer(self._map, np.dtype(dtype), count, offset).reshape(shape)
