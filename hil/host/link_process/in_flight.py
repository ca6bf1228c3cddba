"""Frames sent: those without an outcome, and those that use up the board's credit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from flyaround.hil.link.packets.messages import NO_FRAME

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.hil.host.frame_record import FrameRecord
    from flyaround.hil.link.packets.messages import PoseMessage

# a frame that is still being sent
NEVER_NS = 1 << 62
# frames of which it is known whether they were sent, and answered
MAX_REMEMBERED = 100_000


@dataclass
class FrameInFlight:
    """Frame sent, without an outcome yet."""

    record: FrameRecord
    deadline_ns: int
    damage_seen: bool = False


class FramesInFlight:
    """Frames sent; each gets one outcome: a pose, or a drop with its cause.

    Parameters
    ----------
    report : callable
        Takes the record of each frame with its outcome, once.
    timeout_s : float
        A frame without a pose this long after its sending began is dropped.
    """

    def __init__(self, report: Callable[[FrameRecord], None], timeout_s: float) -> None:
        self._report = report
        self._timeout_s = timeout_s
        self._flying: dict[int, FrameInFlight] = {}
        self._held: dict[int, int] = {}  # end of sending by frame
        self._history: dict[int, bool] = {}  # frames that were begun, and whether each was answered
        self.misses = 0
        """Frames timed out since the last message of the board about one."""
        self._missed_ns = 0  # time of the last one

    def is_flying(self, frame_id: int) -> bool:
        """Return True if a frame was begun and has no outcome yet."""
        return frame_id in self._flying

    @property
    def held(self) -> int:
        """Frames at the board, answered or not, that use up credit."""
        return len(self._held)

    @property
    def first_deadline_ns(self) -> int | None:
        """Next timeout of a frame; None without one in flight."""
        return min((flight.deadline_ns for flight in self._flying.values()), default=None)

    def start(self, record: FrameRecord, at_ns: int) -> FrameInFlight:
        """Begin sending a frame."""
        record = record.at(send_start_ns=at_ns, send_end_ns=at_ns)
        flight = FrameInFlight(record, at_ns + int(self._timeout_s * 1e9))
        self._flying[record.frame_id] = flight
        self._history[record.frame_id] = False
        if len(self._history) > MAX_REMEMBERED:
            del self._history[next(iter(self._history))]
        self._held[record.frame_id] = NEVER_NS
        return flight

    def sent(self, flight: FrameInFlight, at_ns: int) -> None:
        """Note that the last byte of a frame was sent."""
        flight.record = flight.record.at(send_end_ns=at_ns)
        if flight.record.frame_id in self._held:
            self._held[flight.record.frame_id] = at_ns

    @property
    def last_sent_ns(self) -> int | None:
        """End of sending of the newest frame at the board; None if it holds none."""
        return max(self._held.values(), default=None)

    def unanswered(self, at_ns: int) -> int:
        """Return the consecutive misses by ``at_ns``: frames timed out without a sign of damage on the line.

        A board that keeps the credit of such frames is sent no more; each further time-out without a word of it counts
        as one. Frames that were never sent are no misses.
        """
        overdue = sum(at_ns >= f.deadline_ns and not f.damage_seen for f in self._flying.values())
        silent = 0
        if self.misses and self._held and not self._flying:
            silent = (at_ns - self._missed_ns) // int(self._timeout_s * 1e9)
        return self.misses + overdue + silent

    def was_sent(self, frame_id: int) -> bool:
        """Return True if sending a frame was begun."""
        return frame_id in self._history

    def mistake_of(self, frame_id: int) -> str:
        """Return the fault of an answer to a frame, in words; empty if it may be answered, in time or late."""
        if frame_id not in self._history:
            return "an answer to a frame that was never sent"
        return "a second answer to a frame" if self._history[frame_id] else ""

    def answer(
        self, pose: PoseMessage, at_ns: int, clock_offset_ns: int | None, clock_bound_ns: int | None = None
    ) -> bool:
        """Record a pose received at ``at_ns``; return False if its frame had an outcome already."""
        flight = self._flying.pop(pose.frame_id, None)
        self._history[pose.frame_id] = True
        self.misses = 0  # late or not, it works
        if flight is not None:
            start_ns, end_ns = flight.record.times.send_start_ns, flight.record.times.send_end_ns
            self._report(
                flight.record.ended(
                    "accepted" if pose.accepted else "declined",
                    pose.reason,
                    # a board that is heard between chunks may answer before the end of sending is noted
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
        """Release frames up to this one from the board; those without an answer never get one."""
        self.misses = 0
        self._held = {held: sent for held, sent in self._held.items() if held > frame_id}
        for passed in [f for f in self._flying if f <= frame_id]:
            if self._flying[passed].damage_seen:
                self._drop(passed, "corrupt", "frame or pose was damaged on the line")
            else:
                self._drop(passed, "skipped", "the board released the frame without an answer")

    def note_damage(self) -> None:
        """Note a damaged packet, which may have belonged to any frame in flight."""
        for flight in self._flying.values():
            flight.damage_seen = True

    def damaged(self, frame_id: int, reason: str, cause: str = "corrupt") -> bool:
        """Record that the board cannot use this frame, and release it alone; return False if not in flight."""
        self.misses = 0  # late or not, the board has processed it
        flying = frame_id in self._flying
        if flying:
            self._drop(frame_id, cause, reason)
        self._held.pop(frame_id, None)
        return flying

    def lost_on_the_line(self, asked_ns: int, newest_frame: int) -> None:
        """Give up frames that did not reach the board complete, by the newest frame it reports.

        Parameters
        ----------
        asked_ns : int
            Frames whose sending ended before this should have come before the question.
        newest_frame : int
            The last that came whole, ``NO_FRAME`` before the first.
        """
        for frame_id, sent_ns in list(self._held.items()):
            if sent_ns >= asked_ns or (newest_frame != NO_FRAME and newest_frame >= frame_id):
                continue
            self.misses = 0  # not the board's doing
            if frame_id in self._flying:
                cause = "corrupt" if self._flying[frame_id].damage_seen else "lost"
                self._drop(frame_id, cause, "it did not reach the board whole")
            del self._held[frame_id]

    def refuse(self, frame_id: int, reason: str) -> bool:
        """Record that the board's answer to this frame cannot be used; return False if not in flight."""
        flying = frame_id in self._flying
        self.misses = 0  # wrongly or not, it answers
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
        self._report(self._flying.pop(frame_id).record.ended(f"dropped:{cause}", reason))
