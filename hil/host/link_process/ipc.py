"""Messages between the run and the link process, and the shared memory of the pixels."""

from __future__ import annotations

import math
import mmap
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, Literal

import msgspec
import numpy as np

from flyaround.hil.link.session import SILENCE_S
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
        Address for the board; port 0 takes a free one.
    mode : RunMode
        Pace of the run; destination of the truth.
    truth : TruthWhere
        Pace of the run; destination of the truth.
    timeout_s : float
        Time-out of a frame's pose, and of the run for a lost board.
    truth_url : str, optional
        Address for truth loggers; None for no such endpoint.
    compression : Compression, optional
        The host's wishes; auto takes what is quick on the line, and holds the image whole.
    pixel_format : PixelFormatName, optional
        The host's wishes; auto takes what is quick on the line, and holds the image whole.
    silence_s : float, optional
        A board that asked for the time, and then says nothing for this long, is gone.
    max_misses : int, optional
        Frames in a row that a board may leave unanswered before it counts as gone; 0 for any number.
    faults : Faults, optional
        Those of the line are put between the board and the link.
    adds_faults : bool, optional
        True if more of the line may come during the run.
    utc_minus_monotonic_ns : int, optional
        Difference of this machine's clocks, read once for a run.
    key : bytes, optional
        Key that boards and truth loggers must prove to have; None for no authentication.
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


@dataclass(frozen=True)
class Terms:
    """Terms from the first frame: the handshake's terms and the size of a slot."""

    ack: HelloAck
    n_slots: int
    slot_bytes: int


@dataclass(frozen=True)
class Readout:
    """Part of the detector that an image shows: x, y, width, height in physical pixels, zeros if unknown."""

    roi_px: tuple[int, int, int, int] = (0, 0, 0, 0)
    binning: int = 1


@dataclass(frozen=True, kw_only=True)
class FrameJob:
    """Frame to send: its record so far, and its pixels.

    Parameters
    ----------
    record : FrameRecord
        With the time at which the camera hands the image over, on the monotonic clock that all processes of this
        machine share.
    bits : int
        Bits of a pixel of the detector.
    truth : dict, optional
        Truth record for the truth endpoint or, inline, for the board.
    camera_frame : int
        The camera's own frame counter.
    readout : Readout
        Part of the detector that was read.
    sun_camera : (3,) tuple, optional
        Unit vector to the Sun in the camera frame, for boards that take fields.
    slot, shape, dtype : int, tuple of int, str
        Place and layout of the pixels, set when they are handed over.
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
    """Additional fault of the line, from now on."""

    fault: LineFault


@dataclass(frozen=True)
class Close:
    """Request to end the session: goodbye to board and loggers."""

    reason: str


@dataclass(frozen=True)
class Listening:
    """Confirmation that the ports are open."""

    url: str
    truth_url: str | None


@dataclass(frozen=True)
class Failed:
    """Failure of the link process; one sentence for the user."""

    sentence: str


@dataclass(frozen=True)
class BoardGreeted:
    """Admission of a board after its HELLO; its estimator may not be ready yet."""


class Board(msgspec.Struct, frozen=True, kw_only=True):
    """Board that answered last, by its HELLO."""

    name: str
    model: str
    model_sha256: str = ""
    method: str
    encoding: str
    window: int


@dataclass(frozen=True)
class BoardUp:
    """Board ready after the handshake."""

    peer: str
    board: Board
    takes_fields: bool = False


@dataclass(frozen=True)
class BoardDown:
    """Board gone or refused."""

    reason: str


@dataclass(frozen=True)
class SlotFree:
    """Slot whose pixels are no longer needed."""

    slot: int


class LinkTotals(msgspec.Struct, frozen=True, kw_only=True):
    """Counts of the link; ``protocol_mistakes`` are intact packets that violate the protocol.

    ``mistakes`` counts them by their kind, in words.
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


@dataclass(frozen=True)
class Closed:
    """Last message of the link process."""

    counts: LinkTotals


class FrameSlots:
    """Pixels in memory shared by two processes, in ``n_slots`` slots, which bound the queue.

    An anonymous file carries it (`flyaround.simulator.runtime.carrier`); nothing is left behind when a process dies.
    """

    def __init__(self, fd: int, n_slots: int, slot_bytes: int) -> None:
        self._slot_bytes = slot_bytes
        self._map = mmap.mmap(fd, n_slots * slot_bytes)

    def view(self, slot: int, shape: tuple[int, ...], dtype: str) -> NDArray[np.generic]:
        """Return the slot as an image that shares its memory."""
        count = math.prod(shape)
        offset = slot * self._slot_bytes
        return np.frombuffer(self._map, np.dtype(dtype), count, offset).reshape(shape)
