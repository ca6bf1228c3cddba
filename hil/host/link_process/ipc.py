"""What the run and the link process say to each other, and the memory that carries the pixels."""

from __future__ import annotations

import math
import mmap
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from flyaround.hil.link.session import SILENCE_S
from flyaround.simulator.scenario.faults import NO_FAULTS, Faults

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.hil.link.packets.messages import HelloAck, PoseMessage
    from flyaround.simulator.scenario.faults import LineFault

Compression = Literal["auto", "raw", "zstd", "png"]
PixelFormatName = Literal["auto", "Mono8", "Mono10", "Mono12p", "Mono16", "RGB8"]
TruthWhere = Literal["off", "separate", "inline"]
RunMode = Literal["lockstep", "realtime"]


@dataclass(frozen=True, kw_only=True)
class LinkConfig:
    """How the link process listens; fixed for a run.

    Parameters
    ----------
    url : where the board connects; port 0 takes a free one.
    mode, truth : whether frames wait for poses; where the truth goes.
    timeout_s : how long a frame waits for its pose, and the run for a board that went away.
    truth_url : where truth loggers connect; None for no such endpoint.
    compression, pixel_format : the host's wishes; auto takes what is quick on the line, and holds the image whole.
    silence_s : a board that asked for the time, and then says nothing for so long, is gone.
    max_misses : frames in a row that a board may leave unanswered before it counts as gone; 0 for any number.
    faults : those of the line are put between the board and the link.
    adds_faults : whether more of the line may come during the run.
    utc_minus_monotonic_ns : of this machine's clocks, read once for a run.
    key : that boards and truth loggers must prove to have; None asks nobody.
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
    """What the first frame settled: the handshake's terms and the size of a slot."""

    ack: HelloAck
    n_slots: int
    slot_bytes: int


@dataclass(frozen=True)
class Readout:
    """What part of the detector an image is: x, y, width, height in its physical pixels, zeros where unknown."""

    roi_px: tuple[int, int, int, int] = (0, 0, 0, 0)
    binning: int = 1


@dataclass(frozen=True)
class FrameJob:
    """A frame to send; its pixels lie in ``slot``.

    Parameters
    ----------
    exposure_s, latency_s : the exposure, and how long after its end the camera hands the picture over.
    due_ns : when it does, on the monotonic clock that all processes of this machine share; None for now, as a camera
        that is triggered in time.
    ready_ns : when the picture was there; after ``due_ns`` the camera is late.
    truth : what goes to the truth endpoint or, inline, to the board; None for nothing.
    camera_frame : the camera's own frame counter. readout : what was read of the detector.
    """

    slot: int
    frame_id: int
    shape: tuple[int, ...]
    dtype: str
    bits: int
    epoch_utc: str
    t_s: float
    exposure_s: float
    due_ns: int | None
    truth: dict[str, Any] | None
    latency_s: float = 0.0
    ready_ns: int | None = None
    handed_over_ns: int | None = None
    camera_frame: int = 0
    readout: Readout = Readout()

    @property
    def exposure_ns(self) -> tuple[int, int] | None:
        """Start and end of the exposure: the latency before the picture is due, or was handed over."""
        over_ns = self.handed_over_ns if self.due_ns is None else self.due_ns
        if over_ns is None:
            return None
        end_ns = over_ns - round(1e9 * self.latency_s)
        return end_ns - round(1e9 * self.exposure_s), end_ns

    def result(self, outcome: str, reason: str) -> FrameResult:
        """The frame's outcome, with all that is known of it before it was sent."""
        return FrameResult(
            self.frame_id,
            outcome,
            reason,
            self.due_ns,
            ready_ns=self.ready_ns,
            handed_over_ns=self.handed_over_ns,
            exposure_ns=self.exposure_ns,
        )


@dataclass(frozen=True)
class AddLineFault:
    """One more fault of the line, from now on."""

    fault: LineFault


@dataclass(frozen=True)
class Close:
    """End the session: say goodbye to board and loggers."""

    reason: str


@dataclass(frozen=True)
class Listening:
    """The ports are open, here."""

    url: str
    truth_url: str | None


@dataclass(frozen=True)
class Failed:
    """The link process cannot work; one sentence for the user."""

    sentence: str


@dataclass(frozen=True)
class BoardGreeted:
    """A board said HELLO and was let in; its estimator may not be ready yet."""


@dataclass(frozen=True)
class BoardUp:
    """A board shook hands and is ready."""

    peer: str
    board: str
    model_name: str
    method: str
    encoding: str
    window: int
    model_sha256: str = ""


@dataclass(frozen=True)
class BoardDown:
    """The board left, or was refused."""

    reason: str


@dataclass(frozen=True)
class SlotFree:
    """The pixels of a slot are no longer needed."""

    slot: int


@dataclass(frozen=True)
class FrameResult:
    """What became of a frame; times are the link process's monotonic clock [ns].

    Parameters
    ----------
    outcome : accepted, declined or dropped:CAUSE.
    due_ns, ready_ns, handed_over_ns, exposure_ns : as of `FrameJob`; handed over when the link took it up, sent or not.
    clock_offset_ns, clock_bound_ns : board's clock minus the host's, and how far off it may be; None while unknown.
    faults : of the line that struck the frame or its answer, on purpose.
    """

    frame_id: int
    outcome: str
    reason: str
    due_ns: int | None = None
    send_start_ns: int | None = None
    send_end_ns: int | None = None
    received_ns: int | None = None
    pose: PoseMessage | None = None
    clock_offset_ns: int | None = None
    clock_bound_ns: int | None = None
    faults: tuple[str, ...] = ()
    ready_ns: int | None = None
    handed_over_ns: int | None = None
    exposure_ns: tuple[int, int] | None = None


@dataclass(frozen=True)
class LinkCounts:
    """The link's own counts over a run; ``protocol_mistakes`` are intact packets that the protocol does not allow."""

    packets_sent: int = 0
    packets_received: int = 0
    packets_corrupt: int = 0
    protocol_mistakes: int = 0
    mistakes: dict[str, int] = field(default_factory=dict)
    sequence_gaps: int = 0
    sessions: int = 0
    late_poses: int = 0
    clock_round_trip_ns: int | None = None
    clock_round_trip_ns_p50: int | None = None
    clock_round_trip_ns_p99: int | None = None
    clock_round_trip_ns_max: int | None = None
    clock_offset_bound_ns: int | None = None
    clock_drift_ppm: float | None = None
    clock_drift_ppm_sigma: float | None = None


@dataclass(frozen=True)
class Closed:
    """The link process's last word."""

    counts: LinkCounts


class FrameSlots:
    """Pixels in memory that two processes share, in ``n_slots`` slots: the bound of the queue.

    An anonymous file carries it (`flyaround.simulator.runtime.carrier`); nothing is left behind when a process dies.
    """

    def __init__(self, fd: int, n_slots: int, slot_bytes: int) -> None:
        self._slot_bytes = slot_bytes
        self._map = mmap.mmap(fd, n_slots * slot_bytes)

    def view(self, slot: int, shape: tuple[int, ...], dtype: str) -> NDArray[np.generic]:
        """The slot as an image that shares its memory."""
        count = math.prod(shape)
        offset = slot * self._slot_bytes
        return np.frombuffer(self._map, np.dtype(dtype), count, offset).reshape(shape)
