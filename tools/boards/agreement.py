"""Agreement of two runs on the same images: by the host's estimator and by the same estimator on a board."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from flyaround.hil.host.frame_record import ACCEPTED, DECLINED, FrameRecord, pose_errors
from flyaround.hil.host.ledger.frames_csv import read_ledger
from flyaround.hil.host.ledger.summary import SUMMARY_JSON, LedgerSummary
from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

# requirements on a board: share of frames with the same decision, and difference of poses that both accept
SHARE, NEAR_DEG, NEAR_M = 0.95, 0.1, 0.010


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """Comparison of a board's run with the host's run on the same frames.

    Parameters
    ----------
    frames : int
        Number of frames of the host's run.
    same : int
        Number of frames with the same decision; a dropped frame differs.
    accepted : int
        Number of poses that both accepted.
    near : int
        Number of poses that both accepted and that differ by at most ``NEAR_DEG`` and ``NEAR_M``.
    largest_deg : float
        Maximum attitude difference of the poses that both accepted [deg].
    largest_m : float
        Maximum position difference of the poses that both accepted [m].
    estimator_ms_p50 : float
        Median run time of the estimator on the board [ms].
    estimator_ms_p95 : float
        95th percentile of the estimator's run time on the board [ms].
    """

    frames: int
    same: int
    accepted: int
    near: int
    largest_deg: float
    largest_m: float
    estimator_ms_p50: float
    estimator_ms_p95: float

    @property
    def holds(self) -> bool:
        """True if the board counts as equivalent to the host."""
        return self.accepted > 0 and self.same >= SHARE * self.frames and self.near >= SHARE * self.accepted


def agreement(host: Sequence[FrameRecord], board: Sequence[FrameRecord]) -> Agreement:
    """Compare a board's rows with the host's, frame by frame.

    Raises
    ------
    UserError
        If the runs do not have the same frames.
    """
    answers = {row.frame_id: row for row in board}
    if sorted(answers) != sorted(row.frame_id for row in host) or not host:
        raise UserError("the two runs do not have the same frames: give both the same images and -n")
    same, differences = 0, []
    for row in host:
        board_row = answers[row.frame_id]
        same += row.outcome == board_row.outcome
        if (
            row.outcome == board_row.outcome == ACCEPTED
            and row.q_wxyz
            and row.t_m
            and board_row.q_wxyz
            and board_row.t_m
        ):
            differences.append(pose_errors(board_row.q_wxyz, board_row.t_m, row.q_wxyz, row.t_m))
    far_m, far_deg = np.array(differences).reshape(-1, 2).T
    took_ms = [
        row.board_total_ms - row.board_wait_ms
        for row in board
        if row.outcome in (ACCEPTED, DECLINED)
        and row.board_total_ms is not None
        and row.board_wait_ms is not None
    ]
    p50, p95 = np.percentile(took_ms, (50, 95)) if took_ms else (np.nan, np.nan)
    return Agreement(
        frames=len(host),
        same=same,
        accepted=len(differences),
        near=int(((far_deg <= NEAR_DEG) & (far_m <= NEAR_M)).sum()),
        largest_deg=float(far_deg.max(initial=0.0)),
        largest_m=float(far_m.max(initial=0.0)),
        estimator_ms_p50=float(p50),
        estimator_ms_p95=float(p95),
    )


@dataclass(frozen=True, kw_only=True)
class BoardRun:
    """Agreement of one run as a row of the table of boards.

    Parameters
    ----------
    processor : str
        Common name of the processor.
    system : str
        Common name of the operating system.
    link : str
        Connection that carried the frames.
    python : str
        Python version that the board reported.
    opencv : str
        OpenCV version that the board reported.
    kernels : str
        ``native`` or ``numpy``.
    agreement : Agreement
        Agreement with the host's estimator.
    """

    processor: str
    system: str
    link: str
    python: str
    opencv: str
    kernels: str
    agreement: Agreement

    def row(self) -> str:
        """Return a line of the table in docs/validation/boards.md."""
        a = self.agreement
        cells = (
            self.processor,
            self.system,
            self.python,
            self.opencv,
            self.kernels,
            self.link,
            str(a.frames),
            f"{a.same} of {a.frames}",
            f"{a.near} of {a.accepted}",
            f"{a.largest_deg:.2g} deg, {1e3 * a.largest_m:.2g} mm",
            f"{a.estimator_ms_p50:.0f} / {a.estimator_ms_p95:.0f}",
        )
        return "| " + " | ".join(cells) + " |"


HEADINGS = (
    "processor",
    "system",
    "Python",
    "OpenCV",
    "kernels",
    "link",
    "frames",
    "same decision",
    "within 0.1 deg and 10 mm",
    "largest difference",
    "estimator p50 / p95 [ms]",
)


def table_head() -> str:
    """Return the first two lines of the table."""
    return f"| {' | '.join(HEADINGS)} |\n|{'---|' * len(HEADINGS)}"


def compare_runs(host: Path, board: Path, processor: str, system: str, link: str) -> BoardRun:
    """Return a row of the table from two ledger folders.

    Raises
    ------
    UserError
        If a ledger cannot be read, the frames are not the same, or the versions of OpenCV differ.
    """
    reference, reported = _told(host), _told(board)
    if reference["opencv"] != reported["opencv"]:
        raise UserError(
            f"the host's estimator ran with OpenCV {reference['opencv']}, the board's with {reported['opencv']}:"
            " install the same version on both"
        )
    return BoardRun(
        processor=processor,
        system=system,
        link=link,
        agreement=agreement(read_ledger(host), read_ledger(board)),
        **reported,
    )


def _told(folder: Path) -> dict[str, str]:
    """Return the versions that a board reported in its HELLO."""
    try:
        summary = msgspec.json.decode((folder / SUMMARY_JSON).read_bytes(), type=LedgerSummary)
    except (OSError, msgspec.DecodeError) as error:
        raise UserError(
            f"{folder} holds no summary of a run ({error}): name a folder of hil host --log"
        ) from error
    report = "" if summary.board is None else summary.board.name
    match = re.search(r"Python (\S+), OpenCV (\S+), (\w+)$", report)
    if match is None:
        raise UserError(
            f"the board of {folder} reports {report!r}, the form of an older bundle; write the bundle anew"
        )
    return dict(zip(("python", "opencv", "kernels"), match.groups(), strict=True))
