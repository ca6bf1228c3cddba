"""Image acquisition of the simulated camera: requests to the renderer, and transmission to the controller."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from flyaround.hil.host.camera_endpoint.gvsp import Block, ReadoutRegion, StreamFormat, pixels_of
from flyaround.hil.host.camera_endpoint.messages import ImageRequest, ImageResult, PictureOutcome
from flyaround.hil.host.camera_endpoint.registers import CONTINUOUS, SINGLE_FRAME, TICKS_PER_S, Register
from flyaround.hil.host.frame_record import FrameRecord, FrameTimes

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.hil.host.camera_endpoint.answer_port import AnswerPort
    from flyaround.hil.host.camera_endpoint.registers import Registers
    from flyaround.hil.host.camera_endpoint.stream_channel import StreamChannel


@dataclass(frozen=True)
class _Due:
    """Requested frame, with the controller's settings at the time of the request."""

    request_id: int
    request_ns: int
    timestamp_ns: int
    exposure_s: float
    region: ReadoutRegion
    pixel_format: StreamFormat


class Acquisition:
    """State machine of the image acquisition. One frame is requested at a time, of the newest state.

    Parameters
    ----------
    registers : Registers
        The camera's registers, which the controller reads and writes.
    stream : StreamChannel
        Channel on which images are sent.
    send : callable
        Sends a message to the render process.
    """

    def __init__(self, registers: Registers, stream: StreamChannel, send: Callable[[object], None]) -> None:
        self._registers, self._stream, self._send_message = registers, stream, send
        self.answers: AnswerPort | None = None
        """Port for answers of boards; None without one."""
        self._origin_ns = time.monotonic_ns()
        self._started_s = 0.0
        self.next_s = 0.0
        """Monotonic time at which the next frame is due [s]."""
        self.triggered = False
        self._frames_left: int | None = None
        self._number = self._block_id = self._sent = self._request_id = 0
        self._due: _Due | None = None
        self._exposed: ImageResult | None = None

    # --- commands of the controller ---------------------------------------------------------

    def start(self) -> None:
        """Start acquiring in the current mode, unless already running."""
        registers = self._registers
        registers[Register.ACQUISITION_START] = 0
        if registers.acquiring:
            return
        mode = registers[Register.ACQUISITION_MODE]
        self._frames_left = (
            None
            if mode == CONTINUOUS
            else 1
            if mode == SINGLE_FRAME
            else registers[Register.ACQUISITION_FRAME_COUNT]
        )
        registers.acquiring = True
        self._number = self._block_id = self._sent = 0
        self.triggered = False
        self._forget()
        self._stream.stop()
        if self.answers is not None:
            self.answers.restart()
        self._started_s = self.next_s = time.monotonic()

    def stop(self) -> None:
        """Stop acquiring, and discard an image in progress."""
        self._registers.acquiring = False
        self._forget()
        self._stream.stop()

    def _forget(self) -> None:
        """Discard the requested image."""
        if self._exposed is not None:
            self._report_unsent(self._exposed)
        self._due = self._exposed = None

    def trigger(self) -> None:
        """Request one frame by software trigger, if acquisition is running."""
        self._registers[Register.TRIGGER_SOFTWARE] = 0
        self.triggered = self._registers.acquiring

    def control_timestamp(self) -> None:
        """Latch the time stamp into its registers, or reset it, as written by the controller."""
        if self._registers[Register.TIMESTAMP_CONTROL] == 1:
            self._origin_ns = time.monotonic_ns()
        else:
            now = time.monotonic_ns() - self._origin_ns
            self._registers[Register.TIMESTAMP_HIGH] = now >> 32
            self._registers[Register.TIMESTAMP_LOW] = now
        self._registers[Register.TIMESTAMP_CONTROL] = 0

    # --- frames -----------------------------------------------------------------------------

    @property
    def wants_frame(self) -> bool:
        """True if the next frame may be requested: none is in progress and, in trigger mode, a trigger was received."""
        if not self._registers.acquiring or self._due is not None or not self._stream.has_room:
            return False
        return self.triggered or not self._registers[Register.TRIGGER_MODE]

    @property
    def _interval_s(self) -> float:
        """Interval between frames, at least the exposure time [s]."""
        registers = self._registers
        return max(
            1 / registers.number(Register.ACQUISITION_FRAME_RATE),
            1e-6 * registers.number(Register.EXPOSURE_TIME),
        )

    def request_frame(self, now_s: float) -> None:
        """Request an image from the renderer when due."""
        registers = self._registers
        if not self.wants_frame or now_s < self.next_s:
            return
        if registers[Register.TRIGGER_MODE]:
            self.next_s = now_s
        else:
            # keep the frame rate if possible; frames missed by a slow renderer are skipped
            self.next_s = max(self.next_s + self._interval_s, now_s)
        self.triggered = False
        self._request_id += 1
        request_ns, exposure_s = time.monotonic_ns(), 1e-6 * registers.number(Register.EXPOSURE_TIME)
        self._due = _Due(
            self._request_id,
            request_ns,
            request_ns - self._origin_ns,
            exposure_s,
            registers.region,
            registers.pixel_format,
        )
        self._send_message(
            ImageRequest(
                request_id=self._request_id,
                number=self._number,
                t_s=now_s - self._started_s,
                exposure_s=exposure_s,
                gain_db=registers.number(Register.GAIN),
            )
        )
        self._number += 1

    def take(self, result: ImageResult) -> None:
        """Store a rendered image until its exposure is over. Reject one of a stopped acquisition."""
        if self._due is None or result.request_id != self._due.request_id:
            self._report_unsent(result)
        else:
            self._exposed = result

    @property
    def read_out_s(self) -> float | None:
        """Monotonic time from which the image may be sent, the end of its exposure [s]; None without an image."""
        if self._exposed is None or self._due is None:
            return None
        return self._due.request_ns * 1e-9 + self._due.exposure_s

    def send_exposed(self, now_s: float, receiver: tuple[str, int] | None) -> None:
        """Send the image, once its exposure is over, to the controller's stream address ``receiver``, if set."""
        picture, due, read_out_s = self._exposed, self._due, self.read_out_s
        if picture is None or due is None or read_out_s is None or now_s < read_out_s:
            return
        self._exposed = self._due = None
        if not self._send(picture, due, receiver):
            self._report_unsent(picture)

    def _report_unsent(self, result: ImageResult) -> None:
        if self.answers is not None:
            self._send_message(PictureOutcome(result.request_id, None))

    def _send(self, result: ImageResult, due: _Due, to: tuple[str, int] | None) -> bool:
        """Start sending an image; return False if there is no receiver."""
        registers = self._registers
        if self._frames_left is not None:
            self._frames_left -= 1
            registers.acquiring = self._frames_left > 0
        if to is None:
            return False
        self._block_id = self._block_id % 0xFFFF + 1
        block = Block(
            block_id=self._block_id,
            timestamp_ns=due.timestamp_ns,
            pixel_format=due.pixel_format,
            region=due.region,
            data=pixels_of(result.image, self._registers.terms.bits, due.region, due.pixel_format),
            packet_bytes=registers[Register.STREAM_PACKET_BYTES] & 0xFFFF,
        )
        delay_s = registers[Register.STREAM_PACKET_DELAY] / TICKS_PER_S
        self._stream.start(block, to, time.monotonic(), interval_s=self._interval_s, delay_s=delay_s)
        registers[Register.FRAMES_SENT] = registers[Register.FRAMES_SENT] + 1
        if self.answers is not None:
            self.answers.sent(_record(due), self._sent)
        self._sent += 1
        return True


def _record(due: _Due) -> FrameRecord:
    """Return the record of an image that is being sent; the render process adds time and epoch of its scene."""
    now_ns = time.monotonic_ns()
    latency_s = (now_ns - due.request_ns) * 1e-9 - due.exposure_s
    return FrameRecord(
        frame_id=due.request_id,
        epoch_utc="",
        t_s=0.0,
        exposure_s=due.exposure_s,
        times=FrameTimes(latency_s=latency_s, drawn_ns=now_ns),
    )
