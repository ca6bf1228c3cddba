"""Writer of pose files: JSON lines or CSV, one row an image with the camera's time stamp."""

from __future__ import annotations

import csv
import io
import json
import sys
from datetime import datetime, timezone
from typing import IO, Any, Dict, Optional

from flyaround.hil.board.gige.camera import CameraFrame
from flyaround.hil.link.clock import now_ns
from flyaround.hil.link.errors import LinkError
from flyaround.hil.link.packets.messages import PoseMessage

COLUMNS = (
    "frame",
    "camera_time_ns",
    "received_utc",
    "wait_ms",
    "estimate_ms",
    "skipped",
    "accepted",
    "reason",
    "confidence",
    "q_w",
    "q_x",
    "q_y",
    "q_z",
    "t_x_m",
    "t_y_m",
    "t_z_m",
)


class PoseFile:
    """Pose file whose rows are complete and flushed before the next image is processed.

    Parameters
    ----------
    path : str or None
        Output file: CSV if it ends in .csv, else JSON lines. None writes JSON lines to standard output.

    Raises
    ------
    LinkError
        If the file exists or cannot be written, now or later (disk full).
    """

    def __init__(self, path: Optional[str]) -> None:
        self._path = path
        self._as_table = path is not None and path.lower().endswith(".csv")
        self._file: IO[str] = sys.stdout
        if path is not None:
            try:
                self._file = open(path, "x", encoding="utf-8", newline="")  # noqa: SIM115, PTH123 - closed by close
            except FileExistsError:
                raise LinkError(f"{path} exists already: name another file for the poses") from None
            except OSError as error:
                raise self._failed(error) from error
        if self._as_table:
            self._write(_table_line(COLUMNS))

    def add(self, frame: CameraFrame, pose: PoseMessage) -> None:
        """Write the row of one image."""
        row: Dict[str, Any] = {
            "frame": frame.number,
            "camera_time_ns": frame.camera_time_ns,
            "received_utc": _utc_of(frame.received_ns),
            "wait_ms": (pose.start_ns - frame.received_ns) * 1e-6,
            "estimate_ms": (pose.end_ns - pose.start_ns) * 1e-6,
            "skipped": frame.skipped,
            "accepted": pose.accepted,
            "reason": pose.reason,
            "confidence": pose.confidence,
        }
        q, t = pose.q_camera_from_target_wxyz, pose.t_camera_from_target_m
        if self._as_table:
            numbers = ("",) * 7 if q is None or t is None else (*q, *t)
            row["accepted"] = int(pose.accepted)
            self._write(_table_line((*row.values(), *numbers)))
            return
        row["q_camera_from_target_wxyz"] = None if q is None else list(q)
        row["t_camera_from_target_m"] = None if t is None else list(t)
        row["stages_ms"] = dict(pose.stages_ms)
        self._write(json.dumps(row) + "\n")

    def close(self) -> None:
        """Close the file."""
        if self._path is not None:
            self._file.close()

    def _write(self, line: str) -> None:
        try:
            self._file.write(line)
            self._file.flush()
        except OSError as error:
            raise self._failed(error) from error

    def _failed(self, error: OSError) -> LinkError:
        return LinkError(
            f"poses cannot be written to {self._path or 'the standard output'} ({error.strerror}):"
            " name another file with --poses"
        )


def _table_line(cells: Any) -> str:  # noqa: ANN401 - str, int, float or None
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(cells)
    return text.getvalue()


def _utc_of(at_ns: int) -> str:
    """Return a time of the monotonic clock as UTC, from its present offset to the wall clock."""
    seconds = datetime.now(timezone.utc).timestamp() - (now_ns() - at_ns) * 1e-9
    return datetime.fromtimestamp(seconds, timezone.utc).isoformat(timespec="microseconds")
