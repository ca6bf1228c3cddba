"""A frame and what became of it, as a row of the ledger."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from hil.host.ledger.frames_csv import LedgerRow, pose_errors

if TYPE_CHECKING:
    from hil.host.link_process.ipc import FrameResult
    from simulator.frame import Frame


def _ms(start_ns: int | None, end_ns: int | None) -> float | None:
    return None if start_ns is None or end_ns is None else (end_ns - start_ns) * 1e-6


def ledger_row(frame: Frame, result: FrameResult) -> LedgerRow:
    """A frame and its outcome as a row."""
    scene, truth = frame.scene, frame.truth
    row = LedgerRow(
        frame_id=frame.number,
        epoch_utc=scene.epoch_utc,
        t_s=scene.t_s,
        exposure_s=scene.exposure_s,
        outcome=result.outcome,
        reason=result.reason,
        render_ms=frame.drawing_ms,
        send_lag_ms=_ms(result.due_ns, result.send_start_ns),
        send_ms=_ms(result.send_start_ns, result.send_end_ns),
        e2e_ms=_ms(result.send_start_ns, result.received_ns),
        truth_q_wxyz=None if truth is None else truth.q_camera_from_target_wxyz,
        truth_t_m=None if truth is None else truth.t_camera_from_target_m,
    )
    pose = result.pose
    if pose is None:
        return row
    q, t, offset = pose.q_camera_from_target_wxyz, pose.t_camera_from_target_m, result.clock_offset_ns
    errors: tuple[float | None, float | None] = (None, None)
    if q is not None and t is not None and row.truth_q_wxyz is not None and row.truth_t_m is not None:
        errors = pose_errors(q, t, row.truth_q_wxyz, row.truth_t_m)
    return replace(
        row,
        board_wait_ms=_ms(pose.receive_ns, pose.start_ns),
        board_total_ms=_ms(pose.receive_ns, pose.end_ns),
        uplink_ms=None if offset is None else _ms(result.send_start_ns, pose.receive_ns - offset),
        downlink_ms=None if offset is None else _ms(pose.end_ns - offset, result.received_ns),
        stages_ms=dict(pose.stages_ms),
        confidence=pose.confidence,
        q_wxyz=q,
        t_m=t,
        E_T_m=errors[0],
        E_R_deg=errors[1],
    )
