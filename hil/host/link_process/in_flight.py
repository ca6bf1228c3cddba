"""Frames in flight: those without an outcome, and those that use the board's credit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from flyaround.hil.link.packets.messages import NO_FRAME

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.hil.host.frame_record import FrameRecord
    from flyaround.hil.link.packets.messages import PoseMessage

# End of sending of a frame that is still being sent
NOT_SENT_NS = 1 << 62
# Number of frames for which it is stored whether they were sent and answered
MAX_HISTORY = 100_000


@dataclass
class FrameInFlight:
    """Frame that was sent and has no outcome yet."""

    record: FrameRecord
    deadline_ns: int
    damage_seen: bool = False


class FramesInFlight:
    """Frames that were sent. Each gets exactly one outcome: a pose, or a drop with its cause.

    Parameters
    ----------
    report : callable
        Receives the record of each frame with its outcome, once.
    timeout_s : float
        Time from the start of sending after which a frame without a pose is dropped.
    """

    def __init__(self, report: Callable[[FrameRecord], None], timeout_s: float) -> None:
        self._report = report
        self._timeout_s = timeout_s
        self._flying: dict[int, FrameInFlight] = {}
        self._held: dict[int, int] = {}  # end of sending, by frame
        self._history: dict[int, bool] = {}  # True if answered, by frame
        self.misses = 0
        """Number of consecutive frames that timed out since the board last answered one."""
        self._missed_ns = 0  # time of the last miss

    def is_flying(self, frame_id: int) -> bool:
        """Return True if a frame was started and has no outcome yet."""
        return frame_id in self._flying

    @property
    def held(self) -> int:
        """Number of frames at the board, answered or not, that use credit."""
        return len(self._held)

    @property
    def first_deadline_ns(self) -> int | None:
        """Earliest time-out of a frame; None if none is in flight."""
        return min((flight.deadline_ns for flight in self._flying.values()), default=None)

    def start(self, record: FrameRecord, at_ns: int) -> FrameInFlight:
        """Start sending a frame."""
        record = record.with_times(send_start_ns=at_ns, send_end_ns=at_ns)
        flight = FrameInFlight(record, at_ns + int(self._timeout_s * 1e9))
        self._flying[record.frame_id] = flight
        self._history[record.frame_id] = False
        if len(self._history) > MAX_HISTORY:
            del self._history[next(iter(self._history))]
        self._held[record.frame_id] = NOT_SENT_NS
        return flight

    def sent(self, flight: FrameInFlight, at_ns: int) -> None:
        """Record that the last byte of a frame was sent."""
        flight.record = flight.record.with_times(send_end_ns=at_ns)
        if flight.record.frame_id in self._held:
            self._held[flight.record.frame_id] = at_ns

    @property
    def last_sent_ns(self) -> int | None:
        """End of sending of the newest frame at the board; None if it holds none."""
        return max(self._held.values(), default=None)

    def unanswered(self, at_ns: int) -> int:
        """Return the number of consecutive misses by ``at_ns``: frames timed out without signs of damage on the line.

        A board that keeps the credit of such frames receives no more frames; each further silent time-out counts as a
        miss. Frames that were never sent do not count.
        """
        overdue = sum(at_ns >= f.deadline_ns and not f.damage_seen for f in self._flying.values())
        silent = 0
        if self.misses and self._held and not self._flying:
            silent = (at_ns - self._missed_ns) // int(self._timeout_s * 1e9)
        return self.misses + overdue + silent

    def was_sent(self, frame_id: int) -> bool:
        """Return True if sending the frame was started."""
        return frame_id in self._history

    def violation_of(self, frame_id: int) -> str:
        """Return the protocol violation of an answer to a frame; empty if the answer is allowed, in time or late."""
        if frame_id not in self._history:
            return "an answer to a frame that was never sent"
        return "a second answer to a frame" if self._history[frame_id] else ""

    def answer(
        self, pose: PoseMessage, at_ns: int, clock_offset_ns: int | None, clock_bound_ns: int | None = None
    ) -> bool:
        """Record a pose received at ``at_ns``; return False if its frame had an outcome already."""
        flight = self._flying.pop(pose.frame_id, None)
        self._history[pose.frame_id] = True
        self.misses = 0  # late or not, the board works
        if flight is not None:
            start_ns, end_ns = flight.record.times.send_start_ns, flight.record.times.send_end_ns
            self._report(
                flight.record.with_outcome(
                    "accepted" if pose.accepted else "declined",
                    pose.reason,
                    # a board that is read between chunks may answer before the end of sending is recorded
                    send_end_ns=at_ns if end_ns == start_ns else end_ns,
                    received_ns=at_ns,
                    answer=pose,
                    clock_offset_ns=clock_offset_ns,
                    clock_bound_ns=clock_bound_ns,
                )
            )
        self.release(pose.frame_id)
        return flight is not None

    def release(self, frame_id: int) -> None:
        """Release frames up to this one from the board; those without an answer are dropped."""
        self.misses = 0
        self._held = {held: sent for held, sent in self._held.items() if held > frame_id}
        for passed in [f for f in self._flying if f <= frame_id]:
            if self._flying[passed].damage_seen:
                self._drop(passed, "corrupt", "frame or pose was damaged on the line")
            else:
                self._drop(passed, "skipped", "the board released the frame without an answer")

    def note_damage(self) -> None:
        """Record a damaged packet, which may belong to any frame in flight."""
        for flight in self._flying.values():
            flight.damage_seen = True

    def damaged(self, frame_id: int, reason: str, cause: str = "corrupt") -> bool:
        """Record that the board cannot use this frame, and release only this one; return False if not in flight."""
        self.misses = 0  # late or not, the board has processed it
        flying = frame_id in self._flying
        if flying:
            self._drop(frame_id, cause, reason)
        self._held.pop(frame_id, None)
        return flying

    def drop_unreceived(self, asked_ns: int, newest_frame: int) -> None:
        """Drop frames that did not reach the board, according to the newest frame that it reports.

        Parameters
        ----------
        asked_ns : int
            Time of the question; frames whose sending ended before it should have arrived.
        newest_frame : int
            Last frame that the board received completely, ``NO_FRAME`` before the first.
        """
        for frame_id, sent_ns in list(self._held.items()):
            if sent_ns >= asked_ns or (newest_frame != NO_FRAME and newest_frame >= frame_id):
                continue
            self.misses = 0  # not the board's fault
            if frame_id in self._flying:
                cause = "corrupt" if self._flying[frame_id].damage_seen else "lost"
                self._drop(frame_id, cause, "it did not reach the board completely")
            del self._held[frame_id]

    def refuse(self, frame_id: int, reason: str) -> bool:
        """Record that the board's answer to this frame is unusable; return False if not in flight."""
        flying = frame_id in self._flying
        self.misses = 0  # the board answers, even if incorrectly
        if flying:
            self._drop(frame_id, "protocol", reason)
        if frame_id in self._held:
            self.release(frame_id)
        return flying

    def expire(self, at_ns: int) -> None:
        """Drop the frames that timed out."""
        for frame_id, flight in list(self._flying.items()):
            if at_ns < flight.deadline_ns:
                continue
            cause, why = ("corrupt", "; damaged packets were seen") if flight.damage_seen else ("timeout", "")
            if not flight.damage_seen:
                self.misses += 1
                self._missed_ns = at_ns
            self._drop(frame_id, cause, f"no pose within {self._timeout_s:g} s{why}")
            if flight.damage_seen:
                self._held.pop(frame_id, None)  # it may never have reached the board

    def lose(self, reason: str) -> None:
        """Drop all frames after the board left or restarted."""
        for frame_id in list(self._flying):
            self._drop(frame_id, "disconnected", reason)
        self._held = {}
        self.misses = 0

    def _drop(self, frame_id: int, cause: str, reason: str) -> None:
        self._report(self._flying.pop(frame_id).record.with_outcome(f"dropped:{cause}", reason))
