"""The times of a frame's answer as a ROS 2 message; images, cameras and poses are the data sets' own."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from flyaround.hil.host.frame_record import DURATIONS
from flyaround.simulator.dataset.formats.ros_messages import header, ros_definition

if TYPE_CHECKING:
    from flyaround.hil.host.frame_record import FrameRecord

ESTIMATE_FRAME, FRAME_TIMING = "target_estimate", "flyaround_msgs/msg/FrameTiming"

FRAME_TIMING_DEFINITION = ros_definition(
    "std_msgs/Header header\nuint32 frame_id\nstring outcome\nstring reason\nfloat64 confidence\n"
    + "".join(f"float64 {name}\n" for name in DURATIONS)
    + "string[] stage_names\nfloat64[] stage_ms\nfloat64 position_error_m\nfloat64 attitude_error_deg\n"
)
"""Text of the message type."""


def frame_timing(row: FrameRecord) -> dict[str, Any]:
    """flyaround_msgs/FrameTiming of a ledger's row; what is not known is not a number."""
    known = {name: getattr(row, name) for name in DURATIONS}
    return {
        "header": header(row.epoch_utc),
        "frame_id": row.frame_id,
        "outcome": row.outcome,
        "reason": row.reason,
        "confidence": _or_nan(row.confidence),
        **{name: _or_nan(value) for name, value in known.items()},
        "stage_names": list(row.stages_ms),
        "stage_ms": [float(ms) for ms in row.stages_ms.values()],
        "position_error_m": _or_nan(row.E_T_m),
        "attitude_error_deg": _or_nan(row.E_R_deg),
    }


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else float(value)
