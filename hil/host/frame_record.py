"""Record of one frame, from the host's plan through the link process to the ledger and its reports."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.hil.evaluate.pose_errors import COARSE_DEG, COARSE_SHARE
from flyaround.simulator.world.frames.rotation import rotation_angle_rad

if TYPE_CHECKING:
    from flyaround.hil.link.packets.messages import PoseMessage
    from flyaround.simulator.frame import Frame
    from flyaround.simulator.runtime.arrays import Quat, Vec3

ACCEPTED, DECLINED, DROPPED = "accepted", "declined", "dropped:"

DURATIONS = (
    "e2e_ms",
    "render_ms",
    "send_lag_ms",
    "send_ms",
    "uplink_ms",
    "board_wait_ms",
    "board_total_ms",
    "downlink_ms",
)
"""Fields of `FrameRecord` that hold durations of a frame's stages."""


@dataclass(frozen=True, kw_only=True)
class FrameTimes:
    """Times of a frame in progress on the host's monotonic clock [ns]; None if unknown.

    Parameters
    ----------
    due_ns : int, optional
        Time at which the camera must hand the image over; None for a triggered camera.
    latency_s : float
        Time from the end of the exposure to the hand-over [s].
    drawn_ns : int, optional
        Time at which the image was rendered; later than ``due_ns`` if the camera is late.
    handed_over_ns : int, optional
        Time at which the link process accepted the image, whether or not it is sent.
    send_start_ns : int, optional
        Time just before the first byte was sent.
    send_end_ns : int, optional
        Time at which the operating system had accepted the last byte.
    received_ns : int, optional
        Time at which the answer was received.
    answer : PoseMessage, optional
        The board's answer, with its own times.
    clock_offset_ns : int, optional
        The board's clock minus the host's.
    clock_bound_ns : int, optional
        Bound of the error of this offset.
    """

    due_ns: int | None = None
    latency_s: float = 0.0
    drawn_ns: int | None = None
    handed_over_ns: int | None = None
    send_start_ns: int | None = None
    send_end_ns: int | None = None
    received_ns: int | None = None
    answer: PoseMessage | None = None
    clock_offset_ns: int | None = None
    clock_bound_ns: int | None = None

    def exposure_span_ns(self, exposure_s: float) -> tuple[int, int] | None:
        """Return start and end of the exposure, from the time at which the image was due or handed over."""
        hand_over_ns = self.handed_over_ns if self.due_ns is None else self.due_ns
        if hand_over_ns is None:
            return None
        end_ns = hand_over_ns - round(1e9 * self.latency_s)
        return end_ns - round(1e9 * exposure_s), end_ns

    @property
    def time_fault(self) -> str:
        """Reason why the times reported by the board are impossible; empty if they are possible or absent.

        Possible times are in order and, within the bound of the clock offset, neither before the frame was sent nor
        after its answer was received.
        """
        pose, offset, bound = self.answer, self.clock_offset_ns, self.clock_bound_ns
        if pose is None or not (pose.receive_ns or pose.start_ns or pose.end_ns):
            return ""
        if not pose.receive_ns <= pose.start_ns <= pose.end_ns:
            return "reception, start and answer are not in this order"
        if offset is None or bound is None or self.send_start_ns is None or self.received_ns is None:
            return ""
        early_ms = ((self.send_start_ns - bound) - (pose.receive_ns - offset)) * 1e-6
        late_ms = ((pose.end_ns - offset) - (self.received_ns + bound)) * 1e-6
        if early_ms > 0:
            return f"received {early_ms:.4g} ms before it was sent"
        return f"answered {late_ms:.4g} ms after the answer was received" if late_ms > 0 else ""


@dataclass(frozen=True, kw_only=True)
class FrameRecord:
    """Record of one frame; its columns are documented in docs/formats/ledger.md.

    It starts with the host's frame; the link process adds the times and the outcome, and `complete` derives the columns
    of the ledger.

    Parameters
    ----------
    frame_id : int
        Number of the frame.
    epoch_utc : str
        Mid-exposure, ISO 8601.
    t_s : float
        Mid-exposure, from the start of the scenario.
    exposure_s : float
        Exposure time.
    outcome : str
        ``accepted``, ``declined`` or ``dropped:CAUSE``; empty while unknown.
    reason : str
        Reason for a declined or dropped frame; empty for an accepted one.
    e2e_ms : float, optional
        Time from the first byte sent to the pose received, on the link process's clock.
    render_ms : float, optional
        Time to render the image.
    send_lag_ms : float, optional
        Delay of the start of sending (real time).
    send_ms : float, optional
        Time to send the frame.
    uplink_ms : float, optional
        Time from sending the frame to its complete reception on the board, by the clock offset.
    board_wait_ms : float, optional
        Time from complete reception on the board to the start of the estimator.
    board_total_ms : float, optional
        Time from complete reception on the board to the end of the estimator.
    downlink_ms : float, optional
        Time from the end of the estimator to the reception of the pose, by the clock offset.
    stages_ms : dict of str to float
        Duration of each stage of the estimator.
    confidence : float, optional
        Probability that the pose is correct, as the board reports it.
    q_wxyz : tuple, optional
        Estimated ``q_camera_from_target``; ``truth_q_wxyz`` is the true one.
    t_m : tuple, optional
        Estimated ``t_camera_from_target``; ``truth_t_m`` is the true one.
    truth_q_wxyz : tuple, optional
        True ``q_camera_from_target``.
    truth_t_m : tuple, optional
        True ``t_camera_from_target``.
    E_T_m : float, optional
        Position error, if the truth is known.
    E_R_deg : float, optional
        Attitude error, if the truth is known.
    faults : tuple of str
        Deliberate faults of camera and line that affected the frame.
    exposure_start_utc : str
        Start of the exposure, on the host's clock, ISO 8601 with nanoseconds like all following times.
    exposure_end_utc : str
        End of the exposure.
    drawn_utc : str
        Time at which the image was rendered.
    handed_over_utc : str
        Time at which the camera handed the image to the link.
    sent_utc : str
        Time at which the operating system had accepted the last byte.
    received_on_board_utc : str
        Time of complete reception on the board, by the clock offset.
    begun_utc : str
        Start of the estimator, by the clock offset.
    answered_utc : str
        End of the estimator, by the clock offset.
    received_utc : str
        Time at which the pose was received.
    handover_error_ms : float, optional
        Hand-over minus end of exposure and latency (real time).
    staleness_ms : float, optional
        Age of mid-exposure at the start of the estimator.
    late : bool, optional
        True if the image was not rendered when it was due (real time).
    deadline_met : bool, optional
        True if the answer met the deadline, False without an answer, None without a deadline.
    time_fault : str
        Reason why the board's times are impossible, in which case they are omitted; else empty.
    times : FrameTimes
        Clock readings of a frame in progress; a complete record has none.
    """

    frame_id: int
    epoch_utc: str
    t_s: float
    exposure_s: float
    outcome: str = ""
    reason: str = ""
    e2e_ms: float | None = None
    render_ms: float | None = None
    send_lag_ms: float | None = None
    send_ms: float | None = None
    uplink_ms: float | None = None
    board_wait_ms: float | None = None
    board_total_ms: float | None = None
    downlink_ms: float | None = None
    stages_ms: dict[str, float] = field(default_factory=dict)
    confidence: float | None = None
    q_wxyz: Quat | None = None
    t_m: Vec3 | None = None
    truth_q_wxyz: Quat | None = None
    truth_t_m: Vec3 | None = None
    E_T_m: float | None = None
    E_R_deg: float | None = None
    faults: tuple[str, ...] = ()
    exposure_start_utc: str = ""
    exposure_end_utc: str = ""
    drawn_utc: str = ""
    handed_over_utc: str = ""
    sent_utc: str = ""
    received_on_board_utc: str = ""
    begun_utc: str = ""
    answered_utc: str = ""
    received_utc: str = ""
    handover_error_ms: float | None = None
    staleness_ms: float | None = None
    late: bool | None = None
    deadline_met: bool | None = None
    time_fault: str = ""
    times: FrameTimes = FrameTimes()

    @staticmethod
    def from_frame(frame: Frame) -> FrameRecord:
        """Return the record of a frame that is not yet in progress.

        Returns
        -------
        FrameRecord
            Record with the frame's number, time, exposure, render time [ms] and faults; other columns are empty.
        """
        scene = frame.scene
        return FrameRecord(
            frame_id=frame.number,
            epoch_utc=scene.epoch_utc,
            t_s=scene.t_s,
            exposure_s=scene.exposure_s,
            render_ms=frame.render_ms,
            faults=tuple(frame.faults),
        )

    def with_times(self, **times: Any) -> FrameRecord:  # noqa: ANN401 - fields of FrameTimes
        """Return the record with additional times.

        Returns
        -------
        FrameRecord
            Copy in which the fields of `FrameTimes` that were given are set.
        """
        return replace(self, times=replace(self.times, **times))

    def with_outcome(self, outcome: str, reason: str, **times: Any) -> FrameRecord:  # noqa: ANN401 - fields of FrameTimes
        """Return the record with its outcome and final times.

        Returns
        -------
        FrameRecord
            Copy with the outcome, its reason, and the fields of `FrameTimes` that were given.
        """
        return replace(self.with_times(**times), outcome=outcome, reason=reason)

    @property
    def exposure_ns(self) -> tuple[int, int] | None:
        """Start and end of the exposure on the host's monotonic clock, while the frame is in progress."""
        return self.times.exposure_span_ns(self.exposure_s)

    @property
    def wrong(self) -> bool | None:
        """True if the pose is not a coarse success (5 deg, 5 % of the range) as in `evaluate`; None if unknown."""
        if self.E_T_m is None or self.E_R_deg is None or self.truth_t_m is None:
            return None
        share = self.E_T_m / max(float(np.linalg.norm(self.truth_t_m)), 1e-9)
        # negated, so that NaN counts as wrong
        return not (self.E_R_deg <= COARSE_DEG and share <= COARSE_SHARE)


def complete(
    record: FrameRecord,
    truth: tuple[Quat, Vec3] | None,
    utc_minus_monotonic_ns: int = 0,
    deadline_ms: float | None = None,
) -> FrameRecord:
    """Return the ledger row of a frame whose outcome is known.

    Parameters
    ----------
    record : FrameRecord
        Record with its outcome and times.
    truth : tuple of Quat and Vec3 or None
        True quaternion and position, camera from target.
    utc_minus_monotonic_ns : int
        Offset between the host's clocks, the same for all rows of a run.
    deadline_ms : float, optional
        Deadline of an answer, from the start of sending.
    """
    times, shift, pose = record.times, utc_minus_monotonic_ns, record.times.answer
    fault, exposure = times.time_fault, record.exposure_ns or (None, None)
    # on the host's clock, if the clock offset is known
    board: tuple[int | None, ...] = (None, None, None)
    wait_ms = total_ms = None
    if pose is not None and pose.end_ns and not fault:
        wait_ms, total_ms = _ms(pose.receive_ns, pose.start_ns), _ms(pose.receive_ns, pose.end_ns)
        if times.clock_offset_ns is not None:
            board = tuple(ns - times.clock_offset_ns for ns in (pose.receive_ns, pose.start_ns, pose.end_ns))
    e2e_ms = _ms(times.send_start_ns, times.received_ns)
    clock_ns = {
        "exposure_start_utc": exposure[0],
        "exposure_end_utc": exposure[1],
        "drawn_utc": times.drawn_ns,
        "handed_over_utc": times.handed_over_ns,
        "sent_utc": times.send_end_ns,
        "received_on_board_utc": board[0],
        "begun_utc": board[1],
        "answered_utc": board[2],
        "received_utc": times.received_ns,
    }
    middle_ns = None if record.exposure_ns is None else sum(record.exposure_ns) // 2
    utc: dict[str, Any] = {name: utc_text(ns + shift) for name, ns in clock_ns.items() if ns is not None}
    late = None if times.due_ns is None or times.drawn_ns is None else times.drawn_ns > times.due_ns
    timed = replace(
        record,
        times=FrameTimes(),
        **utc,
        e2e_ms=e2e_ms,
        send_lag_ms=_ms(times.due_ns, times.send_start_ns),
        send_ms=_ms(times.send_start_ns, times.send_end_ns),
        uplink_ms=_ms(times.send_start_ns, board[0]),
        board_wait_ms=wait_ms,
        board_total_ms=total_ms,
        downlink_ms=_ms(board[2], times.received_ns),
        handover_error_ms=_ms(times.due_ns, times.handed_over_ns),
        staleness_ms=_ms(middle_ns, board[1]),
        late=late,
        deadline_met=None if deadline_ms is None else e2e_ms is not None and e2e_ms <= deadline_ms,
        time_fault=fault,
    )
    return _with_pose(timed, pose, truth)


def _with_pose(record: FrameRecord, pose: PoseMessage | None, truth: tuple[Quat, Vec3] | None) -> FrameRecord:
    truth_q, truth_t = truth or (None, None)
    record = replace(record, truth_q_wxyz=truth_q, truth_t_m=truth_t)
    if pose is None:
        return record
    q, t = pose.q_camera_from_target_wxyz, pose.t_camera_from_target_m
    errors = (None, None) if q is None or t is None or truth is None else pose_errors(q, t, *truth)
    return replace(
        record,
        stages_ms=dict(pose.stages_ms),
        confidence=pose.confidence,
        q_wxyz=q,
        t_m=t,
        E_T_m=errors[0],
        E_R_deg=errors[1],
    )


def pose_errors(q_wxyz: Quat, t_m: Vec3, truth_q_wxyz: Quat, truth_t_m: Vec3) -> tuple[float, float]:
    """Return the position error ``E_T`` and the attitude error ``E_R`` of a pose.

    Returns
    -------
    E_T_m : float
        Distance between the positions [m].
    E_R_deg : float
        Angle between the attitudes [deg], 0 to 180; 180 for a quaternion of length zero, NaN for one with a NaN.
    """
    error_m = float(np.linalg.norm(np.subtract(t_m, truth_t_m)))
    norm = float(np.linalg.norm(q_wxyz))
    if norm < 1e-9:
        return error_m, 180.0
    return error_m, float(np.degrees(rotation_angle_rad(np.asarray(q_wxyz) / norm, truth_q_wxyz)))


def utc_text(ns: int) -> str:
    """Return nanoseconds since 1970-01-01 UTC as ISO 8601."""
    second, fraction_ns = divmod(ns, 1_000_000_000)
    return f"{datetime.fromtimestamp(second, UTC):%Y-%m-%dT%H:%M:%S}.{fraction_ns:09d}Z"


def _ms(start_ns: int | None, end_ns: int | None) -> float | None:
    return None if start_ns is None or end_ns is None else (end_ns - start_ns) * 1e-6
