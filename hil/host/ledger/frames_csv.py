"""The ledger: one row per frame in frames.csv, written as soon as its outcome is known."""

from __future__ import annotations

import contextlib
import csv
import io
import json
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.hil.evaluate.pose_errors import COARSE_DEG, COARSE_SHARE
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.table_text import table_text, text_of_table
from flyaround.simulator.runtime.untrusted_files import read_regular
from flyaround.simulator.world.frames.rotation import rotation_angle_rad

if TYPE_CHECKING:
    from flyaround.hil.host.link_process.ipc import FrameResult
    from flyaround.hil.link.packets.messages import PoseMessage
    from flyaround.simulator.frame import Frame
    from flyaround.simulator.runtime.arrays import Quat, Vec3

FRAMES_CSV = "frames.csv"
ACCEPTED, DECLINED, DROPPED = "accepted", "declined", "dropped:"
# a million rows, and far more frames than a run has
MOST_BYTES = 1 << 29


@dataclass(frozen=True, kw_only=True)
class LedgerRow:
    """What became of one frame; documented in docs/formats/ledger.md.

    Parameters
    ----------
    outcome : ``accepted``, ``declined`` or ``dropped:CAUSE``.
    e2e_ms : from the first byte out to the pose back, both on the link process's clock.
    send_lag_ms : how late sending began (realtime).
    uplink_ms, downlink_ms : frame out to frame whole at the board; pose out to pose in; by the clock offset.
    board_wait_ms, board_total_ms : frame whole to estimator's start, and to its end.
    q_wxyz, t_m : ``camera_from_target`` as the board has it; ``truth_*`` the true one.
    E_T_m, E_R_deg : pose error, where both are known.
    faults : what struck the frame on purpose, of camera and line.
    exposure_start_utc, exposure_end_utc : on the host's clock, ISO 8601 to the nanosecond, as are the next ones.
    drawn_utc : the picture was there. handed_over_utc : the camera gave it to the link.
    sent_utc : the last byte was with the operating system. received_on_board_utc, begun_utc, answered_utc : frame
        whole, estimator begins and ends, by the clock offset. received_utc : the pose was back.
    handover_error_ms : handed over minus end of exposure and latency (realtime).
    late : whether the picture was not there when it was to be handed over (realtime).
    staleness_ms : age of mid-exposure when the estimator began.
    deadline_met : whether the answer came within the deadline; False of a frame without one, None where there is none.
    time_fault : why the times that the board reports cannot be; they are left out then. Empty where they can.
    """

    frame_id: int
    epoch_utc: str
    t_s: float
    exposure_s: float
    outcome: str
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

    @property
    def wrong(self) -> bool | None:
        """Whether the pose is no coarse success (5 deg, 5 % of the range) as `evaluate` counts; None if not known."""
        if self.E_T_m is None or self.E_R_deg is None or self.truth_t_m is None:
            return None
        share = self.E_T_m / max(float(np.linalg.norm(self.truth_t_m)), 1e-9)
        # not a number is not within a limit
        return not (self.E_R_deg <= COARSE_DEG and share <= COARSE_SHARE)


_SCALARS = (
    "e2e_ms",
    "render_ms",
    "send_lag_ms",
    "send_ms",
    "uplink_ms",
    "board_wait_ms",
    "board_total_ms",
    "downlink_ms",
)
_ERRORS = ("confidence", "E_T_m", "E_R_deg")
_VECTORS = {
    "q_wxyz": ("q_w", "q_x", "q_y", "q_z"),
    "t_m": ("t_x_m", "t_y_m", "t_z_m"),
    "truth_q_wxyz": ("truth_q_w", "truth_q_x", "truth_q_y", "truth_q_z"),
    "truth_t_m": ("truth_t_x_m", "truth_t_y_m", "truth_t_z_m"),
}
_TIMES = (
    "exposure_start_utc",
    "exposure_end_utc",
    "drawn_utc",
    "handed_over_utc",
    "sent_utc",
    "received_on_board_utc",
    "begun_utc",
    "answered_utc",
    "received_utc",
)
_DELAYS = ("handover_error_ms", "staleness_ms")
_ANSWERS = ("late", "deadline_met")
_ANSWER_CELLS = {None: "", False: "0", True: "1"}
# ledgers without these are older and read, too
LATER_COLUMNS = ("faults", *_TIMES, *_DELAYS, *_ANSWERS, "time_fault")
COLUMNS = (
    "frame_id",
    "epoch_utc",
    "t_s",
    "exposure_s",
    "outcome",
    "reason",
    *_SCALARS,
    "stages_ms",
    *_ERRORS,
    *(column for columns in _VECTORS.values() for column in columns),
    *LATER_COLUMNS,
)


def pose_errors(q_wxyz: Quat, t_m: Vec3, truth_q_wxyz: Quat, truth_t_m: Vec3) -> tuple[float, float]:
    """``E_T`` [m] and ``E_R`` [deg] of a pose against the truth; a bad quaternion gives 180 deg at most."""
    error_m = float(np.linalg.norm(np.subtract(t_m, truth_t_m)))
    norm = float(np.linalg.norm(q_wxyz))
    if norm < 1e-9:
        return error_m, 180.0
    return error_m, float(np.degrees(rotation_angle_rad(np.asarray(q_wxyz) / norm, truth_q_wxyz)))


def _ms(start_ns: int | None, end_ns: int | None) -> float | None:
    return None if start_ns is None or end_ns is None else (end_ns - start_ns) * 1e-6


def utc_text(ns: int) -> str:
    """Nanoseconds since 1970-01-01 UTC as ISO 8601."""
    second, rest = divmod(ns, 1_000_000_000)
    return f"{datetime.fromtimestamp(second, UTC):%Y-%m-%dT%H:%M:%S}.{rest:09d}Z"


def ledger_row(
    frame: Frame, result: FrameResult, utc_minus_monotonic_ns: int = 0, deadline_ms: float | None = None
) -> LedgerRow:
    """A frame and its outcome as a row.

    Parameters
    ----------
    utc_minus_monotonic_ns : of the host's clocks, the same for all rows of a run.
    deadline_ms : of an answer, from the start of sending; None without one.
    """
    scene, truth = frame.scene, frame.truth
    row = LedgerRow(
        frame_id=frame.number,
        epoch_utc=scene.epoch_utc,
        t_s=scene.t_s,
        exposure_s=scene.exposure_s,
        outcome=result.outcome,
        reason=result.reason,
        render_ms=frame.drawing_ms,
        faults=(*frame.faults, *result.faults),
        send_lag_ms=_ms(result.due_ns, result.send_start_ns),
        send_ms=_ms(result.send_start_ns, result.send_end_ns),
        e2e_ms=_ms(result.send_start_ns, result.received_ns),
        truth_q_wxyz=None if truth is None else truth.q_camera_from_target_wxyz,
        truth_t_m=None if truth is None else truth.t_camera_from_target_m,
    )
    row = replace(row, **_camera_times(result, utc_minus_monotonic_ns))
    if deadline_ms is not None:
        row = replace(row, deadline_met=row.e2e_ms is not None and row.e2e_ms <= deadline_ms)
    pose = result.pose
    if pose is None:
        return row
    q, t, offset = pose.q_camera_from_target_wxyz, pose.t_camera_from_target_m, result.clock_offset_ns
    errors: tuple[float | None, float | None] = (None, None)
    if q is not None and t is not None and row.truth_q_wxyz is not None and row.truth_t_m is not None:
        errors = pose_errors(q, t, row.truth_q_wxyz, row.truth_t_m)
    fault = board_time_fault(result, pose)
    if pose.end_ns and not fault:
        row = replace(
            row,
            board_wait_ms=_ms(pose.receive_ns, pose.start_ns),
            board_total_ms=_ms(pose.receive_ns, pose.end_ns),
        )
        if offset is not None:
            row = replace(
                row,
                uplink_ms=_ms(result.send_start_ns, pose.receive_ns - offset),
                downlink_ms=_ms(pose.end_ns - offset, result.received_ns),
                **_board_times(result, pose, offset, utc_minus_monotonic_ns),
            )
    return replace(
        row,
        time_fault=fault,
        stages_ms=dict(pose.stages_ms),
        confidence=pose.confidence,
        q_wxyz=q,
        t_m=t,
        E_T_m=errors[0],
        E_R_deg=errors[1],
    )


def board_time_fault(result: FrameResult, pose: PoseMessage) -> str:
    """Return why the times that a board reports for a frame cannot be; nothing if they can, or it reports none.

    They are in order, and by the clock offset not before the frame was sent nor after its answer came, within the
    bound of that offset.
    """
    if not (pose.receive_ns or pose.start_ns or pose.end_ns):
        return ""
    if not pose.receive_ns <= pose.start_ns <= pose.end_ns:
        return "received, begun and answered are not in this order"
    offset, bound = result.clock_offset_ns, result.clock_bound_ns
    if offset is None or bound is None or result.send_start_ns is None or result.received_ns is None:
        return ""
    early_ms = _ms(pose.receive_ns - offset, result.send_start_ns - bound) or 0.0
    late_ms = _ms(result.received_ns + bound, pose.end_ns - offset) or 0.0
    if early_ms > 0:
        return f"received {early_ms:.4g} ms before it was sent"
    return f"answered {late_ms:.4g} ms after the answer came" if late_ms > 0 else ""


def _camera_times(result: FrameResult, shift_ns: int) -> dict[str, Any]:
    start_ns, end_ns = result.exposure_ns or (None, None)
    times = {
        "exposure_start_utc": start_ns,
        "exposure_end_utc": end_ns,
        "drawn_utc": result.ready_ns,
        "handed_over_utc": result.handed_over_ns,
        "sent_utc": result.send_end_ns,
        "received_utc": result.received_ns,
    }
    due_ns, ready_ns = result.due_ns, result.ready_ns
    return {
        **{name: utc_text(ns + shift_ns) for name, ns in times.items() if ns is not None},
        "handover_error_ms": _ms(due_ns, result.handed_over_ns),
        "late": None if due_ns is None or ready_ns is None else ready_ns > due_ns,
    }


def _board_times(result: FrameResult, pose: PoseMessage, offset_ns: int, shift_ns: int) -> dict[str, Any]:
    times = {
        "received_on_board_utc": pose.receive_ns,
        "begun_utc": pose.start_ns,
        "answered_utc": pose.end_ns,
    }
    middle_ns = None if result.exposure_ns is None else sum(result.exposure_ns) // 2
    return {
        **{name: utc_text(ns - offset_ns + shift_ns) for name, ns in times.items()},
        "staleness_ms": _ms(middle_ns, pose.start_ns - offset_ns),
    }


class LedgerWriter:
    """Appends rows to ``frames.csv``; each is whole and with the operating system before ``add`` returns.

    Raises
    ------
    UserError
        If the folder cannot be written or already holds a ledger; from ``add``, if a row cannot be written (a full
        disk): the rows before it stay, whole, and those after it are not kept.
    """

    def __init__(self, folder: Path) -> None:
        path = folder / FRAMES_CSV
        self._path, self._rows, self._bytes, self._broken = path, -1, 0, False
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._file = path.open("xb", buffering=0)
        except FileExistsError as error:
            raise UserError(f"{path} is there already: name another folder for this ledger") from error
        except OSError as error:
            raise UserError(
                f"ledger folder {folder} cannot be written ({error.strerror}): name another folder"
            ) from error
        self._write(list(COLUMNS))

    def add(self, row: LedgerRow) -> None:
        """Write one row."""
        self._write(_cells(row))

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def discard(self) -> None:
        """Close the file and remove it: of a run that cannot begin."""
        self._file.close()
        with contextlib.suppress(OSError):
            self._path.unlink()

    def _write(self, cells: list[str]) -> None:
        # one write of one whole line: a reader never sees half a row
        if self._broken:
            return
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerow(cells)
        line = memoryview(text.getvalue().encode())
        try:
            # nearly always one write; a second one after a short write says why it was short
            left = line
            while left:
                left = left[self._file.write(left) or 0 :]
        except OSError as error:
            self._broken = True
            with contextlib.suppress(OSError):
                if self._bytes:
                    self._file.truncate(self._bytes)
                else:
                    self._file.close()
                    self._path.unlink()
            raise UserError(
                f"{self._path} cannot be written ({error.strerror}): its {max(0, self._rows)} rows so far are whole;"
                " make room, or name a folder on another disk with --log"
            ) from error
        self._rows += 1
        self._bytes += len(line)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.9g}"


def _cells(row: LedgerRow) -> list[str]:
    cells = [
        str(row.frame_id),
        row.epoch_utc,
        repr(row.t_s),
        repr(row.exposure_s),
        row.outcome,
        table_text(row.reason),
    ]
    cells += [_number(getattr(row, name)) for name in _SCALARS]
    cells.append(json.dumps({k: round(v, 4) for k, v in row.stages_ms.items()}) if row.stages_ms else "")
    cells += [_number(getattr(row, name)) for name in _ERRORS]
    for name, columns in _VECTORS.items():
        vector = getattr(row, name)
        cells += [""] * len(columns) if vector is None else [repr(float(x)) for x in vector]
    cells.append(table_text(";".join(row.faults)))
    cells += [getattr(row, name) for name in _TIMES]
    cells += [_number(getattr(row, name)) for name in _DELAYS]
    return [*cells, *(_ANSWER_CELLS[getattr(row, name)] for name in _ANSWERS), table_text(row.time_fault)]


def read_ledger(folder: Path) -> list[LedgerRow]:
    """Rows of a ledger folder, by frame id; a last line cut off by a power failure is left out.

    Raises
    ------
    UserError
        If there is no ledger, its columns are others, or what is in it is damaged.
    """
    path = folder / FRAMES_CSV
    try:
        data = read_regular(path, MOST_BYTES)
    except OSError as error:
        raise UserError(
            f"no ledger at {path} ({error.strerror}): name a folder that `flyaround hil host --log` wrote"
        ) from error
    line = 0
    try:
        reader = csv.DictReader(io.StringIO(data[: data.rfind(b"\n") + 1].decode()))
        needed = COLUMNS[: -len(LATER_COLUMNS)]
        missing = [name for name in needed if name not in (reader.fieldnames or [])]
        if missing:
            raise UserError(f"{path} has no column {missing[0]!r}: it was not written by this version's host")
        rows = []
        for cells in reader:
            line = reader.line_num
            rows.append(_row(cells))
    except (ValueError, TypeError, RecursionError, csv.Error) as error:
        where = f", line {line}," if line else ""
        raise UserError(
            f"{path}{where} is damaged ({error!s:.120}): take a whole copy of the ledger, or delete what is damaged"
        ) from error
    return sorted(rows, key=lambda row: row.frame_id)


def _vector(cells: dict[str, str], columns: tuple[str, ...]) -> tuple[float, ...] | None:
    return tuple(float(cells[c]) for c in columns) if cells[columns[0]] else None


def _row(cells: dict[str, str]) -> LedgerRow:
    if None in cells or None in cells.values():
        raise ValueError(f"it has not {len(COLUMNS)} fields")
    if cells["outcome"] not in {ACCEPTED, DECLINED} and not cells["outcome"].startswith(DROPPED):
        raise ValueError(f"its outcome {cells['outcome'][:40]!r} is none")
    stages_ms = json.loads(cells["stages_ms"]) if cells["stages_ms"] else {}
    if not isinstance(stages_ms, dict) or not all(isinstance(ms, int | float) for ms in stages_ms.values()):
        raise ValueError("its stages_ms are no times by name")
    optional: dict[str, Any] = {
        name: float(cells[name]) if cells[name] else None for name in (*_SCALARS, *_ERRORS)
    }
    later: dict[str, Any] = {
        **{name: cells.get(name, "") for name in _TIMES},
        **{name: float(cells[name]) if cells.get(name) else None for name in _DELAYS},
        **{name: cells[name] == "1" if cells.get(name) else None for name in _ANSWERS},
        "time_fault": text_of_table(cells.get("time_fault", "")),
    }
    vectors: dict[str, Any] = {name: _vector(cells, columns) for name, columns in _VECTORS.items()}
    return LedgerRow(
        frame_id=int(cells["frame_id"]),
        epoch_utc=cells["epoch_utc"],
        t_s=float(cells["t_s"]),
        exposure_s=float(cells["exposure_s"]),
        outcome=cells["outcome"],
        reason=text_of_table(cells["reason"]),
        stages_ms=stages_ms,
        faults=tuple(name for name in text_of_table(cells.get("faults", "")).split(";") if name),
        **later,
        **optional,
        **vectors,
    )
