"""Rows of an evaluation, one per frame and method: CSV for users, JSON lines during the run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from flyaround.hil.board.method_names import name_in_file
from flyaround.hil.evaluate.pose_errors import FrameScore
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.table_text import table_bytes, table_text
from flyaround.simulator.runtime.untrusted_files import read_regular

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

# Limit of the rows of an evaluation [bytes], a thousand times those of 1,000 frames.
MAX_BYTES = 1 << 30


class EvaluatedFrame(msgspec.Struct, frozen=True, kw_only=True):
    """Answer of one method to one frame.

    Parameters
    ----------
    frame : int
        Frame number.
    method : str
        Label of the method.
    record : FrameScore
        Errors of the answer.
    reason : str
        Reason for a decline.
    failure : str
        Stage that failed, if the best pose is not coarse; else empty.
    confidence : float
        Confidence of the estimator.
    q_wxyz : tuple of float, optional
        Attitude of the best pose, camera from target.
    t_m : tuple of float, optional
        Target position of the best pose, camera frame.
    stages_ms : dict
        Time of each stage.
    counts : dict
        Counters of the stages.
    """

    frame: int
    method: str
    record: FrameScore
    reason: str
    failure: str
    confidence: float
    q_wxyz: tuple[float, float, float, float] | None
    t_m: tuple[float, float, float] | None
    stages_ms: dict[str, float]
    counts: dict[str, int]

    @property
    def total_ms(self) -> float:
        """Total time of all stages [ms]."""
        return float(sum(self.stages_ms.values()))


class RunHeader(msgspec.Struct, frozen=True):
    """First line of the rows: identifies the evaluation so that it can be resumed."""

    dataset: str
    target_sha256: str
    methods: tuple[str, ...]
    model_sha256: str


def append_row(path: Path, row: EvaluatedFrame | RunHeader) -> None:
    """Append one line; an incomplete last line is ignored on reading."""
    with path.open("ab") as file:
        file.write(msgspec.json.encode(row) + b"\n")


def read_rows(path: Path, header: RunHeader) -> list[EvaluatedFrame]:
    """Return the rows of an earlier run of the same evaluation.

    Raises
    ------
    UserError
        If they belong to another data set, model or choice of methods, or the file is longer than `MAX_BYTES`.
    """
    lines = read_regular(path, MAX_BYTES).split(b"\n")
    try:
        former = msgspec.json.decode(lines[0], type=RunHeader)
        former = msgspec.structs.replace(former, methods=tuple(name_in_file(m, path) for m in former.methods))
    except msgspec.DecodeError as error:
        raise UserError(f"{path} is not the record of an evaluation: name another folder with -o") from error
    if former != header:
        raise UserError(
            f"{path.parent} holds another evaluation (data set, model or methods differ):"
            " name another folder with -o"
        )
    return _decode(lines[1:-1], path)


def existing_rows(path: Path) -> list[EvaluatedFrame]:
    """Read the rows of an evaluation.

    Returns
    -------
    list of EvaluatedFrame
        Rows in the order of the file, without a truncated last line and lines that cannot be decoded; empty if the file
        does not exist.

    Raises
    ------
    UserError
        If the file is longer than `MAX_BYTES`.
    """
    return _decode(read_regular(path, MAX_BYTES).split(b"\n")[1:-1], path) if path.is_file() else []


def _decode(lines: Iterable[bytes], path: Path) -> list[EvaluatedFrame]:
    rows = []
    for line in lines:
        try:
            row = msgspec.json.decode(line, type=EvaluatedFrame)
            rows.append(msgspec.structs.replace(row, method=name_in_file(row.method, path)))
        except msgspec.DecodeError:
            continue
    return rows


def frames_csv(rows: Iterable[EvaluatedFrame]) -> bytes:
    """Return all rows as CSV."""
    axes = [f"shift_{a}_m" for a in "xyz"] + [f"turn_{a}_deg" for a in "xyz"]
    plain = [n for n in FrameScore.__struct_fields__ if n not in ("shift_camera_m", "turn_camera_deg")]
    names = ["frame", "method", *plain, *axes, "reason", "failure", "confidence", "total_ms"]

    def cells(row: EvaluatedFrame) -> list[object]:
        score = row.record
        both = (*(score.shift_camera_m or [""] * 3), *(score.turn_camera_deg or [""] * 3))
        start = (row.frame, row.method, *(getattr(score, name) for name in plain), *both)
        values = (*start, row.reason, row.failure, row.confidence, round(row.total_ms, 3))
        return [table_text(v) if isinstance(v, str) else v for v in values]

    return table_bytes(names, rows=map(cells, rows))
