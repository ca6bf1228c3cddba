"""Ledger: one row per frame in frames.csv, written as soon as its outcome is known."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import math
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from flyaround.hil.host.frame_record import ACCEPTED, DECLINED, DROPPED, DURATIONS, FrameRecord
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.table_text import table_bytes, table_text, text_of_table
from flyaround.simulator.runtime.untrusted_files import read_regular

if TYPE_CHECKING:
    from pathlib import Path

FRAMES_CSV = "frames.csv"
# Maximum size of an accepted file [bytes], about a million rows.
MAX_BYTES = 1 << 29


_ERRORS = ("confidence", "E_T_m", "E_R_deg")
_VECTORS = {
    "q_wxyz": ("q_w", "q_x", "q_y", "q_z"),
    "t_m": ("t_x_m", "t_y_m", "t_z_m"),
    "truth_q_wxyz": ("truth_q_w", "truth_q_x", "truth_q_y", "truth_q_z"),
    "truth_t_m": ("truth_t_x_m", "truth_t_y_m", "truth_t_z_m"),
}
_TIMES = tuple(f.name for f in fields(FrameRecord) if f.name.endswith("_utc") and f.name != "epoch_utc")
_DELAYS = ("handover_error_ms", "staleness_ms")
_ANSWERS = ("late", "deadline_met")
_ANSWER_CELLS = {None: "", False: "0", True: "1"}
# Columns that older ledgers may lack.
OPTIONAL_COLUMNS = ("faults", *_TIMES, *_DELAYS, *_ANSWERS, "time_fault")
COLUMNS = (
    "frame_id",
    "epoch_utc",
    "t_s",
    "exposure_s",
    "outcome",
    "reason",
    *DURATIONS,
    "stages_ms",
    *_ERRORS,
    *(column for columns in _VECTORS.values() for column in columns),
    *OPTIONAL_COLUMNS,
)


class LedgerWriter:
    """Writer of ``frames.csv``; each row is complete and flushed before ``add`` returns.

    Raises
    ------
    UserError
        If the folder cannot be written or already holds a ledger. From ``add``, if a row cannot be written (disk full):
        earlier rows remain complete, later ones are discarded.
    """

    def __init__(self, folder: Path) -> None:
        path = folder / FRAMES_CSV
        self._path, self._rows, self._bytes, self._broken = path, -1, 0, False
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._file = path.open("xb", buffering=0)
        except FileExistsError as error:
            raise UserError(f"{path} exists already: name another folder for this ledger") from error
        except OSError as error:
            raise UserError(
                f"ledger folder {folder} cannot be written ({error.strerror}): name another folder"
            ) from error
        self._write(list(COLUMNS))

    def add(self, row: FrameRecord) -> None:
        """Write one row."""
        self._write(_cells(row))

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def discard(self) -> None:
        """Close and remove the file of a run that could not start."""
        self._file.close()
        with contextlib.suppress(OSError):
            self._path.unlink()

    def _write(self, cells: list[str]) -> None:
        # a single write of a whole line, so that readers never see half a row
        if self._broken:
            return
        line = memoryview(table_bytes(cells))
        try:
            # usually one write suffices; after a short one, the next raises the reason
            remaining = line
            while remaining:
                remaining = remaining[self._file.write(remaining) or 0 :]
        except OSError as error:
            self._broken = True
            with contextlib.suppress(OSError):
                if self._bytes:
                    self._file.truncate(self._bytes)
                else:
                    self._file.close()
                    self._path.unlink()
            raise UserError(
                f"{self._path} cannot be written ({error.strerror}): its {max(0, self._rows)} rows so far are complete:"
                " free some space, or name a folder on another disk with --log"
            ) from error
        self._rows += 1
        self._bytes += len(line)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.9g}"


def _cells(row: FrameRecord) -> list[str]:
    cells = [
        str(row.frame_id),
        row.epoch_utc,
        repr(row.t_s),
        repr(row.exposure_s),
        row.outcome,
        table_text(row.reason),
    ]
    cells += [_number(getattr(row, name)) for name in DURATIONS]
    cells.append(json.dumps({k: round(v, 4) for k, v in row.stages_ms.items()}) if row.stages_ms else "")
    cells += [_number(getattr(row, name)) for name in _ERRORS]
    for name, columns in _VECTORS.items():
        vector = getattr(row, name)
        cells += [""] * len(columns) if vector is None else [repr(float(x)) for x in vector]
    cells.append(table_text(";".join(row.faults)))
    cells += [getattr(row, name) for name in _TIMES]
    cells += [_number(getattr(row, name)) for name in _DELAYS]
    return [*cells, *(_ANSWER_CELLS[getattr(row, name)] for name in _ANSWERS), table_text(row.time_fault)]


def read_ledger(folder: Path) -> list[FrameRecord]:
    """Read the rows of a ledger folder.

    Returns
    -------
    list of FrameRecord
        Rows in the order of their frame ids; a truncated last line is ignored.

    Raises
    ------
    UserError
        If there is no ledger, or it has other columns or is damaged.
    """
    path = folder / FRAMES_CSV
    try:
        data = read_regular(path, MAX_BYTES)
    except OSError as error:
        raise UserError(
            f"no ledger at {path} ({error.strerror}): name a folder that `flyaround hil host --log` wrote"
        ) from error
    line = 0
    try:
        reader = csv.DictReader(io.StringIO(data[: data.rfind(b"\n") + 1].decode()))
        needed = COLUMNS[: -len(OPTIONAL_COLUMNS)]
        missing = [name for name in needed if name not in (reader.fieldnames or [])]
        if missing:
            raise UserError(f"{path} has no column {missing[0]!r}: it was not written by this version's host")
        rows = []
        for cells in reader:
            line = reader.line_num
            rows.append(_row(cells))
    except (ValueError, TypeError, OverflowError, RecursionError, csv.Error) as error:
        where = f", line {line}," if line else ""
        raise UserError(
            f"{path}{where} is damaged ({error!s:.120}): copy the ledger again, or delete the damaged lines"
        ) from error
    return sorted(rows, key=lambda row: row.frame_id)


def _finite(cell: str | float) -> float:
    number = float(cell)
    if not math.isfinite(number):
        raise ValueError(f"{cell!s:.40} is not a finite number")
    return number


def _vector(cells: dict[str, str], columns: tuple[str, ...]) -> tuple[float, ...] | None:
    return tuple(_finite(cells[c]) for c in columns) if cells[columns[0]] else None


def _row(cells: dict[str, str]) -> FrameRecord:
    if None in cells or None in cells.values():
        raise ValueError(f"it does not have {len(COLUMNS)} fields")
    if cells["outcome"] not in {ACCEPTED, DECLINED} and not cells["outcome"].startswith(DROPPED):
        raise ValueError(f"its outcome {cells['outcome'][:40]!r} is invalid")
    stages_ms = json.loads(cells["stages_ms"]) if cells["stages_ms"] else {}
    if not isinstance(stages_ms, dict) or not all(isinstance(ms, int | float) for ms in stages_ms.values()):
        raise ValueError("its stages_ms are not times by name")
    for ms in stages_ms.values():
        _finite(ms)
    optional: dict[str, Any] = {
        name: _finite(cells[name]) if cells[name] else None
        for name in (*DURATIONS, *_ERRORS)
        if not name.startswith("E_")
    }
    # an error that is not finite counts as wrong
    optional |= {name: float(cells[name]) if cells[name] else None for name in ("E_T_m", "E_R_deg")}
    newer_columns: dict[str, Any] = {
        **{name: cells.get(name, "") for name in _TIMES},
        **{name: _finite(cells[name]) if cells.get(name) else None for name in _DELAYS},
        **{name: cells[name] == "1" if cells.get(name) else None for name in _ANSWERS},
        "time_fault": text_of_table(cells.get("time_fault", "")),
    }
    vectors: dict[str, Any] = {name: _vector(cells, columns) for name, columns in _VECTORS.items()}
    return FrameRecord(
        frame_id=int(cells["frame_id"]),
        epoch_utc=cells["epoch_utc"],
        t_s=_finite(cells["t_s"]),
        exposure_s=_finite(cells["exposure_s"]),
        outcome=cells["outcome"],
        reason=text_of_table(cells["reason"]),
        stages_ms=stages_ms,
        faults=tuple(name for name in text_of_table(cells.get("faults", "")).split(";") if name),
        **newer_columns,
        **optional,
        **vectors,
    )
